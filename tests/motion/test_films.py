"""Sizes of films."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from warpsplat.motion.films import encoded, zoom_of


@pytest.mark.parametrize("ending", [".gif", ".webp", ".mp4"])
@pytest.mark.parametrize("width", [None, 16])
def test_a_thin_picture_keeps_a_pixel(ending: str, width: int | None) -> None:
    for size in ((3000.0, 2.0), (2.0, 3000.0), (1.0, 1.0), (640.0, 480.0)):
        zoom = zoom_of(Path(f"a{ending}"), size, width)
        assert min(size) * zoom >= 1 - 1e-9
    assert zoom_of(Path(f"a{ending}"), (640, 480), 16) == 16 / 640


@pytest.mark.parametrize("size", [(40_000, 2), (2, 40_000), (10, 1000)])
@pytest.mark.parametrize("width", [None, 2048])
def test_no_side_is_longer_than_films_can_be(size: tuple[int, int], width: int | None) -> None:
    zoom = zoom_of(Path("a.webp"), size, width)
    picture = Image.new("RGB", (max(1, int(size[0] * zoom)), max(1, int(size[1] * zoom))))
    assert encoded(Path("a.webp"), [(picture, 1.0)])[:4] == b"RIFF"
