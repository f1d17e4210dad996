"""DXF files of an SVG's outlines, for laser cutters, plotters, and CAD and CAM programs.

In millimetres and upwards. Each contour is one entity, closed if it is one of a fill or closed in the SVG.
Strokes are their centre lines. Each colour is a layer. Programs differ in what they read, see docs/makers.md.
"""

from __future__ import annotations

import io
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsplat.scene import Floats
from warpsplat.svg.arcs import as_arcs, as_lines, points_at
from warpsplat.svg.outlines import color_of, drawn_on_page
from warpsplat.svg.paths import Subpath

if TYPE_CHECKING:
    from ezdxf.document import Drawing
    from ezdxf.layouts import Modelspace

CURVES = ("arcs", "splines", "lines", "r12")
"""How curves are written: as arcs of polylines, as exact splines, as lines, as lines in the old version."""

TOLERANCE = 1 / 20_000
"""Largest distance of arcs and lines from curves, over the page's longer side."""

ROUND = 2.8e-4
"""Largest distance of the usual four cubics from their circle, over its radius."""

DECIMALS = 6
"""Decimals of coordinates [mm]."""

NOTHING = 1e-6
"""Length of curves that are left out [mm]."""

VERSION, OLD_VERSION = "R2004", "R12"
"""Versions of the format: the first that has colours of 24 bits, and one that all programs read."""


def draw_dxf(text: str, curves: str, *, zoom: float = 1.0) -> bytes:
    """Return an SVG's outlines as a DXF, ``zoom`` times as large; the same text gives the same bytes.

    Shapes without opacity, and a background behind everything, are left out. ``curves``: one of ``CURVES``.

    Raises:
        ImageError: As ``drawn_on_page``.
    """
    import ezdxf

    fixed = ezdxf.options.write_fixed_meta_data_for_testing
    ezdxf.options.write_fixed_meta_data_for_testing = True  # instead of the time and random numbers
    try:
        stream = io.StringIO()
        _document(text, curves, zoom).write(stream)
    finally:
        ezdxf.options.write_fixed_meta_data_for_testing = fixed
    return stream.getvalue().encode()


def _document(text: str, curves: str, zoom: float) -> Drawing:
    from ezdxf import units
    from ezdxf.document import Drawing

    millimetres = 25.4  # millimetres in an inch
    page = drawn_on_page(text, millimetres * zoom, background=False)
    document = Drawing.new(OLD_VERSION if curves == "r12" else VERSION)
    if curves != "r12":  # which has no units
        document.units = units.MM
        document.header["$MEASUREMENT"] = 1  # hatches and line types are metric
    space = document.modelspace()
    corner, opposite = (0, 0, 0), (page.width, page.height, 0)
    space.reset_limits(corner[:2], opposite[:2])
    space.reset_extents(corner, opposite)
    # The package leaves out extents that begin at the origin.
    document.header["$EXTMIN"], document.header["$EXTMAX"] = corner, opposite
    document.set_modelspace_vport(page.height, (page.width / 2, page.height / 2))
    tolerance = TOLERANCE * max(page.width, page.height)
    drawn: set[tuple[str, bytes]] = set()
    for shape in page.shapes:
        color, opacity = color_of(shape)
        if opacity == 0:
            continue
        layer = "".join(f"{round(255 * level):02X}" for level in color)
        if layer not in document.layers:
            rgb = int(layer, 16)
            attributes = {} if curves == "r12" else {"true_color": rgb}
            document.layers.add(layer, color=_nearest_index(rgb), dxfattribs=attributes)
        for subpath in shape.subpaths:
            chain = _chain(subpath, closed := subpath.is_closed or not shape.line)
            known = layer, chain.tobytes()
            if known in drawn or not (shape.line or _has_area(chain)):
                continue  # a stroke along a fill of its colour is the same outline again
            drawn.add(known)
            if len(chain):
                _draw(space, chain, closed, curves, tolerance, {"layer": layer})
            else:  # a dot
                space.add_point(_rounded(subpath.points[:1])[0], dxfattribs={"layer": layer})
    return document


def _chain(subpath: Subpath, closed: bool) -> Floats:
    """Return the cubics of a subpath that are longer than nothing, shape (cubic, 4, 2)."""
    points = subpath.ring() if closed else subpath.points  # a ring may get a line without length
    first = np.arange(0, len(points) - 1, 3)
    chain = points[first[:, None] + np.arange(4)]
    return np.asarray(chain[np.abs(chain - chain[:, :1]).max(axis=(1, 2)) > NOTHING])


def _has_area(chain: Floats) -> bool:
    """Return whether a closed chain is more than a line back and forth."""
    return len(chain) > 2 or bool(len(chain) and (np.abs(np.diff(chain, 2, axis=1)) > NOTHING).any())


Attributes = dict[str, Any]


def _draw(
    space: Modelspace, chain: Floats, closed: bool, curves: str, tolerance: float, attributes: Attributes
) -> None:
    """Draw a contour as one entity."""
    if closed and (circle := _circle(chain, tolerance)):
        space.add_circle(*circle, dxfattribs=attributes)
        return
    straight = as_lines(chain, tolerance)
    if curves == "splines" and len(straight.points) > len(chain) + 1:
        _draw_spline(space, chain, closed, attributes)
        return
    made = as_arcs(chain, tolerance) if curves == "arcs" else straight
    bulge_decimals = 9
    points, bulges = _rounded(made.points), [*np.round(made.bulges, bulge_decimals).tolist(), 0.0]
    if closed:
        points, bulges = points[:-1], bulges[:-1]
    vertices = [(x, y, bulge) for (x, y), bulge in zip(points, bulges, strict=True)]
    add = space.add_polyline2d if curves == "r12" else space.add_lwpolyline
    add(vertices, format="xyb", close=closed, dxfattribs=attributes)


def _draw_spline(space: Modelspace, chain: Floats, closed: bool, attributes: Attributes) -> None:
    """Draw cubics as a spline of degree 3, which is exact: each inner knot counts three times."""
    points = np.concatenate([chain[:1, 0], chain[:, 1:].reshape(-1, 2)])
    if closed:
        points[-1] = points[0]
    knots = np.repeat(np.arange(len(chain) + 1.0), 3)
    spline = space.add_open_spline(
        _rounded(points), 3, knots=[0.0, *knots.tolist(), float(len(chain))], dxfattribs=attributes
    )
    if closed:
        spline.closed = True


def _circle(chain: Floats, tolerance: float) -> tuple[tuple[float, float], float] | None:
    """Return the centre and radius of the circle that a closed chain is, or None."""
    samples = points_at(chain, np.arange(4) / 4)
    centre = samples[:, 0].mean(axis=0)
    away = np.sqrt(((samples - centre) ** 2).sum(axis=2))
    radius = float(away[:, 0].mean())
    if len(chain) < 2 or (np.abs(away - radius) > tolerance / 10 + ROUND * radius).any():
        return None
    (x, y), radius = _rounded(centre[None])[0], round(radius, DECIMALS)
    return (x, y), radius


def _rounded(points: Floats) -> list[tuple[float, float]]:
    """Return points in as many decimals as are written."""
    return [(round(x, DECIMALS) + 0.0, round(y, DECIMALS) + 0.0) for x, y in points.tolist()]


def _nearest_index(rgb: int) -> int:
    """Return the index of the colour next to ``rgb``, 0xRRGGBB, in AutoCAD's palette."""
    from ezdxf.colors import DXF_DEFAULT_COLORS

    foreground = 7  # the index of the colour that programs show in black on white
    if rgb == 0:
        return foreground

    def distance(index: int) -> int:
        return sum(((DXF_DEFAULT_COLORS[index] >> i & 255) - (rgb >> i & 255)) ** 2 for i in (0, 8, 16))

    return min((index for index in range(1, 256) if index != foreground), key=distance)
