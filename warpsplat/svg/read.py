"""Any SVG of filled or of stroked paths -> scene.

A quadratic with only smooth ones behind it is a spline, in a fill where it closes smoothly; any other path
becomes cubics. A path with holes becomes one outline: its subpaths are joined by bridges that run there and
back, so that the area is the same.
"""

from __future__ import annotations

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.scene import Basis, Canvas, Kind, Scene
from warpsplat.scene.scene import starts_of
from warpsplat.svg.paths import Points, Subpath, line
from warpsplat.svg.shapes import Shape, read_shapes


def _bridge(start: Points, end: Points) -> Points:
    return np.array([(p.real, p.imag) for p in line(complex(*start), complex(*end))])


def _ring(subpaths: list[Subpath]) -> Points:
    """One closed ring of cubics around all subpaths, without the repeated end."""
    start = subpaths[0].points[0]
    ring = [start[None]]
    for number, (points, *_) in enumerate(subpaths):
        if number:
            ring.append(_bridge(start, points[0]))
        ring.append(points[1:])
        if not np.allclose(points[-1], points[0], rtol=0, atol=1e-6):
            ring.append(_bridge(points[-1], points[0]))
        if number:
            ring.append(_bridge(points[0], start))
    return np.concatenate(ring)[:-1]


def _outlines(shape: Shape) -> list[tuple[Basis, Points]]:
    """Points of a shape as a scene has them: one ring of a fill, a chain for each subpath of a stroke."""
    if shape.filled:
        spline = shape.subpaths[0].spline_ring() if len(shape.subpaths) == 1 else None
        return [(Basis.CUBIC, _ring(shape.subpaths)) if spline is None else (Basis.SPLINE, spline)]
    chains = [(subpath.points, subpath.spline_chain()) for subpath in shape.subpaths]
    return [(Basis.CUBIC, points) if spline is None else (Basis.SPLINE, spline) for points, spline in chains]


def _is_background(shape: Shape, width: int, height: int) -> bool:
    """Whether an opaque upright rectangle covers the canvas."""
    if not (shape.is_rect and shape.filled and shape.opacity == 1):
        return False
    corners = shape.subpaths[0].points[::3]
    upright = (np.isclose(np.diff(corners, axis=0), 0, atol=1e-6).sum(axis=1) >= 1).all()
    low, high = corners.min(axis=0), corners.max(axis=0)
    return bool(upright and (low <= 0.5).all() and (high >= np.array([width, height]) - 0.5).all())


def load_scene(text: str, width: int, height: int, name: str) -> tuple[Scene, bool]:
    """Read an SVG's paths (and basic shapes) as a scene of ``width`` x ``height`` canvas units.

    Returns:
        the scene, and whether the SVG itself has a background; where it has none, the scene's is white.

    Raises:
        ImageError: not an SVG, nothing drawn, something that the scene cannot hold (the message says
            what).
    """
    try:
        return _load_scene(text, width, height)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error


def _load_scene(text: str, width: int, height: int) -> tuple[Scene, bool]:
    shapes = read_shapes(text, width, height)
    background = np.ones(3)
    has_background = bool(shapes) and _is_background(shapes[0], width, height)
    if has_background:
        background = np.array(shapes.pop(0).color)
    if not shapes:
        raise ImageError("draws no filled or stroked path")
    filled = shapes[0].filled
    if any(shape.filled != filled for shape in shapes):
        raise ImageError("has both fills and strokes; only one of them can be refined at a time")
    rows = [(basis, points, shape) for shape in shapes for basis, points in _outlines(shape)]
    scene = Scene.of(
        Canvas(width, height, background.astype(np.float32)),
        np.full(len(rows), Kind.FILL if filled else Kind.STROKE, np.int32),
        starts_of(np.array([len(points) for _, points, _ in rows])),
        basis=np.array([basis for basis, _, _ in rows], np.int32),
        points=np.concatenate([points for _, points, _ in rows]).astype(np.float32),
        colors=np.array([shape.color for *_, shape in rows], np.float32),
        opacities=np.array([shape.opacity for *_, shape in rows], np.float32),
        widths=np.array([shape.width for *_, shape in rows], np.float32),
    )
    return scene, has_background
