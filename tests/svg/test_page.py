"""Files as large as a sheet."""

from __future__ import annotations

import re

import numpy as np
import pytest

from warpsplat.errors import UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.scene import Canvas, Kind, Scene
from warpsplat.svg.page import Sheet, on_sheet, parse_page, parse_size, placed
from warpsplat.svg.viewer import render_svg
from warpsplat.svg.write import write_svg


def picture(width: int = 60, height: int = 40) -> str:
    points = np.array([[[10, 10], [20, 10], [30, 10], [50, 30]]], np.float32)
    scene = Scene.uniform(
        Kind.STROKE, Canvas(width, height, None), points, widths=np.array([4.0]), opacities=np.ones(1)
    )
    return write_svg(scene, per_pixel=5)


def head(text: str) -> tuple[str, ...]:
    found = re.search(r'width="(.*?)" height="(.*?)" viewBox="(.*?)"', text)
    assert found
    return found.groups()


def test_sizes_and_pages() -> None:
    assert parse_size("200x150mm") == Sheet(200, 150)
    assert parse_size("20 x 15 cm") == Sheet(200, 150)
    assert parse_size("8x6", "in") == Sheet(8 * 25.4, 6 * 25.4, unit="in")
    assert parse_page("A4", 100, 200) == Sheet(210, 297, 10)
    assert parse_page("a4", 200, 100, 5) == Sheet(297, 210, 5)


@pytest.mark.parametrize(
    ("call", "named"),
    [
        (lambda: parse_size("200"), "200x150mm"),
        (lambda: parse_size("0x10mm"), "0x10mm"),
        (lambda: parse_size("99999x10mm"), "99999x10mm"),
        (lambda: parse_page("b9", 1, 1), "b9"),
        (lambda: parse_page("a4", 1, 1, 110), "110 mm"),
        (lambda: parse_size("1x1", "ell"), "ell"),
    ],
)
def test_what_is_no_sheet_is_named(call: object, named: str) -> None:
    with pytest.raises(UsageError, match=re.escape(named)):
        call()  # type: ignore[operator]


def test_a_picture_keeps_its_size_in_millimetres() -> None:
    assert head(placed(picture(), "", "", "mm")) == ("15.875mm", "10.583mm", "0 0 300 200")


def test_a_picture_lies_in_the_middle_of_its_sheet() -> None:
    """Between margins of 10 mm, 300 units are 100 mm wide: the sheet has 3 units a millimetre."""
    text = on_sheet(picture(), Sheet(120, 150, 10))
    assert head(text) == ("120mm", "150mm", "-30 -125 360 450")
    assert text.split(">", 1)[1] == picture().split(">", 1)[1]


def test_a_viewer_shows_it_there() -> None:
    sheet = Sheet(25.4, 25.4)  # 96 px
    shown = np.asarray(render_svg(on_sheet(picture(), sheet)).convert("RGBA"))[..., 3] > 128
    rows, columns = np.nonzero(shown)
    scale = 96 / 60
    assert shown.shape == (96, 96)
    assert (columns.min(), columns.max() + 1) == pytest.approx((8 * scale, 52 * scale), abs=1.5)
    assert rows.min() == pytest.approx((8 + 10) * scale, abs=1.5)


@pytest.mark.parametrize("placing", [{"size": 3}, {"page": 4}, {"units": True, "page": "a4"}])
def test_what_is_no_text_is_named(placing: dict[str, object]) -> None:
    with pytest.raises(UsageError, match="must be text, not "):
        make_settings(**placing)  # as a batch file may give it
