"""Files as large as a sheet of paper, for plotters and printers."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from warpsplat.errors import UsageError, cut, shown
from warpsplat.svg.numbers import number
from warpsplat.svg.write import GRIDS, MARK, NAMESPACE, own_head

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "px": 25.4 / 96}
"""Length of a CSS unit [mm]."""

PAGES = {"a3": (297.0, 420.0), "a4": (210.0, 297.0), "a5": (148.0, 210.0), "letter": (215.9, 279.4)}
"""Width and height of sheets upright [mm]."""

MARGIN = 10.0
"""Default margin of a page on each side [mm]."""

LARGEST = 10_000.0
"""Longest side of a sheet [mm]."""

VIEW = re.compile(
    rf'<svg xmlns="{re.escape(NAMESPACE)}" (width="[\d.]+[a-z]+" height="[\d.]+[a-z]+") '
    r'viewBox="(-?[\d.]+) (-?[\d.]+) ([\d.]+) ([\d.]+)"'
)
"""The beginning of a file on a sheet: the sheet's size, and its box in units of the file."""

OUR_VIEW = re.compile(f"{VIEW.pattern}>{MARK}")
"""The same, surely written here: margins of other files may belong to the picture."""

NUMBER = r"(\d+(?:\.\d+)?)"
SIZE = re.compile(rf"{NUMBER}\s*[x×]\s*{NUMBER}\s*(mm|cm|in|pt|px)?", re.IGNORECASE)

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


def parse_size(text: str, unit: str = "mm") -> Sheet:
    """Return the sheet of a size such as ``200x150mm`` or ``8x6in``.

    Args:
        text: Width and height; without a unit, in ``unit``.
        unit: Unit of the size in the file.

    Raises:
        UsageError: The text is not a size.
    """
    check_unit(unit)
    found = SIZE.fullmatch(text.strip())
    if not found:
        raise UsageError(f"not a size: {shown(text)}; write 200x150mm")
    factor = MILLIMETRES[(found[3] or unit).lower()]
    return _checked(Sheet(float(found[1]) * factor, float(found[2]) * factor, unit=unit), text)


def parse_page(name: str, width: int, height: int, margin: float = MARGIN, unit: str = "mm") -> Sheet:
    """Return a sheet of a standard format, in landscape for a picture that is wider than high.

    Args:
        name: The format.
        width: Width of the picture.
        height: Height of the picture.
        margin: Kept free on each side [mm].
        unit: Unit of the size in the file.

    Raises:
        UsageError: There is no such format, or no space between the margins.
    """
    check_unit(unit)
    if name.lower() not in PAGES:
        raise UsageError(f"page must be one of {', '.join(PAGES)}, not {shown(name)}")
    short, long = PAGES[name.lower()]
    sides = (long, short) if width > height else (short, long)
    return _checked(Sheet(*sides, margin, unit), f"{name} with margins of {margin:g} mm")


def check_unit(unit: str) -> None:
    """Raise ``UsageError`` for a unit that files cannot have."""
    if unit not in MILLIMETRES:
        raise UsageError(f"units must be one of {', '.join(MILLIMETRES)}, not {shown(unit)}")


def _checked(sheet: Sheet, name: str) -> Sheet:
    for side in (sheet.width, sheet.height):
        if not 0 < side <= LARGEST or sheet.margin < 0 or side <= 2 * sheet.margin:
            raise UsageError(f"size {cut(name)} leaves no room, or has a side beyond {LARGEST:g} mm")
    return sheet


def check_placing(size: str, page: str, unit: str) -> None:
    """Raise ``UsageError`` for options that ``placed`` does not understand."""
    if size:
        parse_size(size, unit or "mm")
    elif page:
        parse_page(page, 1, 1, unit=unit or "mm")
    elif unit:
        check_unit(unit)


def placed(text: str, size: str, page: str, unit: str) -> str:
    """Return a file written here, as large as options ask for.

    Args:
        text: The file.
        size: A size as for ``parse_size``; empty: none.
        page: A page as for ``parse_page``; empty: none.
        unit: Unit of the file's size; empty: pixels, or millimetres of a size or page.

    Raises:
        UsageError: An option is invalid, or both a size and a page are given.
    """
    check_placing(size, page, unit)
    if not (size or page or unit):
        return text
    if size:
        return on_sheet(text, parse_size(size, unit or "mm"))
    head = own_head(text)
    width, height = int(head[1]), int(head[2])
    if page:
        return on_sheet(text, parse_page(page, width, height, unit=unit or "mm"))
    sheet = Sheet(width * 25.4 / 96, height * 25.4 / 96, unit=unit)
    return _with_size(text, sheet, (0, 0, float(head[3]), float(head[4])))


def on_sheet(text: str, sheet: Sheet) -> str:
    """Return a file written here, as large as the sheet allows and centred.

    Paths stay as they are: the view box, in whole units, is what the sheet covers.
    """
    head = own_head(text)
    width, height = float(head[3]), float(head[4])
    units = max(width / (sheet.width - 2 * sheet.margin), height / (sheet.height - 2 * sheet.margin))
    across, down = math.ceil(sheet.width * units), math.ceil(sheet.height * units)
    left, top = round((width - across) / 2), round((height - down) / 2)
    return _with_size(text, sheet, (left, top, across, down))


def _with_size(text: str, sheet: Sheet, view: tuple[float, float, float, float]) -> str:
    """Return the file with another size and view box."""
    width, height = (
        number(side / MILLIMETRES[sheet.unit], DECIMALS) + sheet.unit for side in (sheet.width, sheet.height)
    )
    box = " ".join(number(value, DECIMALS) for value in view)
    return _with_head(text, f'width="{width}" height="{height}"', box)


def _with_head(text: str, size: str, box: str) -> str:
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
    head = f'<svg xmlns="{NAMESPACE}" width="{width}" height="{height}" viewBox="{view}"'
    return VIEW.sub(head, svg, count=1)


def on_sheet_of(svg: str, view: str, text: str) -> str:
    """Return ``text``, a file written here, on the sheet of ``svg``, in the place and size of the picture
    there.

    ``view``: that picture's view box.
    """
    sheet = VIEW.match(svg)
    assert sheet
    scale = float(own_head(text)[3]) / float(view.split()[2])
    box = " ".join(number(scale * float(sheet[i]), DECIMALS) for i in range(2, 6))
    return _with_head(text, sheet[1], box)
