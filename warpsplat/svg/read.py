"""Any SVG of paths -> scene.

A quadratic followed by smooth ones only is a spline, closed where it closes smoothly; any other path becomes
cubics. A path that is filled and stroked becomes two shapes that share their points.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import chain, pairwise
from typing import NamedTuple

import numpy as np

from warpsplat.errors import ImageError
from warpsplat.scene import (
    NO_DASHES,
    NO_PICTURE,
    Basis,
    Canvas,
    Cap,
    Join,
    Kind,
    Paint,
    Picture,
    Scene,
    Spread,
)
from warpsplat.scene.scene import IntArray, starts_of
from warpsplat.svg.gradients import FlatColor, Gradient
from warpsplat.svg.paths import Points, Subpath, line
from warpsplat.svg.shapes import Shape, opacity_of
from warpsplat.svg.structure import read_shapes


class _Outline(NamedTuple):
    """The points of a shape in a scene's form."""

    basis: Basis
    contours: list[Points]
    closed: list[bool]


def _ring(subpath: Subpath) -> Points:
    """Return a closed ring of cubics, without the repeated end."""
    points = subpath.points
    if not np.allclose(points[-1], points[0], rtol=0, atol=1e-6):
        closing = line(complex(*points[-1]), complex(*points[0]))
        points = np.concatenate([points, [(p.real, p.imag) for p in closing]])
    return points[:-1]


def _outline(shape: Shape, is_stroked: bool) -> _Outline:
    """Return the points of a shape. Contours that are only filled are closed, as filling closes them."""
    closed = [subpath.is_closed or not is_stroked for subpath in shape.subpaths]
    pairs = list(zip(shape.subpaths, closed, strict=True))
    splines = [subpath.spline_ring() if ring else subpath.spline_chain() for subpath, ring in pairs]
    contours = [spline for spline in splines if spline is not None]
    if len(contours) == len(splines):
        return _Outline(Basis.SPLINE, contours, closed)
    return _Outline(
        Basis.CUBIC, [_ring(subpath) if ring else subpath.points for subpath, ring in pairs], closed
    )


def _outlines(shapes: list[Shape]) -> list[_Outline]:
    """Return the points of all shapes, the same for twins."""
    twins = [shape.is_twin for shape in shapes] + [False]
    stroked = [s.line is not None or a or b for s, a, b in zip(shapes, twins[:-1], twins[1:], strict=True)]
    return [_outline(shape, is_stroked) for shape, is_stroked in zip(shapes, stroked, strict=True)]


def _is_background(shape: Shape, width: int, height: int) -> bool:
    """Return whether a shape is an opaque upright rectangle that covers the canvas."""
    if not (shape.is_rect and isinstance(shape.paint, FlatColor) and opacity_of(shape) == 1):
        return False
    corners = shape.subpaths[0].points[::3]
    upright = (np.isclose(np.diff(corners, axis=0), 0, atol=1e-6).sum(axis=1) >= 1).all()
    low, high = corners.min(axis=0), corners.max(axis=0)
    return bool(upright and (low <= 0.5).all() and (high >= np.array([width, height]) - 0.5).all())


def load_scene(
    text: str, width: int, height: int, name: str, *, background_apart: bool = True
) -> tuple[Scene, bool]:
    """Read an SVG's shapes as a scene of ``width`` x ``height`` canvas units.

    Args:
        text: The SVG.
        width: Width of the canvas.
        height: Height of the canvas.
        name: What messages call the SVG.
        background_apart: Whether a background becomes the canvas's, rather than a shape.

    Returns:
        The scene, and whether the SVG has a background; if not, the scene's is white.

    Raises:
        ImageError: Not an SVG, nothing drawn, or something that the scene cannot hold.
    """
    try:
        shapes = read_shapes(text, width, height)
        if not shapes:
            raise ImageError("draws no filled or stroked path")
        return scene_of(shapes, width, height, background_apart)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error


def scene_of(
    shapes: list[Shape], width: int, height: int, background_apart: bool = True
) -> tuple[Scene, bool]:
    """Return shapes as a scene, and whether the first of them is its background; as ``load_scene``."""
    background = np.ones(3)
    has_background = (
        background_apart
        and len(shapes) > 1
        and _is_background(shapes[0], width, height)
        and not shapes[1].is_twin
    )
    if has_background:
        background = np.array(shapes[0].paint.color)  # type: ignore[union-attr]  # _is_background has checked
        shapes = shapes[1:]
    outlines = _outlines(shapes)
    contours = [points for outline in outlines for points in outline.contours]
    counts = np.array([sum(map(len, outline.contours)) for outline in outlines], np.int32)
    styles = {dashes: i for i, dashes in enumerate(sorted({s.line.dashes for s in shapes if s.line} - {()}))}
    lines = [shape.line for shape in shapes]
    scene = Scene(
        Canvas(width, height, background.astype(np.float32)),
        np.array([Kind.FILL if one is None else Kind.STROKE for one in lines], np.int32),
        starts_of(counts),
        basis=np.array([outline.basis for outline in outlines], np.int32),
        starts=starts_of(np.array([len(points) for points in contours], np.int32)),
        closed=np.array([c for outline in outlines for c in outline.closed], np.int32),
        points=np.concatenate([*contours, np.empty((0, 2))]).astype(np.float32),
        opacities=np.array([opacity_of(shape) for shape in shapes], np.float32),
        rule=np.array([shape.rule for shape in shapes], np.int32),
        twin=np.array([shape.is_twin for shape in shapes], np.int32),
        widths=np.array([one.width if one else 0.0 for one in lines], np.float32),
        cap=np.array([one.cap if one else Cap.ROUND for one in lines], np.int32),
        join=np.array([one.join if one else Join.ROUND for one in lines], np.int32),
        miter_limits=np.array([one.miter_limit if one else 4.0 for one in lines], np.float32),
        dash=np.array([styles[s.dashes] if s and s.dashes else NO_DASHES for s in lines], np.int32),
        dashes=tuple(styles),
        layer=_layers([shape.level for shape in shapes]),
        colors=np.array(
            [s.paint.color if isinstance(s.paint, FlatColor) else (0.0, 0.0, 0.0) for s in shapes], np.float32
        ).reshape(-1, 3),
    )
    return _with_pictures(_with_gradients(scene, shapes), shapes), has_background


def _layers(names: list[str]) -> IntArray:
    """Return the number of each shape's level if all are in one, in order; else 0."""
    changes = [a != b for a, b in pairwise(names)]
    if not all(names) or sum(changes) + 1 != len(set(names)):
        return np.zeros(len(names), np.int32)
    return np.concatenate([[0], np.cumsum(changes)]).astype(np.int32)


MAX_STOPS = 1_000_000
"""Most stops of all shapes together; each shape has its own copy of a shared gradient."""


def _with_gradients(scene: Scene, shapes: list[Shape]) -> Scene:
    """Return the scene with the gradients of its shapes."""
    ramps = [shape.paint if isinstance(shape.paint, Gradient) else None for shape in shapes]
    if not any(ramps):
        return scene
    if sum(len(ramp.stops) for ramp in ramps if ramp) > MAX_STOPS:
        raise ImageError(f"its gradients add up to more than {MAX_STOPS} stops")
    stops = list(chain.from_iterable(ramp.stops for ramp in ramps if ramp))
    kinds = [Paint.FLAT if r is None else Paint.RADIAL if r.is_radial else Paint.LINEAR for r in ramps]
    return replace(
        scene,
        paint=np.array(kinds, np.int32),
        spread=np.array([Spread[r.spread.upper()] if r else Spread.PAD for r in ramps], np.int32),
        frames=np.array([r.frame[:2, (2, 0, 1)].T.ravel() if r else np.zeros(6) for r in ramps], np.float32),
        focus=np.array([r.focus if r else (0.0, 0.0, 0.0) for r in ramps], np.float32),
        stop_first=starts_of(np.array([len(r.stops) if r else 0 for r in ramps], np.int32)),
        stop_offsets=np.array([offset for r in ramps if r for offset in r.offsets], np.float32),
        stop_colors=np.array([stop.color for stop in stops], np.float32),
        stop_opacities=np.array([stop.opacity for stop in stops], np.float32),
    )


def _with_pictures(scene: Scene, shapes: list[Shape]) -> Scene:
    """Return the scene with the pictures among its shapes."""
    pictures = [shape.paint for shape in shapes if isinstance(shape.paint, Picture)]
    if not pictures:
        return scene
    has_one = np.array([isinstance(shape.paint, Picture) for shape in shapes])
    return replace(
        scene,
        paint=np.where(has_one, Paint.PICTURE, scene.paint).astype(np.int32),
        picture=np.where(has_one, np.cumsum(has_one) - 1, NO_PICTURE).astype(np.int32),
        pictures=tuple(pictures),
    )
