"""Which files of a folder are taken for images."""

from __future__ import annotations

from PIL import Image

from tests.files.test_formats import PIXELS
from warpsplat.batch.images import ENDINGS


def test_the_formats_of_folders_are_read() -> None:
    Image.init()
    own = [ending for ending in ENDINGS if ending not in {".jfif", ".heic", ".heif", ".jxl"}]
    assert {Image.registered_extensions()[ending] for ending in own} <= PIXELS
