"""Images that are uploaded."""

from __future__ import annotations

import pytest

from tests.files.test_formats import ENDLESS
from warpsplat.errors import ImageError
from warpsplat.pages.serve.pictures import read_picture


def test_postscript_is_run_by_nothing(programs: list[str]) -> None:
    with pytest.raises(ImageError, match="not an image of a format that is read"):
        read_picture(ENDLESS, "x.png")
    assert programs == []
