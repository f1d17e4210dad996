"""Line art, traced as strokes."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np

from warpsplat.drawing.constraints import Drawing
from warpsplat.drawing.junctions import with_junctions
from warpsplat.drawing.kernels import compile_meanwhile
from warpsplat.drawing.prices import CUBIC, LEVEL, MOVE, NUMBER, worth
from warpsplat.drawing.strokes.broad import BROAD, disc_cover, pen_width
from warpsplat.drawing.strokes.ink import Ink, find_ink
from warpsplat.drawing.strokes.lines import FINE_PIXELS, TracedLines, trace_ink
from warpsplat.drawing.strokes.pens import grouped
from warpsplat.drawing.strokes.tour import toured
from warpsplat.drawing.thin import THIN_SIDE, continued, cut, margins
from warpsplat.drawing.tidy import finish_drawing
from warpsplat.drawing.trace.grids import Bools, Floats, at_pixels, bounding_boxes, depth, dilated, nearest_in
from warpsplat.drawing.trace.trace import trace
from warpsplat.drawing.width_steps import by_stroke, cut_at_steps, rejoined
from warpsplat.errors import ImageError
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Fit, Problem, Run, Start
from warpsplat.fit.rounding import finest
from warpsplat.fit.settings import Density, Settings, solid_color
from warpsplat.portable.elementary import exp, hypot
from warpsplat.rendering.renderer import render
from warpsplat.scene import ATTRIBUTES, FloatArray, IndexArray, Kind, Scene
from warpsplat.svg.sizes import HEAD, PATH

STROKE_STEPS = 240
"""Most steps of the refinement: the strokes are traced to fractions of a pixel."""

STROKE_RATE = 0.12
"""Learning rate of points, and of widths on both sides of a line [px]."""

STROKE_BETAS = 0.9, 0.99
"""``Settings.beta1`` and ``beta2``: strokes that meet need steadier steps than the shapes of a photograph."""

ALIKE = 0.3
"""Difference of the widths of usual strokes up to which one pen drew them [px]."""


LIFT = 2.0
"""Price of a further stroke over that of its bytes: for it the pen is lifted."""


def draw_lines(problem: Problem, run: Run) -> Fit:
    """Trace line art as strokes, and refine them against its ink.

    Each pen gets a layer, ``pen-1-rrggbb`` for the most used one: its filled areas, if the
    settings are mixed, and strokes ordered to minimise pen-up travel. If the settings have a width, all
    strokes get it.

    Raises:
        ImageError: there is no ink.
    """
    compile_meanwhile(Kind.STROKE, run.backend)
    across, down = margins(problem.target, THIN_SIDE)
    width = float(problem.settings.width) if problem.settings.width else None
    problem = replace(problem, target=continued(problem.target, across, down))
    settings = problem.settings
    ink = find_ink(problem.target, mixed=settings.mixed)
    color = solid_color(settings.background)
    if color is not None:
        ink = replace(ink, paper=color)
    traced = trace_ink(ink, mixed=settings.mixed, ring_width=width)
    if not traced.lines and not traced.areas:
        raise ImageError("no lines found: nothing but specks is darker than the paper around it")
    begin = 0.5 if traced.areas else 0.0
    lines, fills = traced.scene(), traced.scene().take(np.zeros(0, np.intp))
    made, per_pixel = Fit(lines, 1.0, 0.0, 0.0, 0, False), 1.0
    if traced.areas:
        fills, per_pixel = filled(traced, run.part(0.0, begin), finest(settings), tidy=settings.tidy)
    if len(lines):
        picture, importance = _to_refine(ink, traced)
        ink_alone = Problem(picture, settings, importance)
        made = refined(lines, ink_alone, run.part(begin, (begin + 1) / 2))
        lines = made.scene
        if width is None:
            lines = with_steps(ink, traced, lines, ink_alone, run.part((begin + 1) / 2, 1.0))
            lines = with_dots(ink, traced, lines, run)
        else:
            lines = replace(lines, widths=np.full_like(lines.widths, width))
        lines = toured(lines)
    scene = fills.append(lines)
    scene = scene.take(np.argsort(scene.layer, kind="stable"))
    scene = replace(scene, layer=np.unique(scene.layer, return_inverse=True)[1].astype(np.int32))
    scene = replace(scene, layer_names=pen_names(scene))
    return replace(made, scene=cut(scene, across, down), per_pixel=max(per_pixel, made.per_pixel))


def _drawn(ink: Ink, traced: TracedLines, lines: Scene, data: float, run: Run) -> tuple[FloatArray, float]:
    """Return the share of each pixel that is drawn, and the error that a further stroke is worth.

    ``data``: bytes of its path data after the first point. The error is squared, summed over pixels.
    """
    white = replace(lines.canvas, background=np.ones(3, np.float32))
    black = replace(lines, canvas=white, colors=np.zeros_like(lines.colors))
    apart = 0 if traced.areas is None else traced.areas.cover
    drawn = np.maximum(1 - render(black, backend=run.backend)[..., 0], apart)
    size = HEAD + PATH * len(lines) + NUMBER * lines.points.size
    error = max(float(np.square(ink.cover - drawn).sum()), 1e-9)
    # A byte is worth less, the less error is left, and nothing is worth more than all of it.
    return drawn, error * (1 - float(exp(-LIFT * worth(error, size) * (PATH + MOVE + data) / error)))


def with_steps(ink: Ink, traced: TracedLines, lines: Scene, problem: Problem, run: Run) -> Scene:
    """Return fitted strokes, cut where the width changes if that is worth a further stroke."""
    drawn, price = _drawn(ink, traced, lines, CUBIC, run)
    pieces, owner = cut_at_steps(lines, ink.cover - drawn, price)
    if len(pieces) == len(lines) or run.over():
        return lines
    pieces = rejoined(refined(pieces, problem, replace(run, checkpoint=None)).scene, owner)
    then, _ = _drawn(ink, traced, pieces, CUBIC, run)
    gain = by_stroke(lines, np.square(ink.cover - drawn) - np.square(ink.cover - then))
    cuts = np.bincount(owner) - 1
    is_better = (cuts > 0) & (gain > price * cuts)
    kept = lines.take(np.flatnonzero(~is_better))
    return with_junctions(kept.append(pieces.take(np.flatnonzero(is_better[owner]))))


def with_dots(ink: Ink, traced: TracedLines, lines: Scene, run: Run) -> Scene:
    """Return strokes, and dots on what of the ink they leave bare, where these are worth their bytes."""
    drawn, least = _drawn(ink, traced, lines, LEVEL, run)
    inside = np.minimum(depth(ink.mask) - 0.5, BROAD * pen_width(ink.mask))
    parts: IndexArray = np.asarray(cv2.connectedComponents((ink.cover - drawn > 0.5).astype(np.uint8))[1])
    dots = []
    for number, box in enumerate(bounding_boxes(parts - 1, int(parts.max())), 1):
        reach = math.ceil(inside[parts == number].max())
        low = np.maximum(np.subtract(box[:2], reach), 0)
        window = np.s_[low[1] : box.bottom + reach, low[0] : box.right + reach]
        own, cover, now = parts[window] == number, ink.cover[window], drawn[window]
        while own.any():
            x, y, radius = _best_disc(own, inside[window])
            then = np.maximum(now, disc_cover(now.shape, (x, y), radius))
            if np.square(cover - now).sum() - np.square(cover - then).sum() <= least:
                break
            dots.append((low[0] + x, low[1] + y, 2 * radius))
            now, own = then, own & (cover - then > 0.5)
    if not dots:
        return lines
    found = np.array(dots, np.float32)
    colors = at_pixels(ink.shown, found[:, :2])
    pens = np.linalg.norm(traced.pens - colors[:, None], axis=2).argmin(axis=1)
    points = np.repeat(found[:, None, :2], 4, axis=1)
    added = Scene.uniform(Kind.STROKE, lines.canvas, points, colors=traced.pens[pens], widths=found[:, 2])
    return lines.append(replace(added, opacities=np.ones(len(dots), np.float32), layer=pens.astype(np.int32)))


def _best_disc(bare: Bools, inside: Floats) -> tuple[float, float, float]:
    """Return the largest disc inside ink, x, y and radius, that covers the middle of its bare part.

    Args:
        bare: The pixels of the part.
        inside: Radius of the largest disc around each pixel.
    """
    left = depth(bare)
    row, column = np.unravel_index(int(left.argmax()), left.shape)
    y, x = np.ogrid[: left.shape[0], : left.shape[1]]
    fits = inside - hypot(y - row, x - column) >= min(float(left[row, column]), float(inside.max())) - 1
    best = np.where(fits, inside, 0)
    row, column = np.unravel_index(int(best.argmax()), best.shape)
    return column + 0.5, row + 0.5, float(best[row, column])


def _to_refine(ink: Ink, traced: TracedLines) -> tuple[FloatArray, FloatArray | None]:
    """Return the picture that strokes are refined against, and its importance mask.

    In the picture even ink of the pen whose mixture is nearest is on even paper.
    """
    paper = _opaque(ink.paper)
    cover, importance = ink.cover[..., None], None
    if traced.areas:  # strokes reach into them
        importance = 1 - traced.areas.cover
        cover = cover * (importance == 1)[..., None]
    mixtures = [paper + cover * (pen - paper) for pen in traced.pens]
    away = [np.square(ink.shown - mixture).sum(axis=2) for mixture in mixtures]
    picture = np.take_along_axis(np.stack(mixtures), np.argmin(away, axis=0)[None, ..., None], axis=0)[0]
    return picture.astype(np.float32), importance


def _opaque(paper: FloatArray | None) -> FloatArray:
    """Return the colour of a paper; white if it is transparent."""
    return np.ones(3, np.float32) if paper is None else paper


def refined(strokes: Scene, problem: Problem, run: Run) -> Fit:
    """Return traced strokes fitted to a picture of their ink.

    Those that are about as wide have one width, and those that end at others meet their centre lines.
    """
    paper = _opaque(strokes.canvas.background)
    canvas = replace(strokes.canvas, background=paper)
    start = replace(strokes, layer=np.zeros_like(strokes.layer), canvas=canvas)
    settings = _line_settings(problem.settings, len(start))
    made = fit(replace(problem, settings=settings), run, Start(scene=start))
    (thinnest,) = (attribute.low[0] for attribute in ATTRIBUTES if attribute.name == "widths")  # of a fit
    widths = np.where(strokes.widths < thinnest, strokes.widths, made.scene.widths)
    found = replace(made.scene, widths=widths, canvas=strokes.canvas, layer=strokes.layer)
    return replace(made, scene=with_junctions(with_equal_widths(found)))


def with_equal_widths(strokes: Scene) -> Scene:
    """Return strokes of which those that are about as wide have one width."""
    widths = strokes.widths.astype(np.float64)
    lengths = lengths_of(strokes) + widths
    group = grouped(widths[:, None], lengths, ALIKE)
    means = np.bincount(group, lengths * widths) / np.bincount(group, lengths)
    return replace(strokes, widths=means[group].astype(np.float32))


def lengths_of(strokes: Scene) -> Floats:
    """Return the lengths of the control polygons of strokes [px], shape (stroke,)."""
    steps = np.append(hypot(*np.diff(strokes.points.astype(np.float64), axis=0).T), 0.0)
    steps[strokes.first[1:] - 1] = 0
    return np.asarray(np.add.reduceat(steps, strokes.first[:-1]))


def _line_settings(settings: Settings, count: int) -> Settings:
    """Return the settings of the refinement of ``count`` strokes: of their places and widths alone."""
    fixed = dict.fromkeys(settings.rates, 0.0)
    return replace(
        settings,
        curves=min(count, 100_000),
        iterations=min(settings.iterations, STROKE_STEPS),
        coarse=0.0,
        fine_pixels=min(settings.fine_pixels, FINE_PIXELS),
        density=Density(interval=0),
        rates={**fixed, "points": STROKE_RATE, "widths": STROKE_RATE / 2},
        beta1=STROKE_BETAS[0],
        beta2=STROKE_BETAS[1],
        mixed=False,
        renderer="exact",
        texture=0.0,
        viewer=False,  # colours of the file are not those of the picture, but the pens'
        target_psnr=None,
        max_bytes=None,
        levels=(),
    )


def pen_names(scene: Scene) -> tuple[str, ...]:
    """Return the names of the pens' layers."""
    shown: IndexArray = np.unique(scene.layer, return_index=True)[1]
    colors = np.round(255 * scene.colors[shown]).astype(np.uint8)
    return tuple(f"pen-{number}-{color.tobytes().hex()}" for number, color in enumerate(colors, 1))


def filled(traced: TracedLines, run: Run, finest: float, *, tidy: bool = True) -> tuple[Scene, float]:
    """Trace the areas of line art, in the colours of their pens, and return them and their grid.

    ``finest``: most view box units per pixel.
    """
    areas = traced.areas
    assert areas is not None
    inside = areas.labels > 0
    pen = traced.area_pens[areas.labels.reshape(-1)[nearest_in(inside)] - 1]
    # A pixel beside an area may be covered by its edge.
    cover = np.where(dilated(inside, 3), areas.cover, 0)[..., None]
    ink = np.concatenate([traced.pens[pen] * cover, cover], axis=2).astype(np.float32)
    found = trace(ink, gradients=())
    done = finish_drawing(ink, Drawing(found.scene, found.joints), run, finest=finest, tidy=tidy)
    shapes = done.drawing.scene
    layer = np.linalg.norm(shapes.colors[:, None] - traced.pens, axis=2).argmin(axis=1).astype(np.int32)
    opacities = np.ones(len(shapes), np.float32)
    shapes = replace(shapes, layer=layer, colors=traced.pens[layer], opacities=opacities)
    return shapes, done.per_pixel
