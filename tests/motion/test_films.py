"""Sizes of films."""

from __future__ import annotations

from pathlib import Path

import pytest

from warpsplat.motion.films import zoom_of


@pytest.mark.parametrize("ending", [".gif", ".webp", ".mp4"])
@pytest.mark.parametrize("width", [None, 16])
def test_a_thin_picture_keeps_a_pixel(ending: str, width: int | None) -> None:
    for size in ((3000.0, 2.0), (2.0, 3000.0), (1.0, 1.0), (640.0, 480.0)):
        zoom = zoom_of(Path(f"a{ending}"), size, width)
        assert min(size) * zoom >= 1 - 1e-9
    assert zoom_of(Path(f"a{ending}"), (640, 480), 16) == 16 / 640
