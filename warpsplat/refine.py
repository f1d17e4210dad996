"""Any SVG of filled or of stroked paths -> scene, to be improved against an image.

A path with holes becomes one outline: its subpaths are joined by bridges that run there and back, so that the
area is the same. Paths of different length are padded to one length by cubics without extent.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import warp as wp

from warpsplat.config import Density, Settings
from warpsplat.errors import ImageError
from warpsplat.metrics import psnr, score_svg
from warpsplat.pipeline import Result, vectorize
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg import write_svg
from warpsplat.svg_path import Points, line
from warpsplat.svg_shapes import Shape, read_shapes
from warpsplat.viewer import on_white, render_own, render_svg

MAX_PADDED = 8_000_000
"""Most control points of all paths, each counted as long as the longest: 150 bytes each, 1.4 GB in a run."""


def _bridge(start: Points, end: Points) -> Points:
    return np.array([(p.real, p.imag) for p in line(complex(*start), complex(*end))])


def _ring(subpaths: list[Points]) -> Points:
    """One closed ring of cubics around all subpaths, without the repeated end."""
    start = subpaths[0][0]
    ring = [start[None]]
    for number, subpath in enumerate(subpaths):
        if number:
            ring.append(_bridge(start, subpath[0]))
        ring.append(subpath[1:])
        if not np.allclose(subpath[-1], subpath[0], rtol=0, atol=1e-6):
            ring.append(_bridge(subpath[-1], subpath[0]))
        if number:
            ring.append(_bridge(subpath[0], start))
    return np.concatenate(ring)[:-1]


def _pad(points: np.ndarray, count: int) -> np.ndarray:
    """Repeat the last on-curve point (of a ring: the first) until there are ``count`` points."""
    last = points[0] if len(points) % 3 == 0 else points[-1]
    return np.concatenate([points, np.repeat(last[None], count - len(points), axis=0)])


def _without_padding(scene: Scene, start: Scene) -> Scene:
    """``scene`` with the cubics that padded ``start`` drawn together to a point: the file leaves them out."""
    points = scene.points.copy()
    for i, before in enumerate(start.points):
        moved = np.flatnonzero((before != before[-1]).any(axis=1))
        first = int(moved[-1]) + 1 if len(moved) else 0
        points[i, first + 1 :] = points[i, first]
    return replace(scene, points=points)


def _is_background(shape: Shape, width: int, height: int) -> bool:
    """Whether an opaque upright rectangle covers the canvas."""
    if not (shape.is_rect and shape.filled and shape.opacity == 1):
        return False
    corners = shape.subpaths[0][::3]
    upright = (np.isclose(np.diff(corners, axis=0), 0, atol=1e-6).sum(axis=1) >= 1).all()
    low, high = corners.min(axis=0), corners.max(axis=0)
    return bool(upright and (low <= 0.5).all() and (high >= np.array([width, height]) - 0.5).all())


def load_scene(text: str, width: int, height: int, name: str) -> tuple[Scene, bool]:
    """Read an SVG's paths (and basic shapes) as a scene of ``width`` x ``height`` canvas units.

    Returns:
        the scene, and whether the SVG itself has a background; where it has none, the scene's is white.

    Raises:
        ImageError: not an SVG, nothing drawn, something that the scene cannot hold (the message says
            what), or more than ``MAX_PADDED`` points.
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
    rows: list[tuple[Points, Shape]] = []
    for shape in shapes:
        rows += [(p, shape) for p in ([_ring(shape.subpaths)] if filled else shape.subpaths)]
    longest = max(len(points) for points, _ in rows)
    count = 6 * math.ceil(longest / 6) if filled else longest
    if count * len(rows) > MAX_PADDED:
        raise ImageError(
            f"{len(rows)} paths take the memory of the longest each, {longest} points; "
            f"more than {MAX_PADDED // 1_000_000} million do not fit: split or simplify the longest"
        )
    return Scene(
        kind="closed" if filled else "open",
        width=width,
        height=height,
        points=np.stack([_pad(points, count).astype(np.float32) for points, _ in rows]),
        colors=np.array([shape.color for _, shape in rows], np.float32),
        opacities=np.array([[shape.opacity] for _, shape in rows], np.float32),
        widths=np.array([shape.width for _, shape in rows], np.float32),
        background=background.astype(np.float32),
    ), has_background


def refine(
    text: str, target: FloatArray, settings: Settings, device: wp.Device, *, name: str, **options: Any
) -> tuple[Result, float]:
    """Improve the SVG ``text`` against ``target``; its shapes stay, none is added or removed.

    ``options`` are those of ``vectorize``.

    Returns:
        the result, and the PSNR of ``text`` itself [dB]. A result that is no better is ``text`` unchanged.
    """
    height, width = target.shape[:2]
    scene, has_background = load_scene(text, width, height, name)
    try:
        _check_read(text, scene, has_background)
        before = score_svg(text, target)
    except ImageError as error:
        raise ImageError(f"{name}: {error}") from error
    settings = replace(
        settings,
        kind=scene.kind,
        curves=min(len(scene), 100_000),
        coarse=0.0,
        density=Density(interval=0),
        rates=replace(settings.rates, points=REFINE_RATE),
        renderer="exact",
    )
    result = vectorize(target, settings, device, scene=scene, **options)
    trimmed = _without_padding(result.scene, scene)
    svg = write_svg(trimmed, precision=settings.precision, background=has_background)
    score = score_svg(svg, target, own=True)
    result = replace(result, svg=svg, scene=trimmed, score=score)
    if score.psnr <= before.psnr:
        result = replace(result, svg=text, scene=scene, score=before)
    return result, before.psnr


def _check_read(text: str, scene: Scene, has_background: bool) -> None:
    """Compare pictures of the SVG and of what was read of it: nothing may be lost that no rule thought of.

    Raises:
        ImageError: they differ.
    """
    given = render_svg(text, width=scene.width, height=scene.height)
    read = render_own(write_svg(scene, precision=3, background=has_background))
    if given.size != read.size:
        raise ImageError(f"renders as {given.width}x{given.height}, the image is {read.width}x{read.height}")
    alike = psnr(on_white(given), on_white(read))
    if alike < MIN_ALIKE:
        raise ImageError(f"shows something that is not supported ({alike:.1f} dB from what could be read)")


MIN_ALIKE = 25.0
"""Least PSNR [dB] of the scene read against the SVG; what is read in full has over 40."""

REFINE_RATE = 0.5
"""Learning rate of points [px]: the shapes are nearly where they should be."""
