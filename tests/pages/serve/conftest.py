from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.files.test_formats import programs  # noqa: F401
from tests.pages.serve.helpers import Visitor
from warpsplat.fit.settings import PRESETS


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Runs are short, but for those that are stopped."""
    short: dict[str, Any] = {"iterations": 12}
    for name in PRESETS:
        monkeypatch.setitem(PRESETS, name, short)
    monkeypatch.setitem(PRESETS, "high", {"iterations": 1_000_000})


@pytest.fixture
def visitor() -> Iterator[Visitor]:
    with Visitor() as made:
        yield made
