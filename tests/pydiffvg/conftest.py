"""Programs written for DiffVG expect the usual type of numbers."""

from __future__ import annotations

import pytest


@pytest.fixture(autouse=True)
def usual_type(single_precision: None) -> None:
    """See ``single_precision``."""
