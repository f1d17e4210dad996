"""Files as large as a sheet of paper, for plotters and printers."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from warpsplat.errors import UsageError, cut, shown
from warpsplat.svg.inspect import NAMESPACE
from warpsplat.svg.numbers import number
from warpsplat.svg.write import GRIDS, MARK, head_of, own_head

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "px": 25.4 / 96}
"""Length of a CSS unit [mm]."""

PAGES = {"a3": (297.0, 420.0), "a4": (210.0, 297.0), "a5": (148.0, 210.0), "letter": (215.9, 279.4)}
"""Width and height of sheets upright [mm]."""

MARGIN = 10.0
"""Margin of a page on each side [mm]."""

LARGEST = 10_000.0
"""Longest side of a sheet [mm]."""

VIEW = re.compile(
    rf'<svg xmlns="{re.escape(NAMESPACE)}" (width="[\d.]+[a-z]+" height="[\d.]+[a-z]+") '
    r'viewBox="(-?[\d.]+) (-?[\d.]+) ([\d.]+) ([\d.]+)"'
)
"""The beginning of a file on a sheet: the sheet's size, and its box in units of the file."""

OUR_VIEW = re.compile(f"{VIEW.pattern}>{MARK}")
"""The same, surely written here: margins of other files may belong to the picture."""

LENGTH = re.compile(r"(\d+(?:\.\d+)?)\s*(mm|cm|in|pt)?", re.IGNORECASE)
"""A length in pixels, or on the sheet."""

SIZE = re.compile(r"(\d+(?:\.\d+)?)\s*[x×]\s*(\d+(?:\.\d+)?)\s*(mm|cm|in|pt|px)?", re.IGNORECASE)

DECIMALS = 3
"""Decimals of sizes and boxes."""


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

    def scale(self, width: float, height: float) -> float:
        """Return how many units of a picture of that size are a millimetre."""
        return max(width / (self.width - 2 * self.margin), height / (self.height - 2 * self.margin))


def sheet_for(size: str, page: str, unit: str, width: int, height: int) -> Sheet:
    """Return the sheet that options ask for.

    Args:
        size: A size such as ``200x150mm`` or ``8x6in``; without a unit, in ``unit``. Empty: none.
        page: A standard format, with margins, in landscape for a picture wider than high. Empty: none.
        unit: Unit of the size in the file; empty: millimetres.
        width: Width of the picture [px], its own size if there is neither a size nor a page.
        height: Height of the picture [px].

    Raises:
        UsageError: An option is invalid.
    """
    if unit and unit not in MILLIMETRES:
        raise UsageError(f"units must be one of {', '.join(MILLIMETRES)}, not {shown(unit)}")
    unit = unit or "mm"
    if not size and not page:
        return Sheet(width * MILLIMETRES["px"], height * MILLIMETRES["px"], unit=unit)
    if not size:
        if page.lower() not in PAGES:
            raise UsageError(f"page must be one of {', '.join(PAGES)}, not {shown(page)}")
        short, long = PAGES[page.lower()]
        return Sheet(*((long, short) if width > height else (short, long)), MARGIN, unit)
    found = SIZE.fullmatch(size.strip())
    if not found:
        raise UsageError(f"not a size: {shown(size)}; write 200x150mm")
    factor = MILLIMETRES[(found[3] or unit).lower()]
    sides = [float(found[i]) * factor for i in (1, 2)]
    if not all(0 < side <= LARGEST for side in sides):
        raise UsageError(f"size {cut(size)} leaves no room, or has a side beyond {LARGEST:g} mm")
    return Sheet(sides[0], sides[1], unit=unit)


def in_pixels(length: str, sheet: Sheet, width: int, height: int) -> float:
    """Return a length in pixels of an image of that size: ``2``, or on its sheet, as ``0.3mm``.

    Raises:
        UsageError: It is not a length, or zero.
    """
    found = LENGTH.fullmatch(length.strip())
    if not found or not float(found[1]):
        raise UsageError(f"width must be pixels, such as 2, or a length such as 0.3mm, not {shown(length)}")
    factor = MILLIMETRES[found[2].lower()] * sheet.scale(width, height) if found[2] else 1.0
    return float(found[1]) * factor


def placed(text: str, size: str, page: str, unit: str) -> str:
    """Return a file written here, as large as options ask for; arguments and errors as ``sheet_for``."""
    if not (size or page or unit):
        return text
    head = own_head(text)
    sheet = sheet_for(size, page, unit, int(head[1]), int(head[2]))
    if size or page:
        return on_sheet(text, sheet)
    return _with_head(text, _attributes(sheet), (0, 0, float(head[3]), float(head[4])))


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
    width, height = (
        number(side / MILLIMETRES[sheet.unit], DECIMALS) + sheet.unit for side in (sheet.width, sheet.height)
    )
    return f'width="{width}" height="{height}"'


def _with_head(text: str, size: str, view: Iterable[float]) -> str:
    """Return the file with other attributes for its size and another view box."""
    box = " ".join(number(value, DECIMALS) for value in view)
    return f'<svg xmlns="{NAMESPACE}" {size} viewBox="{box}">{text[own_head(text).end() :]}'


PROPORTIONS = 0.02
"""Largest relative difference between the proportions of a picture on a sheet and those of an image."""


def picture_view(svg: str, width: int, height: int) -> str | None:
    """Return the view box of the picture alone in a file that has it in the middle of a sheet, or None.

    None as well if the picture has not the proportions of the image, ``width`` x ``height`` px. Margins are
    in whole units, so that the space between them is up to a unit more or less than the picture, whose pixels
    are one of ``GRIDS`` units wide.
    """
    found = VIEW.match(svg)
    if not found:
        return None
    left, top, across, down = (float(found[i]) for i in range(2, 6))
    spaces = (((across + 2 * left) / width, width), ((down + 2 * top) / height, height))
    low = max(space - 1 / side for space, side in spaces)
    high = min(space + 1 / side for space, side in spaces)
    middle = (low + high) / 2
    if low > (1 + PROPORTIONS) * high or middle <= 0:
        return None
    known = [grid for grid in GRIDS if low <= grid <= high]
    units = min(known, key=lambda grid: abs(grid - middle)) if known else middle
    return f"0 0 {units * width:.10g} {units * height:.10g}"


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
    return _with_head(text, sheet[1], (scale * float(sheet[i]) for i in range(2, 6)))
