"""Candidate files, each made of an earlier one: shapes are removed or added, the last steps repeated."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from warpsplat.fit.budget import STYLE_BYTES
from warpsplat.fit.export import finished
from warpsplat.fit.grow import new_shapes
from warpsplat.fit.importance import pixel_weights
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Fit, Problem, Rounding, Run, Start
from warpsplat.fit.rounding import STAGES, stage_steps
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import Settings
from warpsplat.fit.simplify import MIN_SPLINE_POINTS, simplify
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, FloatArray, Kind, Scene
from warpsplat.scene.geometry import areas
from warpsplat.svg.order import by_opacity
from warpsplat.svg.write import path_sizes

LAST_STEPS = 0.2
"""Share of a fit's steps that is repeated after shapes were removed or added."""


FEW_SHAPES = 32
"""Most shapes of such a file."""

FEW_COARSE_PIXELS, FEW_FINE_PIXELS = 6_000, 24_000
"""Image sizes that few shapes are fitted to [pixels]."""

FEW_POINTS, FEW_MEAN_POINTS = 8, 6.0
"""Points of a new fill, and their mean in the end: another shape is worth more than a finer outline."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """A fit, with the figures of its file."""

    fit: Fit
    size: int
    """Bytes."""
    psnr: float
    """As a viewer shows it [dB]."""


@dataclass(frozen=True)
class Change:
    """The next candidate that is wanted, made of another one."""

    base: Candidate
    size: float
    """Bytes that it should have: decides how many shapes are removed or added."""
    per_pixel: float | None
    """View box units per pixel that it is rounded to; None: chosen by error and bytes."""


def measured(problem: Problem, made: Fit) -> Candidate:
    """Write and score the file of a fit, its shapes in the order that makes it small."""
    made = replace(made, scene=made.scene.take(by_opacity(made.scene)))
    text = finished(made.scene, problem.settings, made.per_pixel, problem.metadata)
    score = score_svg(text, problem.target, own=True, perceptual=False)
    return Candidate(made, score.bytes, score.psnr)


def changed(problem: Problem, change: Change, run: Run) -> Fit:
    """Remove or add shapes, and repeat the last steps; they end early at the run's deadline."""
    scene = resized_scene(problem, change, run.backend)
    settings = problem.settings
    density = replace(settings.density, interval=0)  # the shapes stay
    last = problem.having(target_psnr=None, curves=len(scene), density=density)
    # Before coordinates are rounded.
    latest = settings.iterations - STAGES * stage_steps(settings) - 1
    start = Start(scene=scene, begin=max(0, min(round((1 - LAST_STEPS) * settings.iterations), latest)))
    return fit(last, run.unsized(), start, Rounding(change.per_pixel, by_bytes=True))


def resized_scene(problem: Problem, change: Change, backend: Backend) -> Scene:
    """Return the shapes of a candidate, without the least important ones or with new ones."""
    settings, base, wanted = problem.settings, change.base, change.size
    scene, phase = base.fit.scene, phases(settings, *problem.size)[-1]
    weights = pixel_weights(Target(problem.target, phase).image, problem.importance, settings.texture)
    rng = np.random.default_rng(settings.seed)
    target = Target(problem.target, phase, weights, problem.loss)
    step = Step(FitState.start(scene, backend, rng), settings, target)
    sizes = path_sizes(scene, base.fit.per_pixel)
    if wanted < base.size:
        removal_costs = step.objective.quadratic().removal_costs()
        scene = smaller(scene, removal_costs, sizes, base.size - wanted)
    else:
        count = min(math.ceil((wanted - base.size) / sizes.mean()), settings.curves - len(scene))
        if count > 0:
            error = step.objective.by_pixel()
            scene = scene.append(new_shapes(settings, scene, target.image, error, count, rng))
    may_choose_background = settings.background == "auto" and not settings.is_limited
    if len(scene) <= FEW_SHAPES and problem.target.shape[2] == 3 and may_choose_background:
        scene = fit_background(scene, problem.target, backend)
    return scene


def smaller(scene: Scene, removal_costs: FloatArray, sizes: npt.NDArray[np.int64], excess: float) -> Scene:
    """Remove shapes, and for what is less than a shape points of splines.

    ``excess`` and the ``sizes`` of the shapes are in bytes; ``removal_costs`` are the growth of the error
    without each shape.
    """
    order = np.argsort(removal_costs / sizes, kind="stable")
    removed = np.cumsum(sizes[order])
    count = min(int(np.searchsorted(removed, excess, "right")), len(scene) - 1)
    left = excess - (float(removed[count - 1]) if count else 0.0)
    kept = np.sort(order[count:])
    counts = scene.point_counts()
    splines = kept[(scene.basis[kept] == Basis.SPLINE) & (counts[kept] > MIN_SPLINE_POINTS)]
    if not len(splines):  # nothing less than a shape can go
        return scene.take(np.sort(order[min(count + 1, len(scene) - 1) :]))
    a_point = (sizes[splines].mean() - STYLE_BYTES[Kind.FILL]) / (counts[splines].mean() + 2)
    scene, removal_costs = scene.take(kept), removal_costs[kept]
    worth = np.maximum(removal_costs, 0) / np.maximum(areas(scene), 1.0)
    return simplify(scene, np.asarray(worth, np.float32), math.ceil(left / max(a_point, 1.0)))[0]


def for_few(settings: Settings) -> Settings:
    """Return the settings of a fit whose file can hold ``settings.curves`` shapes, if these are few."""
    if settings.curves > FEW_SHAPES or settings.renderer != "exact":
        return settings
    settings = replace(
        settings,
        coarse_pixels=min(settings.coarse_pixels, FEW_COARSE_PIXELS),
        fine_pixels=min(settings.fine_pixels, FEW_FINE_PIXELS),
        texture=0.0,
    )
    if settings.kind == Kind.STROKE or settings.basis != Basis.SPLINE or settings.opaque:
        return settings
    # Opacity of all shapes, written once for all: where they overlap there are more colours than shapes.
    few_opacity = 0.7
    return replace(
        settings,
        spline_points=min(settings.spline_points, FEW_POINTS),
        density=replace(settings.density, mean_points=min(settings.density.mean_points, FEW_MEAN_POINTS)),
        opacity=few_opacity,
        rates={**settings.rates, "opacities": 0.0},
    )


def fit_background(scene: Scene, image: FloatArray, backend: Backend) -> Scene:
    """Return ``scene`` with the best background colour, by least squares where it shows.

    ``image``: sRGB in [0, 1], shape (height, width, 3).
    """
    black, white = (
        render(replace(scene, canvas=replace(scene.canvas, background=color)), backend=backend)
        for color in (np.zeros(3, np.float32), np.ones(3, np.float32))
    )
    seen = (white - black).astype(np.float64)
    weight = (seen * seen).sum(axis=(0, 1))
    # Least share of the canvas through which the background shows for its colour to be fitted.
    least_background_share = 1e-3
    if weight.min() < least_background_share * image.shape[0] * image.shape[1]:
        return scene
    color = np.clip((seen * (image - black)).sum(axis=(0, 1)) / weight, 0, 1)
    background = (np.round(color * 255) / 255).astype(np.float32)
    return replace(scene, canvas=replace(scene.canvas, background=background))
