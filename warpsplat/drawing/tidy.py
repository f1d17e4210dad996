"""A drawing finished: fitted, without nodes that nobody would miss, on a grid that costs little."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares
from warpsplat.drawing.cells import by_cell, first_apart, sum_within
from warpsplat.drawing.costs import DONE, Costs, Ending, RoundsWatch
from warpsplat.drawing.fit_outlines import Refinement, matching, refine_drawing
from warpsplat.drawing.nodes import MOST_OFF, Edit, Key, Outlines, applied, turned
from warpsplat.fit.constraints import Constraints, Drawing, Projection
from warpsplat.fit.rate import byte_worth
from warpsplat.fit.rounding import STAGED_COST
from warpsplat.fit.work import Meter, Report
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.models import EXACT
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Capacity, Renderer
from warpsplat.rendering.tiles import to_tiles
from warpsplat.scene import FloatArray
from warpsplat.svg.write import GRIDS, rounded, write_svg

ROUNDS, FEWEST_ROUNDS = 16, 4
"""In which candidates are tried, at the most, and what is left of that for large pictures."""

ROUND_PIXELS = 26_000_000
"""Pixels that all rounds together look at: of a large picture each takes long, and the first find most."""

REFIT = Refinement(steps=50, point_rate=0.1)
"""After each round."""

LARGE = 100_000
"""Pixels from which on half of these steps do: with as many more pixels, outlines have fewer that matter."""

LEAST_ERROR = 3e-5
"""Mean squared error below which a picture is as good as another: 45 dB. A drawing can have much more, at the
price of nodes that nobody would miss."""

USUAL_GRID = 10.0
"""Units a pixel, where the grid is not known yet."""

FARTHEST_OFF = 4.0
"""How far a candidate may move an outline [canvas units], however dear bytes are."""

WORTHWHILE = 0.004
"""Share of the file's bytes that a round has to spare for another one to follow."""

MENDED = 10.0
"""How much more a candidate may cost before it is fitted anew."""

Floats = npt.NDArray[np.float64]
Stop = Callable[[], bool]


class Finished(NamedTuple):
    """What there is to write."""

    drawing: Drawing
    """Rounded to the grid."""
    per_pixel: float
    """Units of the view box a pixel."""


def finish_drawing(
    target: FloatArray,
    drawing: Drawing,
    backend: Backend,
    how: Refinement | None = None,
    *,
    finest: float = GRIDS[-1],
    tidy: bool = True,
    price: float = 1.0,
    report: Report | None = None,
    after: float = 0.0,
    stop: Stop | None = None,
) -> Finished:
    """Refine a traced drawing, remove nodes, and round it.

    Args:
        target: sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, shape (height,
            width, 4).
        drawing: as traced.
        backend: where to compute.
        how: rates and steps of the first refinement.
        finest: most units of the view box a pixel.
        tidy: whether nodes are removed.
        price: of a byte, over what it is worth usually: the higher, the fewer there are.
        report: called every few steps.
        after: work that comes then (``fit.costs``).
        stop: asked after every step and round; once true, what there is is rounded.
    """

    def refined(
        drawing: Drawing, how: Refinement, told: Report | None, held: npt.NDArray[np.bool_] | None = None
    ) -> Drawing:
        fields = (drawing.scene, drawing.joints, drawing.same)
        scene = refine_drawing(target, *fields, backend, how, held=held, report=told, stop=stop)
        return replace(drawing, scene=scene)

    target = matching(target, drawing.scene.canvas)
    if not len(drawing.scene):
        return Finished(drawing, min(USUAL_GRID, finest))
    how, meter = how or Refinement(), Meter(report, after)
    second, costs = replace(REFIT, steps=2 * REFIT.steps), Costs(target, drawing, backend)
    refit = costs.refit(REFIT)
    last = DONE * costs.refit(second) + costs.grid() + refit
    watch = RoundsWatch(meter, costs, after_round(target), WORTHWHILE, last)
    found = Outlines(drawing, reach_at(price)).edits() if report and tidy else []
    later = watch.ahead(found, apart(found), rounds_for(target[..., 0].size))
    drawing = refined(drawing, how, meter.stage(costs.refit(how), later, likely=Ending()))
    drawing = tidied(target, drawing, backend, watch, stop, price) if tidy else drawing
    told_second = meter.stage(costs.refit(second), costs.grid() + refit, likely=Ending())
    drawing = refined(drawing, second, told_second)
    meter.stage(costs.grid(), refit)  # of which nothing shows on the way
    grid = drawing_grid(target, drawing, backend, finest, price)
    on, _ = drawing.links()
    held = np.zeros(len(drawing.joints), np.bool_)
    held[on] = True
    low = rounded(drawing.scene, grid)
    points = np.where(held[:, None], low.points, drawing.scene.points)
    drawing = replace(drawing, scene=replace(drawing.scene, points=points))
    drawing = refined(drawing, REFIT, meter.stage(refit, 0), held)
    return Finished(replace(drawing, scene=rounded(drawing.scene, grid)), grid)


def tidied(
    target: FloatArray,
    drawing: Drawing,
    backend: Backend,
    watch: RoundsWatch | None = None,
    stop: Stop | None = None,
    price: float = 1.0,
) -> Drawing:
    """A drawing without the nodes, curves and slants that are worth less than their bytes.

    In each round candidates that do not meet are made together and fitted anew; each is judged by the pixels
    around it, and where some cost too much, the others are made alone. ``watch``: of its progress. ``price``:
    see ``finish_drawing``.
    """
    refused: set[Key] = set()
    how = after_round(target)
    judge = Judge(target, backend)
    errors = judge.errors(drawing)

    def refitted(edits: Sequence[Edit]) -> tuple[Drawing, Floats]:
        made = applied(drawing, edits)
        fields, report = (made.scene, made.joints, made.same), watch.refit() if watch else None
        scene = refine_drawing(
            target, *fields, backend, how, capacity=judge.capacity, report=report, stop=stop
        )
        made = replace(made, scene=scene)
        return made, judge.errors(made)

    most = rounds_for(target[..., 0].size)
    for turn in range(most):
        candidates = Outlines(drawing, reach_at(price)).edits(refused)
        edits = apart(candidates)
        if not edits or (stop and stop()):
            break
        if watch:
            watch.found(candidates, edits, most - turn)
        size = len(write_svg(drawing.scene, per_pixel=USUAL_GRID))
        worth = price * worth_of(errors, size)
        growth = judge.errors(applied(drawing, edits)) - errors
        left = [e for e in edits if sum_within(growth, e.cells) <= MENDED * e.saved * worth]
        refused |= {e.key for e in edits} - {e.key for e in left}
        while left:
            made, after = refitted(left)
            growth = after - errors
            taken = [e for e in left if sum_within(growth, e.cells) <= e.saved * worth]
            if len(taken) == len(left):
                drawing, errors = made, after
                break
            refused |= {e.key for e in left} - {e.key for e in taken}
            left = taken
        drawing = turned(drawing)
        spared = sum(e.saved for e in left)
        if watch:
            watch.spared(spared / size)
        if spared < WORTHWHILE * size:
            break
    return drawing


def reach_at(price: float) -> float:
    """How far a candidate may move an outline [canvas units]: the error grows by the square of that."""
    return min(MOST_OFF * math.sqrt(price), FARTHEST_OFF)


def after_round(target: FloatArray) -> Refinement:
    """How a drawing is fitted anew after each round."""
    return replace(REFIT, steps=REFIT.steps // 2) if target[..., 0].size > LARGE else REFIT


def rounds_for(pixels: int) -> int:
    """The most rounds for a picture of so many pixels."""
    return max(FEWEST_ROUNDS, min(ROUNDS, ROUND_PIXELS // pixels))


class Judge:
    """What drawings lack of one picture."""

    def __init__(self, target: FloatArray, backend: Backend) -> None:
        self._backend = backend
        self._viewport = Viewport(target.shape[1], target.shape[0])
        self._target = to_tiles(target)
        self.capacity: Capacity | None = None
        """Of a renderer that the last drawing fits into; one that is much like it will as well, so that
        arrays and launches need not be made twice.
        """

    def errors(self, drawing: Drawing) -> Floats:
        """What each cell adds to the mean squared error, as ``by_cell``."""
        parameters = Parameters(drawing.scene, self._backend)
        Projection(Constraints.of(drawing), parameters).project()
        renderer = Renderer(parameters, self._viewport, model=EXACT, capacity=self.capacity)
        renderer.forward_complete()
        self.capacity = renderer.capacity
        film = renderer.film.buffers
        lacking = squares(film.image.numpy() - self._target, axis=1) * film.inside.numpy()
        return by_cell(lacking, self._viewport) / (3 * self._viewport.pixel_count)


def worth_of(errors: Floats, size: int) -> float:
    """What a byte is worth of the mean squared error, in a file of ``size`` bytes."""
    return byte_worth(max(float(errors.sum()), LEAST_ERROR), size)


def apart(edits: Sequence[Edit]) -> list[Edit]:
    """Those that cost least for what they spare, no two of them with pixels in common."""
    ranked = sorted(edits, key=lambda e: (e.off / e.saved, e.key))
    return [ranked[i] for i in first_apart(edit.cells for edit in ranked)]


def drawing_grid(
    target: FloatArray, drawing: Drawing, backend: Backend, finest: float, price: float = 1.0
) -> float:
    """Units a pixel of the grid that costs least: in error, of which refitting mends most, and in bytes."""
    judge = Judge(target, backend)
    errors = judge.errors(drawing)
    worth = price * worth_of(errors, len(write_svg(drawing.scene, per_pixel=USUAL_GRID)))
    costs = {}
    for grid in [g for g in GRIDS if 1 <= g < finest] + [finest]:
        low = replace(drawing, scene=rounded(drawing.scene, grid))
        loss = float(judge.errors(low).sum() - errors.sum())
        costs[grid] = 2 * STAGED_COST * loss + worth * len(write_svg(low.scene, per_pixel=grid))
    return min(costs, key=costs.__getitem__)
