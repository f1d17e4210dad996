"""Finish a traced drawing: fit it, remove needless nodes, and round it to a cheap grid."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares
from warpsplat.drawing.cells import by_cell, first_apart, sum_within
from warpsplat.drawing.fit_outlines import Refinement, matching, refine_drawing
from warpsplat.drawing.nodes import MOST_DISTANCE, Edit, Key, Outlines, applied, turned
from warpsplat.drawing.shapes import with_shapes
from warpsplat.fit.constraints import Constraints, Drawing, Projection
from warpsplat.fit.problem import Run
from warpsplat.fit.rounding import STAGED_COST, byte_worth
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.models import EXACT
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.rendering.tiles import to_tiles
from warpsplat.scene import FloatArray
from warpsplat.svg.primitives import held_rounds
from warpsplat.svg.write import GRIDS, rounded, write_svg

TIDY_ROUNDS, FEWEST_ROUNDS = 16, 4
"""Most rounds in which edits are tried, and how many are left of these for large images."""

ROUND_PIXELS = 26_000_000
"""Most pixels evaluated by all rounds together: on a large image each takes long, and the first find most."""

REFIT = Refinement(steps=50, point_rate=0.1)
"""Refinement after each round."""

LARGE_PIXELS = 100_000
"""Size from which on half of these steps suffice [pixels]."""

LEAST_ERROR = 3e-5
"""Mean squared error below which differences do not count: 45 dB. A drawing can reach much less, by nodes
that nobody would miss."""

DRAFT_GRID = 10.0
"""View box units per pixel until the grid is chosen."""

FARTHEST_OFF = 4.0
"""How far an edit may move an outline, whatever a byte costs [canvas units]."""

WORTHWHILE = 0.004
"""Least share of the file's bytes that a round saves for another one to follow."""

RECOVERED = 10.0
"""Largest error of an edit before refitting, over the largest one after: refitting recovers most of it."""

FIRST_END, ROUNDS_END, SECOND_END = 0.2, 0.75, 0.9
"""Shares of the progress at which the first refinement, the rounds, and the second refinement are done."""

ROUND_SHARE = 0.1
"""Share of the remaining progress of the rounds that each refitting takes."""

Floats = npt.NDArray[np.float64]


class Finished(NamedTuple):
    """A drawing as it is written."""

    drawing: Drawing
    """Rounded to the grid."""
    per_pixel: float
    """View box units per pixel."""


def finish_drawing(
    target: FloatArray,
    drawing: Drawing,
    run: Run,
    *,
    finest: float = GRIDS[-1],
    tidy: bool = True,
    price: float = 1.0,
) -> Finished:
    """Refine a traced drawing, remove nodes, and round it.

    Args:
        target: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, shape (height,
            width, 4).
        drawing: as traced; or as it was finished at a lower price.
        run: how the work is carried out; when it is over, the drawing is rounded as it is.
        finest: most view box units per pixel.
        tidy: whether nodes are removed.
        price: of a byte, over its usual one: the higher, the fewer nodes are left.
    """
    target = matching(target, drawing.scene.canvas)
    if not len(drawing.scene):
        return Finished(drawing, min(DRAFT_GRID, finest))
    first, second = Refinement() if price == 1 else REFIT, replace(REFIT, steps=2 * REFIT.steps)
    drawing = refine_drawing(target, drawing, run.part(0.0, FIRST_END), first)
    if tidy:
        drawing = tidied(target, drawing, run.part(FIRST_END, ROUNDS_END), price)
    drawing = refine_drawing(target, drawing, run.part(ROUNDS_END, SECOND_END), second)
    if tidy:
        judge = Judge(target, run.backend)
        errors = judge.errors(drawing)
        worth = price * worth_of(errors, len(write_svg(drawing.scene, per_pixel=DRAFT_GRID)))
        drawing = with_shapes(target, drawing, judge.errors, errors, worth)
    grid = drawing_grid(target, drawing, run.backend, finest, price)
    on, _ = drawing.links()
    low = rounded(drawing.scene, grid)
    held = held_rounds(low, grid)
    held[on] = True
    points = np.where(held[:, None], low.points, drawing.scene.points)
    drawing = replace(drawing, scene=replace(drawing.scene, points=points))
    drawing = refine_drawing(target, drawing, run.part(SECOND_END, 1.0), REFIT, held=held)
    return Finished(replace(drawing, scene=rounded(drawing.scene, grid)), grid)


def tidied(target: FloatArray, drawing: Drawing, run: Run, price: float = 1.0) -> Drawing:
    """Return a drawing without the nodes, curves and slants that are worth less than their bytes.

    In each round edits that do not overlap are made together and refitted; each is judged by the pixels
    around it, and if some cost too much, the others are made without them. ``price``: see ``finish_drawing``.
    """
    refused: set[Key] = set()
    pixels = target[..., 0].size
    how, parts = after_round(pixels), run.open_parts(share=ROUND_SHARE)
    judge = Judge(target, run.backend)
    errors = judge.errors(drawing)
    for _ in range(rounds_for(pixels)):
        edits = apart(Outlines(drawing, reach_at(price)).edits(refused))
        if not edits or run.over():
            break
        size = len(write_svg(drawing.scene, per_pixel=DRAFT_GRID))
        worth = price * worth_of(errors, size)
        growth = judge.errors(applied(drawing, edits)) - errors
        left = [e for e in edits if sum_within(growth, e.cells) <= RECOVERED * e.saved * worth]
        refused |= {e.key for e in edits} - {e.key for e in left}
        while left:
            edited = applied(drawing, left)
            edited = refine_drawing(target, edited, next(parts), how, capacity=judge.capacity)
            after = judge.errors(edited)
            growth = after - errors
            taken = [e for e in left if sum_within(growth, e.cells) <= e.saved * worth]
            if len(taken) == len(left):
                drawing, errors = edited, after
                break
            refused |= {e.key for e in left} - {e.key for e in taken}
            left = taken
        drawing = turned(drawing)
        if sum(e.saved for e in left) < WORTHWHILE * size:
            break
    return drawing


def reach_at(price: float) -> float:
    """Return how far an edit may move an outline [canvas units]: the error grows with the square of that."""
    return min(MOST_DISTANCE * math.sqrt(price), FARTHEST_OFF)


def after_round(pixels: int) -> Refinement:
    """Return how a drawing on an image of so many pixels is refitted after each round."""
    return replace(REFIT, steps=REFIT.steps // 2) if pixels > LARGE_PIXELS else REFIT


def rounds_for(pixels: int) -> int:
    """Return the most rounds for an image of so many pixels."""
    return max(FEWEST_ROUNDS, min(TIDY_ROUNDS, ROUND_PIXELS // pixels))


class Judge:
    """Compares drawings with one image."""

    def __init__(self, target: FloatArray, backend: Backend) -> None:
        self._backend = backend
        self._viewport = Viewport(target.shape[1], target.shape[0])
        self._target = to_tiles(target)
        self.capacity: Capacity | None = None
        """Capacity of a renderer that the last drawing fits into, and likely the next."""

    def errors(self, drawing: Drawing) -> Floats:
        """Return the share of each cell in the mean squared error, as ``by_cell``."""
        parameters = Parameters(drawing.scene, self._backend)
        Projection(Constraints.of(drawing), parameters).project()
        renderer = Renderer(parameters, self._viewport, model=EXACT, capacity=self.capacity)
        renderer.forward_complete()
        self.capacity = renderer.capacity
        film = renderer.film.buffers
        residual = squares(film.image.numpy() - self._target, axis=1) * film.inside.numpy()
        return by_cell(residual, self._viewport) / (3 * self._viewport.pixel_count)


def worth_of(errors: Floats, size: int) -> float:
    """Return the mean squared error that a byte is worth, in a file of ``size`` bytes."""
    return byte_worth(max(float(errors.sum()), LEAST_ERROR), size)


def apart(edits: Sequence[Edit]) -> list[Edit]:
    """Return the edits with the least error for the bytes saved, no two with pixels in common."""
    ranked = sorted(edits, key=lambda e: (e.off / e.saved, e.key))
    return [ranked[i] for i in first_apart(edit.cells for edit in ranked)]


def drawing_grid(
    target: FloatArray, drawing: Drawing, backend: Backend, finest: float, price: float = 1.0
) -> float:
    """Return the view box units per pixel that cost least, in bytes and in error after refitting."""
    judge = Judge(target, backend)
    errors = judge.errors(drawing)
    worth = price * worth_of(errors, len(write_svg(drawing.scene, per_pixel=DRAFT_GRID)))
    costs = {}
    for grid in [g for g in GRIDS if 1 <= g < finest] + [finest]:
        low = replace(drawing, scene=rounded(drawing.scene, grid))
        loss = float(judge.errors(low).sum() - errors.sum())
        costs[grid] = 2 * STAGED_COST * loss + worth * len(write_svg(low.scene, per_pixel=grid))
    return min(costs, key=costs.__getitem__)
