"""Strategies: functions that make the shapes of a file. To add one, add a row to ``STRATEGIES``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

from warpsplat.extensions import load
from warpsplat.fit.place import simple_curves
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.settings import Settings
from warpsplat.svg.order import by_color, by_opacity


class Strategy(NamedTuple):
    """A function that makes shapes, and what its shapes are like."""

    target: str
    """The function, as "module:attribute": what a run does not use is not imported."""
    keeps_order: bool = False
    """Whether the order of its shapes is kept; else they are reordered to make the file small."""
    traces: bool = False
    """Whether it leaves transparent pixels empty."""
    uses_device: bool = True
    """Whether it takes memory of the device."""

    @property
    def make(self) -> Callable[[Problem, Run], Fit]:
        """The function."""
        return load(self.target)


def fit_shapes(problem: Problem, run: Run) -> Fit:
    """Fit shapes to an image, fewer than asked for to a simple one."""
    from warpsplat.fit.loop import fit

    settings = problem.settings
    if settings.simplify:
        problem = problem.having(curves=min(settings.curves, simple_curves(problem.target)))
    return fit(problem, run)


STRATEGIES = {
    "fit": Strategy("warpsplat.run.strategies:fit_shapes"),
    "layers": Strategy("warpsplat.fit.layered:fit_layered"),
    "goal": Strategy("warpsplat.search.goal:search_goal", keeps_order=True),
    "drawing": Strategy("warpsplat.drawing.draw:draw_regions", keeps_order=True, traces=True),
    "draft": Strategy(
        "warpsplat.drawing.draw:draw_regions", keeps_order=True, traces=True, uses_device=False
    ),
    "line": Strategy("warpsplat.drawing.line_art:draw_lines", keeps_order=True, traces=True),
    "silhouette": Strategy("warpsplat.drawing.silhouette:draw_silhouettes", keeps_order=True, traces=True),
    "pixel": Strategy(
        "warpsplat.drawing.draft:draw_pixels", keeps_order=True, traces=True, uses_device=False
    ),
}


def choose_strategy(settings: Settings) -> Strategy:
    """Return the strategy for some settings; a subject ``auto`` is fitted as a photograph is."""
    if settings.subject == "drawing" and not settings.tidy:
        return STRATEGIES["draft"]
    if settings.subject in STRATEGIES:
        return STRATEGIES[settings.subject]
    if settings.target_psnr or settings.max_bytes:
        return STRATEGIES["goal"]
    return STRATEGIES["layers" if settings.levels else "fit"]


def arranged(made: Fit, problem: Problem, strategy: Strategy, run: Run) -> Fit:
    """Return a fit with its shapes in the order of the file, without those that show nothing."""
    settings = problem.settings
    # Soft Gaussians reach beyond the outlines that decide which shapes may change places.
    soft = renderer_of(settings.renderer).soft
    if not strategy.keeps_order and not soft:
        made = replace(made, scene=made.scene.take(by_opacity(made.scene)))
    if problem.target.shape[2] == 4 and not strategy.traces and not made.interrupted:
        from warpsplat.fit.clear import clear_empty

        clear = clear_empty(made.scene, problem.target, settings, run, made.per_pixel)
        made = replace(made, scene=clear, interrupted=run.stopped())
    if settings.ids and settings.subject != "line" and not soft:
        made = replace(made, scene=made.scene.take(by_color(made.scene)))
    return made
