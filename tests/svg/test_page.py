"""Files as large as a sheet."""

from __future__ import annotations

import re

import numpy as np
import pytest

from warpsplat.errors import UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.scene import Canvas, Kind, Scene
from warpsplat.svg.page import (
    Sheet,
    natural_sheet,
    on_sheet,
    on_sheet_of,
    picture_view,
    sheet_for,
    with_own_size,
)
from warpsplat.svg.viewer import render_svg
from warpsplat.svg.write import write_svg


def picture() -> str:
    points = np.array([[[10, 10], [20, 10], [30, 10], [50, 30]]], np.float32)
    lines = {"widths": np.array([4.0]), "opacities": np.ones(1)}
    return write_svg(Scene.uniform(Kind.STROKE, Canvas(60, 40, None), points, **lines), per_pixel=5)


def head(text: str) -> tuple[str, ...]:
    found = re.search(r'width="(.*?)" height="(.*?)" viewBox="(.*?)"', text)
    assert found
    return found.groups()


def test_sizes_and_pages() -> None:
    assert sheet_for("200x150mm", "", "", 1, 1) == Sheet(200, 150)
    assert sheet_for("20 x 15 cm", "", "", 1, 1) == Sheet(200, 150)
    assert sheet_for("8x6", "", "in", 1, 1) == Sheet(8 * 25.4, 6 * 25.4, unit="in")
    assert sheet_for("200mm", "", "", 4, 3) == sheet_for("x150mm", "", "", 4, 3) == Sheet(200, 150)
    assert sheet_for("", "A4", "", 100, 200) == Sheet(210, 297, 10)
    assert sheet_for("", "a4", "cm", 200, 100) == Sheet(297, 210, 10, "cm")


@pytest.mark.parametrize(
    ("size", "page", "unit", "named"),
    [
        ("mm", "", "mm", "200x150mm"),
        ("4x3x", "", "", "4x3x"),
        ("0x10mm", "", "", "0x10mm"),
        ("99999x10mm", "", "", "99999x10mm"),
    ]
    + [("1x1", "", "ell", "ell"), ("", "b9", "", "b9")],
)
def test_invalid_options_are_named(size: str, page: str, unit: str, named: str) -> None:
    with pytest.raises(UsageError, match=named):
        sheet_for(size, page, unit, 1, 1)


def test_a_picture_is_in_the_middle_of_its_sheet() -> None:
    """Between margins of 10 mm, 300 units are 100 mm wide: the sheet has 3 units a millimetre."""
    text = on_sheet(picture(), Sheet(120, 150, 10))
    assert head(text) == ("120mm", "150mm", "-30 -125 360 450")
    assert text.split(">", 1)[1] == picture().split(">", 1)[1]


def test_a_picture_of_its_own_size_fills_its_sheet() -> None:
    sheet = natural_sheet(60, 40, (300, 300), "")
    assert head(with_own_size(picture(), sheet)) == ("5.08mm", "3.38667mm", "0 0 300 200")
    stretched = with_own_size(picture(), natural_sheet(60, 40, (300, 150), "in"))
    assert head(stretched) == (".2in", '.266667in" preserveAspectRatio="none', "0 0 300 200")
    view = picture_view(stretched, 60, 40)
    assert view == "0 0 300 200"
    assert on_sheet_of(stretched, view, picture()) == stretched


def test_a_viewer_shows_it_in_the_middle() -> None:
    sheet = Sheet(25.4, 25.4)  # 96 px
    shown = np.asarray(render_svg(on_sheet(picture(), sheet)).convert("RGBA"))[..., 3] > 128
    rows, columns = np.nonzero(shown)
    scale = 96 / 60
    assert shown.shape == (96, 96)
    assert (columns.min(), columns.max() + 1) == pytest.approx((8 * scale, 52 * scale), abs=1.5)
    assert rows.min() == pytest.approx((8 + 10) * scale, abs=1.5)


@pytest.mark.parametrize("placing", [{"size": 3}, {"page": 4}, {"units": True, "page": "a4"}])
def test_values_that_are_no_text_are_named(placing: dict[str, object]) -> None:
    with pytest.raises(UsageError, match="must be text, not "):
        make_settings(**placing)  # as a batch file may give it
