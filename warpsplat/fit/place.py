"""Placement: new shapes are circles or strokes with the colours of the image, a start near the optimum."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from warpsplat.alpha import CLEAR, on, straight
from warpsplat.fit.settings import Settings, solid_color
from warpsplat.forms import form_of
from warpsplat.portable import elementary, filters
from warpsplat.scene import OPACITY_RANGE, Basis, Canvas, FloatArray, Kind, Scene

STROKE_CUBICS, STROKE_ASPECT = 3, 3.0
"""Cubics in a new stroke (paper section 3.2, as in DiffVG), and its length over its width."""

REDUCED_PIXELS, REDUCED_SIGMA = 400_000, 128.0
"""Maximum size of the image that the first shapes take colours and directions from [pixels], and maximum
standard deviation of its blur [px], whose cost grows with it."""

COLOR_LEVELS, MAX_FLAT_COLORS, FLAT_SHARE = 32, 12, 0.98
"""Levels of a channel by which flat colours are distinguished, most colours of a flat image, and minimum
share of its pixels that have one of these; the others antialias outlines."""

SHAPES_PER_REGION, MIN_SIMPLE_CURVES = 8, 32
"""Shapes for a region of one colour, whose outline has corners and holes, and for the simplest flat image."""

PIXELS_PER_CURVE = 8
"""Minimum number of pixels per shape: a shape has about as many parameters as these have values."""

MIN_OCCUPIED_SHARE, MIN_PLACE_OPACITY = 0.02, 0.05
"""Minimum share of a transparent image that is taken as occupied, which bounds the number of places tried,
and minimum opacity around a first shape."""

Floats = npt.NDArray[np.floating]


def grid_scene(settings: Settings, target: FloatArray, count: int, rng: np.random.Generator) -> Scene:
    """Return ``count`` shapes on a jittered grid that covers the canvas, or its occupied part."""
    height, width = target.shape[:2]
    wanted = count
    if target.shape[2] == 4:  # enough places that ``wanted`` remain without the empty ones
        count = round(count / max(float((target[..., 3] > CLEAR).mean()), MIN_OCCUPIED_SHARE))
    rows = max(1, min(count, round(np.sqrt(count * height / width))))
    per_row = np.full(rows, count // rows)
    per_row[: count % rows] += 1
    x = np.concatenate([(np.arange(n) + 0.5) / n for n in per_row]) * width
    y = np.repeat((np.arange(rows) + 0.5) / rows, per_row) * height
    cell = np.sqrt(width * height / count)
    grid_jitter = 0.25  # maximum offset of a first shape along each axis, in cells of the grid
    centres = np.stack([x, y], axis=1) + rng.uniform(-grid_jitter, grid_jitter, (count, 2)) * cell
    centres = np.clip(centres, 0, [width, height])
    small, span = reduced(target, cell / 2)
    blurred = filters.gaussian_blur(small, max(cell / span / 4, 0.5))
    column, row = pixel_of(centres / span, small)
    # Area of the first shapes over that of the canvas: circles on a grid then leave few gaps.
    grid_cover = 1.3
    areas = np.full(count, grid_cover * cell * cell)
    angles = shape_angles(settings, small, centres / span, cell / span / 2)
    colors = blurred[row, column]
    factory = ShapeFactory(settings, canvas_for(settings, target))
    scene = factory.place(centres, areas, angles, straight(np.asarray(colors, np.float32)))
    order = rng.permutation(count)
    if target.shape[2] == 4:
        order = order[np.argsort(colors[order, 3] <= MIN_PLACE_OPACITY, kind="stable")][:wanted]
        rng.shuffle(order)
    return scene.take(order)


def reduced(target: FloatArray, sigma: float = 0.0) -> tuple[FloatArray, float]:
    """Return ``target`` so small that a blur by ``sigma`` [px of ``target``] takes no time.

    Return also how many pixels of ``target`` a pixel spans; 1 if it is ``target`` itself.
    """
    height, width = target.shape[:2]
    span = max(np.sqrt(width * height / REDUCED_PIXELS), sigma / REDUCED_SIGMA)
    if span <= 1:
        return target, 1.0
    size = (max(1, round(width / span)), max(1, round(height / span)))
    return filters.resize_area(target, size), float(span)


def simple_curves(target: FloatArray) -> int:
    """Return the largest useful number of shapes: small for images of few flat colours and for tiny ones.

    A flat image gets ``SHAPES_PER_REGION`` for each region of one colour, any image at most one for each
    ``PIXELS_PER_CURVE`` pixels.
    """
    height, width = target.shape[:2]
    most = max(1, width * height // PIXELS_PER_CURVE)
    levels = np.round(on(reduced(target)[0], 0.5) * (COLOR_LEVELS - 1)).astype(np.int32)
    codes = (levels * [COLOR_LEVELS * COLOR_LEVELS, COLOR_LEVELS, 1]).sum(axis=2)
    counts = np.bincount(codes.ravel())
    colors = np.argsort(-counts, kind="stable")[:MAX_FLAT_COLORS]
    if counts[colors].sum() < FLAT_SHARE * codes.size:
        return most
    regions = 0
    min_region_share = 1e-4  # minimum area of a region that counts, over the area of the image
    for color in colors[counts[colors] > 0]:
        _, _, stats, _ = cv2.connectedComponentsWithStats((codes == color).astype(np.uint8), connectivity=4)
        regions += int((stats[1:, cv2.CC_STAT_AREA] >= min_region_share * codes.size).sum())
    return min(most, max(MIN_SIMPLE_CURVES, SHAPES_PER_REGION * regions))


def canvas_for(settings: Settings, target: FloatArray) -> Canvas:
    """Return a canvas of ``target``'s size: transparent if it has opacity, else with the settings' background
    or that of the image.
    """
    background = None
    if target.shape[2] == 3:
        color = solid_color(settings.background)
        background = background_color(target) if color is None else color
    return Canvas(target.shape[1], target.shape[0], background)


def background_color(target: FloatArray) -> FloatArray:
    """Return the colour of the border if most of it has one (a drawing on paper), else the mean colour."""
    border = np.concatenate([target[0], target[-1], target[:, 0], target[:, -1]])
    median = np.median(border, axis=0)
    uniform = np.abs(border - median).max(axis=1) < 8 / 255
    color = median if uniform.mean() > 0.5 else reduced(target)[0].mean(axis=(0, 1))
    return np.asarray(np.round(color * 255) / 255, np.float32)  # as files have it


@dataclass(frozen=True)
class ShapeFactory:
    """Makes new shapes as the settings ask for; lengths are in canvas units, angles in rad."""

    settings: Settings
    canvas: Canvas

    def place(self, centres: Floats, areas: Floats, angles: Floats, colors: FloatArray) -> Scene:
        """Return shapes of the settings' kind: circles, or strokes along ``angles``."""
        settings = self.settings
        if settings.kind == Kind.STROKE:
            widths = np.maximum(np.sqrt(areas / STROKE_ASPECT), 1.0)
            return self.place_strokes(centres, areas / widths, widths, angles, colors)
        basis, count = settings.form
        if basis.is_form:
            points = form_of(basis.name).start(centres, areas, angles, count).astype(np.float32)
            return self._new(Kind.FILL, points, np.zeros(len(centres)), colors)
        radii = np.sqrt(areas / np.pi)
        if basis == Basis.CUBIC:
            points = circle_outlines(centres, radii, settings.chain_cubics)
        else:
            points = circle_splines(centres, radii, settings.spline_points)
        return self._new(Kind.FILL, points, np.zeros(len(centres)), colors)

    def place_strokes(
        self, centres: Floats, lengths: Floats, widths: Floats, angles: Floats, colors: FloatArray
    ) -> Scene:
        """Return straight strokes."""
        basis, count = self.settings.form
        # Points of a new stroke among fills: a bar needs few, and with more of them it wobbles.
        mixed_stroke_points = 6
        if self.settings.mixed:
            count = mixed_stroke_points
        if basis == Basis.CUBIC:
            count = 3 * STROKE_CUBICS + 1
        direction = np.stack([elementary.cos(angles), elementary.sin(angles)], axis=1)
        along = np.maximum(lengths, 2.0)[:, None] * np.linspace(-0.5, 0.5, count)
        points = np.asarray(centres[:, None] + along[..., None] * direction[:, None], np.float32)
        return self._new(Kind.STROKE, points, widths, colors)

    def _new(self, kind: Kind, points: FloatArray, widths: Floats, colors: FloatArray) -> Scene:
        opacity = OPACITY_RANGE[1] if self.settings.opaque else self.settings.opacity
        return Scene.uniform(
            kind,
            self.canvas,
            points,
            self.settings.form[0],
            colors=np.asarray(colors, np.float32).reshape(len(points), 3),
            opacities=np.full(len(points), opacity, np.float32),
            widths=np.asarray(widths, np.float32),
        )


def circle_outlines(centres: Floats, radii: Floats, chain_cubics: int) -> FloatArray:
    """Return circles as rings of ``2 * chain_cubics`` cubics, shape (shape, 6 * chain_cubics, 2)."""
    count = 2 * chain_cubics
    handle = 4 / 3 * elementary.tan(np.pi / (2 * count))
    on_circle = _unit_circle(count)
    tangent = np.stack([-on_circle[:, 1], on_circle[:, 0]], axis=1)
    following, following_tangent = np.roll(on_circle, -1, axis=0), np.roll(tangent, -1, axis=0)
    cubics = [on_circle, on_circle + handle * tangent, following - handle * following_tangent]
    ring = np.stack(cubics, axis=1).reshape(-1, 2)
    return np.asarray(centres[:, None] + radii[:, None, None] * ring[None], np.float32)


def circle_splines(centres: Floats, radii: Floats, count: int) -> FloatArray:
    """Return circles as splines of ``count`` points, shape (shape, count, 2)."""
    # Radius of the outline over that of its points: the mean at the joints and in the middles of quadratics.
    ratio = (elementary.cos(np.pi / count) + (3 + elementary.cos(2 * np.pi / count)) / 4) / 2
    return np.asarray(centres[:, None] + radii[:, None, None] * (1 / ratio) * _unit_circle(count), np.float32)


def _unit_circle(count: int) -> Floats:
    """Return ``count`` points of the unit circle, shape (point, 2)."""
    angle = 2 * np.pi * np.arange(count) / count
    return np.stack([elementary.cos(angle), elementary.sin(angle)], axis=1)


def shape_angles(settings: Settings, target: FloatArray, centres: Floats, sigma: float) -> FloatArray:
    """Return the direction of new shapes at ``centres`` [rad]: for strokes that of contours.

    It is the structure tensor's lesser eigenvector. Fills start as circles and have none: 0.
    """
    if settings.kind == Kind.FILL:
        return np.zeros(len(centres), np.float32)
    grey = target.mean(axis=2)
    gx, gy = filters.sobel(grey)
    xx, yy, xy = (filters.gaussian_blur(g, max(sigma, 0.5)) for g in (gx * gx, gy * gy, gx * gy))
    column, row = pixel_of(centres, target)
    gradient = 0.5 * elementary.arctan2(2 * xy[row, column], (xx - yy)[row, column])
    return np.asarray(gradient + np.pi / 2, np.float32)


def pixel_of(centres: Floats, target: FloatArray) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Return column and row of the pixels that contain ``centres``, clamped to the image."""
    column = np.clip(centres[:, 0].astype(np.intp), 0, target.shape[1] - 1)
    row = np.clip(centres[:, 1].astype(np.intp), 0, target.shape[0] - 1)
    return column, row
