"""Finish a traced drawing: fit it, remove needless nodes, and round it to a cheap grid."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np

from warpsplat.drawing import model
from warpsplat.drawing.changes import changed, worthwhile
from warpsplat.drawing.constraints import DRAFT_GRID, Drawing, Finished
from warpsplat.drawing.crossings import crossing
from warpsplat.drawing.equal import Equal, on_grid, with_equal_outlines
from warpsplat.drawing.fit_outlines import OutlineFit, matching
from warpsplat.drawing.nodes import apart, applied, candidates
from warpsplat.drawing.optics import Seen
from warpsplat.drawing.prices import LEAST_ERROR, worth
from warpsplat.drawing.seen_colors import with_seen_colors
from warpsplat.drawing.shapes import shape_changes
from warpsplat.fit.optics import Optics
from warpsplat.fit.problem import Run
from warpsplat.metrics import decibels
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray
from warpsplat.svg.primitives import held_rounds
from warpsplat.svg.sizes import estimated_size
from warpsplat.svg.write import GRIDS, rounded

FIRST_STEPS, SECOND_STEPS, THIRD_STEPS = 16, 12, 6
"""Renders of the fits before and after nodes are removed, and after rounding."""

FIRST_ROAM, SECOND_ROAM, ROAM_PIXELS = 100, 50, 16_000_000
"""Steps of Adam after the first two fits, where they are needed, and pixels that all of these may render."""

FAR = 4
"""Steps at the beginning of the first two that look farther than to the next pixel's border."""

TURNS = 2
"""Fits through optics after each of the first two: each halves what is left of them, about."""

RECOVERED = 10.0
"""Largest error of an edit before refitting, over the largest one after: refitting recovers most of it, and
of a larger one samples cannot tell."""

Worth = Callable[[float, float], float]
"""Gives what a byte is worth at an error and a size, as ``prices.worth``."""


def finish_drawing(
    target: FloatArray,
    drawing: Drawing,
    run: Run,
    *,
    finest: float = GRIDS[-1],
    tidy: bool = True,
    price: float = 1.0,
    symbols: bool = False,
    grid: float | None = None,
    negligible: float = LEAST_ERROR,
    seen: FloatArray | None = None,
    optics: Optics | None = None,
) -> Finished:
    """Refine a traced drawing, remove nodes, and round it.

    Args:
        target: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, shape (height,
            width, 4).
        drawing: as traced; or as it was finished at a lower price.
        run: how the work is carried out; when it is over, the drawing stays as it is by then.
        finest: most view box units per pixel.
        tidy: whether nodes are removed.
        price: of a byte, over its usual one: the higher, the fewer nodes are left.
        symbols: whether nearly equal outlines become equal.
        grid: view box units per pixel; None: those that cost least.
        negligible: mean squared error below which differences do not count.
        seen: the image before it was made sharp, if ``target`` was: the drawing is fitted so that it is like
            that through the optics, of which both tell more and more. The PSNR is NaN then.
        optics: what is known of these.
    """
    target = matching(target, drawing.scene.canvas)
    picture = None
    if seen is not None:
        picture = Seen.of(matching(seen, drawing.scene.canvas), known=optics)
    if run.over() or not len(drawing.scene):
        return Finished(drawing, grid or min(DRAFT_GRID, finest))
    byte = partial(worth, price=price, negligible=negligible)
    parts = [run.part(i / 3, (i + 1) / 3) for i in range(3)]
    fit = OutlineFit(target, drawing, run)
    fit.advance(parts[0], FIRST_STEPS, FAR)
    _roam(fit, target, run, FIRST_ROAM, negligible)
    fit, target = _through_optics(fit, target, parts[0], picture)
    if tidy and not run.over():
        fit = OutlineFit(target, tidied(fit, byte, run.over), run)
        fit.advance(parts[1], SECOND_STEPS, FAR)
        _roam(fit, target, run, SECOND_ROAM, negligible)
        fit, target = _through_optics(fit, target, parts[1], picture)
    equal: list[Equal] = []
    if tidy and not run.over():
        exact, worth_of_byte = fit.drawing, byte(fit.error, estimated_size(fit.drawing.scene, DRAFT_GRID))
        shapes = shape_changes(exact, fit.places(), worth_of_byte, run.over)
        shapes = worthwhile(target, exact, run, shapes, worth_of_byte)
        exact = changed(exact, shapes)
        if symbols:
            exact, equal = with_equal_outlines(target, exact, run, worth_of_byte)
        if shapes or equal:
            fit = OutlineFit(target, exact, run)
    psnr = decibels(fit.error * 255**2) if seen is None else math.nan
    if run.over():
        return Finished(fit.drawing, grid or min(DRAFT_GRID, finest), psnr)
    grid = grid or drawing_grid(fit, finest, byte)
    low, held = on_grid(rounded(fit.drawing.scene, grid), equal, grid)
    held |= held_rounds(low, grid)
    held[::3] = True
    fit.hold(np.where(held[:, None], low.points, fit.points), held)
    fit.advance(parts[2], THIRD_STEPS)
    drawing = fit.drawing
    low, _ = on_grid(rounded(drawing.scene, grid), equal, grid)
    psnr = decibels(fit.error * 255**2) if seen is None else math.nan
    return Finished(replace(drawing, scene=low), grid, psnr)


def _through_optics(
    fit: OutlineFit, target: FloatArray, run: Run, picture: Seen | None
) -> tuple[OutlineFit, FloatArray]:
    """Return a fit to what the optics leave of an image, and that, by what the fit shows."""
    if picture is None:
        return fit, target
    draw = partial(render, backend=run.backend)
    for _ in range(TURNS):
        if run.over():
            break
        drawing = fit.drawing
        found = picture.find(*map(draw, picture.scenes(drawing.scene)))
        scene = with_seen_colors(drawing.scene, picture, found.kernel, draw)
        if (scene.colors != drawing.scene.colors).any():
            drawing = replace(drawing, scene=scene)
            found = picture.find(*map(draw, picture.scenes(scene)))
        target = found.undone
        fit = OutlineFit(target, drawing, run)
        fit.advance(run, SECOND_STEPS)
    return fit, target


def _roam(fit: OutlineFit, target: FloatArray, run: Run, steps: int, negligible: float) -> None:
    """Let outlines leave poor minima if the drawing is not yet near the image."""
    if fit.error > negligible and not run.over():
        quiet = replace(run, on_progress=None)
        fit.roam(quiet, min(steps, ROAM_PIXELS // target[..., 0].size))
        fit.advance(quiet, THIRD_STEPS)


def tidied(fit: OutlineFit, byte_of: Worth = worth, over: Callable[[], bool] = bool) -> Drawing:
    """Return a drawing without the nodes and curves that are worth less than their bytes.

    In each round edits that do not overlap are made together and the outlines fitted to where the image says
    that they are; each edit is judged by what is left around it, and if some cost too much, the others are
    made without them. ``byte_of``: what a byte is worth at an error and a size.
    """
    drawing, least = fit.drawing, fit.least
    samples = fit.places()
    errors = model.errors(samples, drawing.cubics())
    crosses = crossing(drawing.cubics(), drawing.following(), drawing.contour())
    rest = fit.error - errors.sum()
    size = float(estimated_size(drawing.scene, DRAFT_GRID))
    refused = np.zeros((len(errors), 2), np.bool_)
    while not over():
        edits = candidates(drawing, refused)
        byte = byte_of(rest + float(errors.sum()), size)
        growth = model.before_fit(samples, drawing, edits)
        cheap = growth <= RECOVERED * edits.saved * byte
        edits, growth = edits.take(cheap), growth[cheap]
        left = edits.take(apart(edits, growth / edits.saved))
        contour = drawing.contour()
        # Outlines without candidates, or whose candidates are all refused, stay as they are.
        refused[~np.isin(contour, contour[left.at])] = True
        while len(left.at):
            if over():
                return drawing
            edited, keep = applied(drawing, left)
            moved = model.carried(samples, drawing, left, keep)
            edited, moved, after = model.fitted(moved, edited, least, contour[left.at])
            every = np.zeros(len(keep))
            every[keep] = after
            change = every - errors
            around = np.sort(left.around, axis=1)
            fresh = np.concatenate([np.ones((len(around), 1), np.bool_), np.diff(around, axis=1) > 0], axis=1)
            cross = np.zeros(len(keep), np.bool_)
            cross[keep] = now = crossing(edited.cubics(), edited.following(), edited.contour())
            taken = (change[around] * fresh).sum(axis=1) <= left.saved * byte
            taken &= ~(cross & ~crosses)[around].any(axis=1)
            refused[left.at[~taken], left.kind[~taken]] = True
            if taken.all():
                drawing, samples, errors, refused, crosses = edited, moved, after, refused[keep], now
                break
            left = left.take(taken)
        size -= float(left.saved.sum())
        if not len(left.at):
            break
    return drawing


def drawing_grid(fit: OutlineFit, finest: float, byte_of: Worth) -> float:
    """Return the view box units per pixel that cost least, in bytes and in error after refitting."""
    scene, samples = fit.drawing.scene, fit.places()
    byte = byte_of(fit.error, estimated_size(scene, DRAFT_GRID))
    costs = {}
    for grid in [g for g in GRIDS if 1 <= g < finest] + [finest]:
        low = replace(fit.drawing, scene=rounded(scene, grid))
        error = float(model.errors(samples, low.cubics()).sum())
        costs[grid] = error + byte * estimated_size(scene, grid)
    return min(costs, key=costs.__getitem__)
