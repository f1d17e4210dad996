"""The size of a file on paper follows from the resolution of its image."""

from __future__ import annotations

import io
import re

import numpy as np
import pytest
from PIL import Image

import warpsplat
from warpsplat.errors import UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.run.result import Result


def drawing(width: int = 60, height: int = 40, **saved: object) -> bytes:
    """A drawing in a PNG."""
    pixels = np.full((height, width, 3), 255, np.uint8)
    pixels[height // 4 : height // 2, width // 4 : width // 2] = 30
    out = io.BytesIO()
    Image.fromarray(pixels).resize((2 * width, 2 * height), 0).save(out, "PNG", **saved)
    return out.getvalue()


def made(image: object, **options: object) -> Result:
    return warpsplat.vectorize(image, quality="draft", subject="drawing", **options)


def size(result: Result) -> tuple[str, str]:
    found = re.match(r'<svg [^>]*?width="(.*?)" height="(.*?)"', result.svg)
    assert found
    return found[1], found[2]


@pytest.mark.parametrize(
    ("stated", "options", "wanted"),
    [
        (254, {"units": "mm"}, ("12mm", "8mm")),
        (254, {"units": "cm"}, ("1.2cm", ".8cm")),
        (254, {"units": "in", "dpi": 100}, ("1.2in", ".8in")),
        (None, {"dpi": 25.4}, ("120mm", "80mm")),  # alone it is in millimetres
        (None, {"units": "in"}, ("1.25in", ".833333in")),  # of 96 pixels
        (254, {"size": "60x40mm"}, ("60mm", "40mm")),
    ],
)
def test_the_size_is_that_of_the_option_or_the_file(
    stated: int | None, options: dict[str, object], wanted: tuple[str, str]
) -> None:
    image = drawing(**({"dpi": (stated, stated)} if stated else {}))
    result = made(image, **options)
    assert size(result) == size(made(Image.open(io.BytesIO(image)), **options)) == wanted
    if options == {"units": "mm"}:
        assert result.notes[-1] == "12x8 mm: 254 pixels per inch, by the image file"
    if options == {"units": "in"}:
        assert "--dpi" in result.notes[-1]


def test_pixels_stay_pixels() -> None:
    assert size(made(drawing(dpi=(254, 254)), units="px")) == ("120px", "80px")
    result = made(drawing(dpi=(254, 254)))
    assert result.svg.startswith('<svg viewBox="0 0 960 640" xmlns="http://www.w3.org/2000/svg" height="80" ')
    assert not any("inch" in note for note in result.notes)


def test_pixels_that_are_no_squares() -> None:
    """A fax: twice as many pixels per inch across as down."""
    text = made(drawing(dpi=(254, 127)), units="mm").svg
    assert text.startswith('<svg xmlns="http://www.w3.org/2000/svg" width="12mm" height="16mm" preserve')
    shown = np.asarray(warpsplat.render(text, renderer="viewer"))[..., 0]
    assert shown.shape == (60, 45)
    inked = np.argwhere(shown < 0.5)
    assert (inked.min(axis=0) + 0.5, inked.max(axis=0) + 0.5) == (
        pytest.approx((15.5, 11.5), abs=1),
        pytest.approx((29.5, 22), abs=1),
    )


def test_images_that_are_processed_smaller_keep_their_size() -> None:
    large = drawing(900, 700, dpi=(254, 254))  # was enlarged by repeating pixels
    assert size(made(large, units="mm")) == ("180mm", "140mm")
    result = made(large, units="mm", max_memory="500MB")
    assert result.reduced
    assert size(result) == ("180mm", "140mm")


@pytest.mark.parametrize("other", [{"size": "1x1in"}, {"page": "a4"}, {"units": "px"}])
def test_contradictions(other: dict[str, str]) -> None:
    with pytest.raises(UsageError, match=f"dpi and {next(iter(other))}.* cannot be combined"):
        make_settings(dpi=300, **other)
