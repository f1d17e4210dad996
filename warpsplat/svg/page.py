"""Files with a size on paper: that of a sheet, for plotters and printers, or the picture's own."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from warpsplat.errors import UsageError, cut, shown
from warpsplat.svg.inspect import NAMESPACE
from warpsplat.svg.numbers import number
from warpsplat.svg.write import GRIDS, MARK, head_of, own_head

INCH = 25.4
"""Length of an inch [mm]."""

PIXELS_AN_INCH = 96.0
"""Resolution of images that state none, as in CSS."""

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "in": INCH, "pt": INCH / 72, "px": INCH / PIXELS_AN_INCH}
"""Length of a CSS unit [mm]."""

PAGES = {"a3": (297.0, 420.0), "a4": (210.0, 297.0), "a5": (148.0, 210.0), "letter": (215.9, 279.4)}
"""Width and height of sheets upright [mm]."""

MARGIN = 10.0
"""Margin of a page on each side [mm]."""

STRETCHED = 'preserveAspectRatio="none"'
"""Attribute of a picture whose pixels are no squares."""

VIEW = re.compile(
    rf'<svg xmlns="{re.escape(NAMESPACE)}" (width="[\d.]+[a-z]+" height="[\d.]+[a-z]+"(?: {STRETCHED})?) '
    r'viewBox="(-?[\d.]+) (-?[\d.]+) ([\d.]+) ([\d.]+)"'
)
"""The beginning of a file on a sheet: the sheet's size, and its box in units of the file."""

OUR_VIEW = re.compile(f"{VIEW.pattern}>{MARK}")
"""The same, surely written here: margins of other files may belong to the picture."""

LENGTH = re.compile(r"(\d+(?:\.\d+)?)\s*(mm|cm|in|pt)?", re.IGNORECASE)
"""A length in pixels, or on the sheet."""

SIZE = re.compile(
    r"(?=.*\d)(\d+(?:\.\d+)?)?\s*(?:[x×]\s*(\d+(?:\.\d+)?))?\s*(mm|cm|in|pt|px)?", re.IGNORECASE
)
"""A width, a height after an x, or both; and a unit."""

DIGITS, MOST_DECIMALS = 6, 12
"""Significant digits of sizes, and how many of them may be decimals."""


@dataclass(frozen=True)
class Sheet:
    """The paper that a picture is drawn on."""

    width: float
    """[mm]"""
    height: float
    """[mm]"""
    margin: float = 0.0
    """Kept free on each side [mm]."""
    unit: str = "mm"
    """Unit of the size in the file."""

    def lengths(self) -> tuple[str, str]:
        """Return width and height in the unit, as texts."""
        sides = (side / MILLIMETRES[self.unit] for side in (self.width, self.height))
        width, height = (number(float(f"{side:.{DIGITS}g}"), MOST_DECIMALS) for side in sides)
        return width, height

    def scale(self, width: float, height: float) -> float:
        """Return how many units of a picture of that size make a millimetre."""
        return max(width / (self.width - 2 * self.margin), height / (self.height - 2 * self.margin))


def sheet_for(size: str, page: str, unit: str, width: int, height: int) -> Sheet:
    """Return the sheet that options ask for, for a picture of ``width`` x ``height``.

    ``size``: such as ``200x150mm`` or ``8x6in``; without a unit, in ``unit``. Of a width alone, as in
    ``200mm``, or a height, ``x150mm``, the other side follows. ``page``, if there is no size: a standard
    format, with margins, in landscape for a picture wider than high. ``unit``: of the size in the file;
    empty: millimetres.

    Raises:
        UsageError: An option is invalid.
    """
    unit = checked_unit(unit)
    if not size:
        if page.lower() not in PAGES:
            raise UsageError(f"page must be one of {', '.join(PAGES)}, not {shown(page)}")
        short, long = PAGES[page.lower()]
        return Sheet(*((long, short) if width > height else (short, long)), MARGIN, unit)
    found = SIZE.fullmatch(size.strip())
    if not found:
        raise UsageError(f"not a size: {shown(size)}; write 200x150mm, or one side: 200mm or x150mm")
    factor = MILLIMETRES[(found[3] or unit).lower()]
    across, down = (float(side) * factor if side else None for side in found.groups()[:2])
    largest = 10_000.0  # longest side of a sheet [mm]
    if not all(0 < side <= largest for side in (across, down) if side is not None):
        raise UsageError(f"size {cut(size)} leaves no room, or has a side beyond {largest:g} mm")
    if across is None:
        assert down
        return Sheet(down * width / height, down, unit=unit)
    return Sheet(across, across * height / width if down is None else down, unit=unit)


def length_of(text: str, option: str) -> tuple[float, str]:
    """Return a length such as ``0.3mm`` as a number and its unit, empty if there is none.

    Raises:
        UsageError: It is not a length, or zero.
    """
    found = LENGTH.fullmatch(text.strip())
    if not found or not float(found[1]):
        raise UsageError(f"{option} must be pixels, such as 2, or a length such as 0.3mm, not {shown(text)}")
    return float(found[1]), (found[2] or "").lower()


def checked_unit(unit: str) -> str:
    """Return a unit, millimetres if it is empty; raise ``UsageError`` for one that is unknown."""
    if unit and unit not in MILLIMETRES:
        raise UsageError(f"units must be one of {', '.join(MILLIMETRES)}, not {shown(unit)}")
    return unit or "mm"


def natural_sheet(width: int, height: int, resolution: tuple[float, float], unit: str) -> Sheet:
    """Return a sheet of a picture's own size [px], in a unit as ``sheet_for``.

    ``resolution``: pixels per inch along x and y, without effect on a size in ``px``.
    """
    unit = checked_unit(unit)
    across, down = (PIXELS_AN_INCH, PIXELS_AN_INCH) if unit == "px" else resolution
    return Sheet(INCH * width / across, INCH * height / down, unit=unit)


def with_own_size(text: str, sheet: Sheet) -> str:
    """Return a file written here that fills a sheet; pixels are no squares if its proportions are others."""
    head = own_head(text)
    width, height = int(head[1]), int(head[2])
    is_square = math.isclose(sheet.width * height, sheet.height * width, rel_tol=1e-9)
    size = _attributes(sheet) + ("" if is_square else f" {STRETCHED}")
    return _with_head(text, size, (0, 0, float(head[3]), float(head[4])))


def on_sheet(text: str, sheet: Sheet) -> str:
    """Return a file written here, as large as the sheet allows and centred.

    Paths stay as they are: the view box, in whole units, is what the sheet covers.
    """
    head = own_head(text)
    width, height = float(head[3]), float(head[4])
    units = sheet.scale(width, height)
    across, down = math.ceil(sheet.width * units), math.ceil(sheet.height * units)
    left, top = round((width - across) / 2), round((height - down) / 2)
    return _with_head(text, _attributes(sheet), (left, top, across, down))


def _attributes(sheet: Sheet) -> str:
    """Return the size of a sheet as attributes."""
    width, height = sheet.lengths()
    return f'width="{width}{sheet.unit}" height="{height}{sheet.unit}"'


def _with_head(text: str, size: str, view: Iterable[float]) -> str:
    """Return the file with other attributes for its size and another view box."""
    decimals = 3  # decimals of boxes
    box = " ".join(number(value, decimals) for value in view)
    return f'<svg xmlns="{NAMESPACE}" {size} viewBox="{box}">{text[own_head(text).end() :]}'


def picture_view(svg: str, width: int, height: int) -> str | None:
    """Return the view box of the picture alone in a file that has it in the middle of a sheet, or None.

    None as well if the picture has not the proportions of the image, ``width`` x ``height`` px. Margins are
    in whole units, so that the space between them is up to a unit more or less than the picture, whose pixels
    are one of ``GRIDS`` units wide.
    """
    found = VIEW.match(svg)
    if not found:
        return None
    left, top, across, down = map(float, found.groups()[1:])
    spaces = (((across + 2 * left) / width, width), ((down + 2 * top) / height, height))
    low = max(space - 1 / side for space, side in spaces)
    high = min(space + 1 / side for space, side in spaces)
    middle = (low + high) / 2
    # Largest relative difference between the proportions of a picture on a sheet and those of an image.
    proportions = 0.02
    if low > (1 + proportions) * high or middle <= 0:
        return None
    known = [grid for grid in GRIDS if low <= grid <= high]
    units = min(known, key=lambda grid: abs(grid - middle)) if known else middle
    return f"0 0 {units * width:.10g} {units * height:.10g}"


def picture_area(svg: str) -> tuple[float, float, float, float] | None:
    """Return the left, top, right and bottom of the picture on a sheet written here, over the sheet's sides.

    Margins are in whole units, so that right and bottom may be two units too small. None: no such sheet.
    """
    found = OUR_VIEW.match(svg)
    if not found:
        return None
    left, top, across, down = map(float, found.groups()[1:])
    return -left / across, -top / down, 1 + (left - 1) / across, 1 + (top - 1) / down


def with_view(svg: str, view: str, width: int, height: int) -> str:
    """Return a file on a sheet with the view box ``view`` and the image's size [px]."""
    return VIEW.sub(head_of(width, height, view).removesuffix(">"), svg, count=1)


def on_sheet_of(svg: str, view: str, text: str) -> str:
    """Return ``text``, a file written here, on the sheet of ``svg``, in place of the picture there.

    ``view``: that picture's view box.
    """
    sheet = VIEW.match(svg)
    assert sheet
    scale = float(own_head(text)[3]) / float(view.split()[2])
    return _with_head(text, sheet[1], (scale * float(side) for side in sheet.groups()[1:]))
