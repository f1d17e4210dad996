"""First shapes: small circles or strokes on a jittered grid, with the colours of the image."""

from __future__ import annotations

from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.alpha import CLEAR, on, straight
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.portable import elementary, filters
from warpsplat.scene import OPACITY_RANGE, Basis, Canvas, FloatArray, Kind, Scene

COVER = 1.3
"""Area of the first shapes over the area of the canvas: circles on a grid that leave few gaps."""

STROKE_CUBICS = 3
"""Cubics in a new stroke (paper section 3.2, as in DiffVG)."""

MIXED_POINTS = 6
"""Points of a new stroke among fills: a bar needs few, and more of them shake."""

STROKE_ASPECT = 3.0
"""Length over width of a new stroke."""

SURVEY_PIXELS = 400_000
"""Largest image that colours and directions of the first shapes are taken from [pixels]."""

SURVEY_SIGMA = 128.0
"""Widest blur of that image [px]: its cost grows with the width."""

LEVELS = 32
"""Of a channel, to tell a drawing's colours."""

FLAT_SHARE = 0.98
"""Share of a drawing's pixels that its few colours hold; the rest are the soft pixels of outlines."""

FLAT_COLORS = 12
"""Most colours of a drawing whose shapes are counted."""

LEAST_REGION = 1e-4
"""Least area of a region that counts, over the area of the image."""

SHAPES_A_REGION = 8
"""Curves for a region of one colour: an outline has corners and holes."""

LEAST_CURVES = 32
"""For the simplest of drawings."""

PIXELS_A_CURVE = 8
"""Least pixels of an image for each shape: a shape has about as many numbers as these have."""

LEAST_SHARE = 0.02
"""Of a picture that is not empty, as far as the places of first shapes are made denser for it."""

SOME = 0.05
"""Least opacity of a picture around the place of a first shape."""

Floats = npt.NDArray[np.floating]


def survey(target: FloatArray, sigma: float = 0.0) -> tuple[FloatArray, float]:
    """``target`` so small that a blur by ``sigma`` [px of ``target``] takes no time.

    Returns:
        the image, ``target`` itself if it is small enough, and how many of ``target``'s pixels a pixel spans.
    """
    height, width = target.shape[:2]
    span = max(np.sqrt(width * height / SURVEY_PIXELS), sigma / SURVEY_SIGMA)
    if span <= 1:
        return target, 1.0
    size = (max(1, round(width / span)), max(1, round(height / span)))
    return filters.resize_area(target, size), float(span)


def simple_curves(target: FloatArray) -> int:
    """The most shapes that make sense: few for a drawing in a few flat colours, or for a tiny image.

    A drawing gets ``SHAPES_A_REGION`` shapes for each region of one colour, any image at the most one for
    ``PIXELS_A_CURVE`` of its pixels.
    """
    height, width = target.shape[:2]
    room = max(1, width * height // PIXELS_A_CURVE)
    steps = np.round(on(survey(target)[0], 0.5) * (LEVELS - 1)).astype(np.int32)
    codes = (steps * [LEVELS * LEVELS, LEVELS, 1]).sum(axis=2)
    counts = np.bincount(codes.ravel())
    colors = np.argsort(-counts, kind="stable")[:FLAT_COLORS]
    if counts[colors].sum() < FLAT_SHARE * codes.size:
        return room
    regions = 0
    for color in colors[counts[colors] > 0]:
        _, _, stats, _ = cv2.connectedComponentsWithStats((codes == color).astype(np.uint8), connectivity=4)
        regions += int((stats[1:, cv2.CC_STAT_AREA] >= LEAST_REGION * codes.size).sum())
    return min(room, max(LEAST_CURVES, SHAPES_A_REGION * regions))


def background_color(target: FloatArray) -> FloatArray:
    """The border's colour where most of the border is alike (a drawing on paper), else the mean."""
    border = np.concatenate([target[0], target[-1], target[:, 0], target[:, -1]])
    median = np.median(border, axis=0)
    alike = np.abs(border - median).max(axis=1) < 8 / 255
    color = median if alike.mean() > 0.5 else survey(target)[0].mean(axis=(0, 1))
    # As the file will have it.
    return np.asarray(np.round(color * 255) / 255, np.float32)


def circle_outlines(centres: Floats, radii: Floats, chain_cubics: int) -> FloatArray:
    """Circles as rings of ``2 * chain_cubics`` cubics, shape (shape, 6 * chain_cubics, 2)."""
    count = 2 * chain_cubics
    handle = 4 / 3 * elementary.tan(np.pi / (2 * count))
    angle = 2 * np.pi * np.arange(count) / count
    on = np.stack([elementary.cos(angle), elementary.sin(angle)], axis=1)
    turn = np.stack([-on[:, 1], on[:, 0]], axis=1)
    following, following_turn = np.roll(on, -1, axis=0), np.roll(turn, -1, axis=0)
    ring = np.stack([on, on + handle * turn, following - handle * following_turn], axis=1).reshape(-1, 2)
    return np.asarray(centres[:, None] + radii[:, None, None] * ring[None], np.float32)


def circle_splines(centres: Floats, radii: Floats, count: int) -> FloatArray:
    """Circles as splines of ``count`` points, shape (shape, count, 2)."""
    angle = 2 * np.pi * np.arange(count) / count
    on = np.stack([elementary.cos(angle), elementary.sin(angle)], axis=1)
    # Where quadratics meet and in the middle of each, the outline lies this much nearer than the points.
    nearer = (elementary.cos(np.pi / count) + (3 + elementary.cos(2 * np.pi / count)) / 4) / 2
    reach = 1 / nearer
    return np.asarray(centres[:, None] + radii[:, None, None] * reach * on, np.float32)


def stroke_outlines(centres: Floats, lengths: Floats, angles: Floats, count: int) -> FloatArray:
    """Straight strokes of ``count`` points, shape (shape, count, 2)."""
    t = np.linspace(-0.5, 0.5, count)
    direction = np.stack([elementary.cos(angles), elementary.sin(angles)], axis=1)
    along = lengths[:, None] * t[None, :]
    return np.asarray(centres[:, None] + along[..., None] * direction[:, None], np.float32)


def place(
    settings: Settings,
    canvas: Canvas,
    centres: Floats,
    areas: Floats,
    angles: Floats,
    colors: npt.NDArray[Any],
) -> Scene:
    """New shapes of the settings' kind: ``areas`` in px squared, ``angles`` (strokes) in rad."""
    if settings.kind == Kind.STROKE:
        widths = np.maximum(np.sqrt(areas / STROKE_ASPECT), 1.0)
        return place_strokes(settings, canvas, centres, areas / widths, widths, angles, colors)
    if settings.basis == Basis.CUBIC:
        points = circle_outlines(centres, np.sqrt(areas / np.pi), settings.chain_cubics)
    else:
        points = circle_splines(centres, np.sqrt(areas / np.pi), settings.spline_points)
    return _new(settings, Kind.FILL, canvas, points, np.zeros(len(centres)), colors)


def place_strokes(
    settings: Settings,
    canvas: Canvas,
    centres: Floats,
    lengths: Floats,
    widths: Floats,
    angles: Floats,
    colors: npt.NDArray[Any],
) -> Scene:
    """New straight strokes: ``lengths`` and ``widths`` in px, ``angles`` in rad."""
    count = MIXED_POINTS if settings.mixed else settings.spline_points
    if settings.basis == Basis.CUBIC:
        count = 3 * STROKE_CUBICS + 1
    points = stroke_outlines(centres, np.maximum(lengths, 2.0), angles, count)
    return _new(settings, Kind.STROKE, canvas, points, widths, colors)


def _new(
    settings: Settings,
    kind: Kind,
    canvas: Canvas,
    points: FloatArray,
    widths: Floats,
    colors: npt.NDArray[Any],
) -> Scene:
    """New shapes, opaque or nearly so."""
    return Scene.uniform(
        kind,
        canvas,
        points,
        settings.basis,
        colors=np.asarray(colors, np.float32).reshape(len(points), 3),
        opacities=np.full(len(points), OPACITY_RANGE[1] if settings.opaque else settings.opacity, np.float32),
        widths=np.asarray(widths, np.float32),
    )


def canvas_for(settings: Settings, target: FloatArray) -> Canvas:
    """A canvas of ``target``'s size: transparent if it has opacity, else with the settings' background or a
    colour of its own.
    """
    background = None
    if target.shape[2] == 3:
        color = solid_color(settings.background)
        background = background_color(target) if color is None else color
    return Canvas(target.shape[1], target.shape[0], background)


def contour_angles(target: FloatArray, centres: Floats, sigma: float) -> FloatArray:
    """Direction along the contours at ``centres`` [rad]: the structure tensor's lesser eigenvector."""
    grey = target.mean(axis=2)
    gx, gy = filters.sobel(grey)
    xx, yy, xy = (filters.gaussian_blur(g, max(sigma, 0.5)) for g in (gx * gx, gy * gy, gx * gy))
    column, row = pixel_of(centres, target)
    gradient = 0.5 * elementary.arctan2(2 * xy[row, column], (xx - yy)[row, column])
    return np.asarray(gradient + np.pi / 2, np.float32)


def shape_angles(settings: Settings, target: FloatArray, centres: Floats, sigma: float) -> FloatArray:
    """``contour_angles`` for strokes; 0 for filled shapes, which start as circles."""
    if settings.kind == Kind.FILL:
        return np.zeros(len(centres), np.float32)
    return contour_angles(target, centres, sigma)


def pixel_of(centres: Floats, target: FloatArray) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Column and row of the pixels that hold ``centres``, clamped to the image."""
    column = np.clip(centres[:, 0].astype(np.intp), 0, target.shape[1] - 1)
    row = np.clip(centres[:, 1].astype(np.intp), 0, target.shape[0] - 1)
    return column, row


def grid_scene(settings: Settings, target: FloatArray, count: int, rng: np.random.Generator) -> Scene:
    """``count`` shapes that cover the canvas."""
    canvas = canvas_for(settings, target)
    height, width = target.shape[:2]
    wanted = count
    if target.shape[2] == 4:  # where nothing is, nothing is placed: more places then, so that enough are left
        count = round(count / max(float((target[..., 3] > CLEAR).mean()), LEAST_SHARE))
    rows = max(1, min(count, round(np.sqrt(count * height / width))))
    per_row = np.full(rows, count // rows)
    per_row[: count % rows] += 1
    x = np.concatenate([(np.arange(n) + 0.5) / n for n in per_row]) * width
    y = np.repeat((np.arange(rows) + 0.5) / rows, per_row) * height
    cell = np.sqrt(width * height / count)
    centres = np.stack([x, y], axis=1) + rng.uniform(-0.25, 0.25, (count, 2)) * cell
    centres = np.clip(centres, 0, [width, height])
    small, span = survey(target, cell / 2)
    blurred = filters.gaussian_blur(small, max(cell / span / 4, 0.5))
    column, row = pixel_of(centres / span, small)
    areas = np.full(count, COVER * cell * cell)
    angles = shape_angles(settings, small, centres / span, cell / span / 2)
    tones = blurred[row, column]
    scene = place(
        settings, canvas, centres, areas, angles, np.asarray(straight(np.asarray(tones, np.float32)))
    )
    order = rng.permutation(count)
    if target.shape[2] == 4:
        order = order[np.argsort(tones[order, 3] <= SOME, kind="stable")][:wanted]
        rng.shuffle(order)
    return scene.take(order)
