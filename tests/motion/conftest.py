from __future__ import annotations

import pytest

from tests.motion.helpers import recording
from warpsplat import Recorder, Result


@pytest.fixture(scope="session")
def recorded() -> tuple[Recorder, Result]:
    return recording(iterations=70)
