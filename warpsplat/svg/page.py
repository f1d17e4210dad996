"""A file as large as a sheet of paper: what plotters and printers take."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from warpsplat.errors import UsageError, cut, shown
from warpsplat.svg.numbers import number
from warpsplat.svg.write import GRIDS, MARK, NAMESPACE

MILLIMETRES = {"mm": 1.0, "cm": 10.0, "in": 25.4, "pt": 25.4 / 72, "px": 25.4 / 96}
"""Of a unit of CSS."""

PAGES = {"a3": (297.0, 420.0), "a4": (210.0, 297.0), "a5": (148.0, 210.0), "letter": (215.9, 279.4)}
"""Width and height of sheets upright [mm]."""

MARGIN = 10.0
"""Of a page on each side, where none is given [mm]."""

LARGEST = 10_000.0
"""Of a side [mm]."""

HEAD = re.compile(
    rf'<svg xmlns="{re.escape(NAMESPACE)}" width="(\d+)" height="(\d+)" viewBox="0 0 ([\d.]+) ([\d.]+)"'
)
"""How a file written here begins: its size in pixels, and that in units of its view box."""

VIEW = re.compile(
    rf'<svg xmlns="{re.escape(NAMESPACE)}" (width="[\d.]+[a-z]+" height="[\d.]+[a-z]+") '
    r'viewBox="(-?[\d.]+) (-?[\d.]+) ([\d.]+) ([\d.]+)"'
)
"""How a file written here begins that lies on a sheet: the sheet's size, and what it covers of the units."""

OUR_VIEW = re.compile(f"{VIEW.pattern}>{MARK}")
"""The same of one that nobody else wrote: others may have margins that belong to the picture."""

NUMBER = r"(\d+(?:\.\d+)?)"
SIZE = re.compile(rf"{NUMBER}\s*[x×]\s*{NUMBER}\s*(mm|cm|in|pt|px)?", re.IGNORECASE)

DECIMALS = 3
"""Of a size [mm]."""


@dataclass(frozen=True)
class Sheet:
    """What a picture is drawn on."""

    width: float
    """[mm]"""
    height: float
    """[mm]"""
    margin: float = 0.0
    """Kept free on each side [mm]."""
    unit: str = "mm"
    """In which the file says its size."""


def parse_size(text: str, unit: str = "mm") -> Sheet:
    """``200x150mm`` or ``8x6in`` -> a sheet that the picture fills as far as its proportions allow.

    Args:
        text: width and height; without a unit, in ``unit``.
        unit: in which the file says its size.

    Raises:
        UsageError: it is no size.
    """
    check_unit(unit)
    found = SIZE.fullmatch(text.strip())
    if not found:
        raise UsageError(f"not a size: {shown(text)}; write 200x150mm")
    factor = MILLIMETRES[(found[3] or unit).lower()]
    return _checked(Sheet(float(found[1]) * factor, float(found[2]) * factor, unit=unit), text)


def parse_page(name: str, width: int, height: int, margin: float = MARGIN, unit: str = "mm") -> Sheet:
    """A sheet of a standard format, on its side for a picture that is wider than high.

    Args:
        name: of the format.
        width: of the picture.
        height: of the picture.
        margin: kept free on each side [mm].
        unit: in which the file says its size.

    Raises:
        UsageError: there is no such format, or no room between the margins.
    """
    check_unit(unit)
    if name.lower() not in PAGES:
        raise UsageError(f"page must be one of {', '.join(PAGES)}, not {shown(name)}")
    short, long = PAGES[name.lower()]
    sides = (long, short) if width > height else (short, long)
    return _checked(Sheet(*sides, margin, unit), f"{name} with margins of {margin:g} mm")


def check_unit(unit: str) -> None:
    """Whether files can say their size in ``unit``.

    Raises:
        UsageError: they cannot.
    """
    if unit not in MILLIMETRES:
        raise UsageError(f"units must be one of {', '.join(MILLIMETRES)}, not {shown(unit)}")


def _checked(sheet: Sheet, name: str) -> Sheet:
    for side in (sheet.width, sheet.height):
        if not 0 < side <= LARGEST or sheet.margin < 0 or side <= 2 * sheet.margin:
            raise UsageError(f"size {cut(name)} leaves no room, or has a side beyond {LARGEST:g} mm")
    return sheet


def check_placing(size: str, page: str, unit: str) -> None:
    """Check that ``placed`` will understand these.

    Raises:
        UsageError: as there.
    """
    if size:
        parse_size(size, unit or "mm")
    elif page:
        parse_page(page, 1, 1, unit=unit or "mm")
    elif unit:
        check_unit(unit)


def placed(text: str, size: str, page: str, unit: str) -> str:
    """A file written here as large as options ask for.

    Args:
        text: the file.
        size: as ``parse_size`` takes it; empty: none.
        page: as ``parse_page`` takes it; empty: none.
        unit: in which the file says its size; empty: pixels, or millimetres of a size or page.

    Raises:
        UsageError: one of them is not understood.
    """
    check_placing(size, page, unit)
    if not (size or page or unit):
        return text
    found = HEAD.match(text)
    assert found
    if size:
        return on_sheet(text, parse_size(size, unit or "mm"))
    if page:
        return on_sheet(text, parse_page(page, int(found[1]), int(found[2]), unit=unit or "mm"))
    return in_units(text, unit)


def in_units(text: str, unit: str, dpi: float = 96.0) -> str:
    """A file written here with its own size in ``unit``, at ``dpi`` pixels an inch.

    Raises:
        UsageError: files cannot say their size in ``unit``.
    """
    check_unit(unit)
    found = HEAD.match(text)
    assert found
    width, height = (float(found[i]) * 25.4 / dpi for i in (1, 2))
    return _with_size(text, Sheet(width, height, unit=unit), (0, 0, float(found[3]), float(found[4])))


def on_sheet(text: str, sheet: Sheet) -> str:
    """A file written here, as large as the sheet allows and in its middle. Paths stay as they are: the view
    box, in whole units, is what the sheet covers.
    """
    found = HEAD.match(text)
    assert found
    width, height = float(found[3]), float(found[4])
    units = max(width / (sheet.width - 2 * sheet.margin), height / (sheet.height - 2 * sheet.margin))
    across, down = math.ceil(sheet.width * units), math.ceil(sheet.height * units)
    left, top = round((width - across) / 2), round((height - down) / 2)
    return _with_size(text, sheet, (left, top, across, down))


def _with_size(text: str, sheet: Sheet, view: tuple[float, float, float, float]) -> str:
    """The file with another size and view box."""
    width, height = (
        number(side / MILLIMETRES[sheet.unit], DECIMALS) + sheet.unit for side in (sheet.width, sheet.height)
    )
    box = " ".join(number(value, DECIMALS) for value in view)
    found = HEAD.match(text)
    assert found
    return f'<svg xmlns="{NAMESPACE}" width="{width}" height="{height}" viewBox="{box}"{text[found.end() :]}'


PROPORTIONS = 0.02
"""By how much the sides of a picture on a sheet may differ from those of an image, over them."""


def picture_view(svg: str, width: int, height: int) -> str | None:
    """The view box of the picture alone, of one that lies in the middle of a sheet; None: of any other, and
    where it has not the proportions of the image.

    ``width``, ``height``: of the image [px]. Margins are in whole units, so that what they leave is up to a
    unit more or less than the picture, whose pixels have a number of units that files know (``GRIDS``).
    """
    found = VIEW.match(svg)
    if not found:
        return None
    left, top, across, down = (float(found[i]) for i in range(2, 6))
    rooms = ((across + 2 * left) / width, (down + 2 * top) / height)
    low = max(room - 1 / side for room, side in zip(rooms, (width, height), strict=True))
    high = min(room + 1 / side for room, side in zip(rooms, (width, height), strict=True))
    middle = (low + high) / 2
    if low > (1 + PROPORTIONS) * high or middle <= 0:
        return None
    known = [grid for grid in GRIDS if low <= grid <= high]
    units = min(known, key=lambda grid: abs(grid - middle)) if known else middle
    return f"0 0 {units * width:.10g} {units * height:.10g}"


def with_view(svg: str, view: str, width: int, height: int) -> str:
    """A file on a sheet with the view box ``view``, as large as the image [px]."""
    head = f'<svg xmlns="{NAMESPACE}" width="{width}" height="{height}" viewBox="{view}"'
    return VIEW.sub(head, svg, count=1)


def on_sheet_of(svg: str, view: str, text: str) -> str:
    """A file written here, ``text``, on the sheet of another one, ``svg``, whose picture has the view box
    ``view``: in the same place, as large.
    """
    sheet, found = VIEW.match(svg), HEAD.match(text)
    assert sheet and found
    scale = float(found[3]) / float(view.split()[2])
    box = " ".join(number(scale * float(sheet[i]), DECIMALS) for i in range(2, 6))
    return f'<svg xmlns="{NAMESPACE}" {sheet[1]} viewBox="{box}"{text[found.end() :]}'
