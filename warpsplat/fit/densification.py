"""Densification: every few steps shapes that matter least are replaced by new ones where the error is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import numpy.typing as npt

from warpsplat.fit.grow import new_shapes
from warpsplat.fit.paints import choose_paints
from warpsplat.fit.renderers import renderer_of
from warpsplat.fit.schedule import mean_points_at, opacity_threshold, repaints_at, shapes_at
from warpsplat.fit.settings import Density
from warpsplat.fit.simplify import simplify
from warpsplat.fit.step import Step
from warpsplat.scene import Basis, FloatArray, IndexArray, Scene
from warpsplat.scene.geometry import areas, bounds

BoolArray = npt.NDArray[np.bool_]

PAIRS_PER_CHUNK = 1 << 18
"""Pairs of shapes that ``duplicates`` compares at once, to bound its memory."""


def densify(step: Step, *, grows: bool) -> None:
    """Prune, grow and, by the settings, repaint and reorder the shapes; rebuild the step for the new ones.

    ``grows``: whether the number of shapes and points follows the schedule; else it stays.
    """
    settings, state = step.settings, step.state
    step.renderer.forward_complete()
    costs = step.objective.quadratic().removal_costs()
    if settings.painting != "flat" and repaints_at(settings, state.step):
        choose_paints(step)
    scene = state.scene()
    wanted = state.base + shapes_at(settings, state.step) if grows else len(scene)
    keep = _kept(step, scene, costs, wanted)
    keep, added = renderer_of(settings.renderer).split(scene, keep, max(0, wanted - len(keep)))
    replace_shapes(step, scene, keep, added, wanted)
    if grows:
        _reduce_points(step, costs[keep])
    if settings.order == "area":
        scene = state.scene()
        order = np.lexsort((-areas(scene), scene.layer))
        state.parameters.rearrange(order, scene.take(np.arange(0)))
    step.rebuild()


def replace_shapes(step: Step, scene: Scene, keep: IndexArray, added: Scene, count: int) -> None:
    """Keep the shapes ``keep``, append ``added`` and new ones where the error is, until there are ``count``.

    With shapes of earlier levels in the scene, new ones belong to the level after these.
    """
    state, target = step.state, step.target
    missing = count - len(keep) - len(added)
    if missing > 0:
        error = step.objective.by_pixel()
        new = new_shapes(step.settings, scene, target.image, error, missing, state.rng)
        added = added.append(new)
    if state.base:
        layer = int(scene.layer[: state.base].max()) + 1
        added = replace(added, layer=np.full(len(added), layer, np.int32))
    state.parameters.rearrange(keep, added)


def remove_surplus(step: Step, count: int) -> None:
    """Remove the shapes with the least removal costs until ``count`` are left, but none of earlier levels.

    These are rendered.
    """
    state = step.state
    # Rounds in which remove_surplus removes shapes: if two shapes hide each other, both cost 0 until one is
    # gone.
    surplus_rounds = 4
    for rounds_left in range(surplus_rounds, 0, -1):
        excess = state.parameters.shape_count - count
        if excess <= 0:
            break
        step.render()
        costs = step.objective.quadratic().removal_costs()
        costs[: state.base] = np.inf
        removed = np.argsort(costs, kind="stable")[: -(-excess // rounds_left)]
        none = state.scene().take(np.arange(0))
        state.parameters.rearrange(np.setdiff1d(np.arange(len(costs)), removed), none)
        step.rebuild()
    step.render()
    step.measured_error()


def _kept(step: Step, scene: Scene, costs: FloatArray, wanted: int) -> IndexArray:
    """Return the shapes to keep so that there will be ``wanted``, among them all of earlier levels."""
    settings, base = step.settings, step.state.base
    pruned = prune_mask(scene, settings.density, step.state.step / settings.iterations)
    pruned[:base] = False
    replaced = 0 if wanted < len(scene) else round(settings.density.replace * (len(scene) - base))
    ranked = costs.astype(np.float32)
    ranked[:base] = np.inf
    count = max(replaced, len(scene) - wanted, int(pruned.sum()))
    return np.sort(np.lexsort((ranked, ~pruned))[count:])


def _reduce_points(step: Step, costs: FloatArray) -> None:
    """Remove points of splines until their mean number is that of the schedule.

    ``costs``: removal costs of the first shapes; the others are new and keep their points.
    """
    state = step.state
    scene = state.scene()
    splines = scene.basis == Basis.SPLINE
    mean = mean_points_at(step.settings, state.step)
    excess = int(scene.point_counts()[splines].sum() - round(mean * int(splines.sum())))
    if excess <= 0:
        return
    # A change of an outline by an area costs what the shape is worth per area.
    worth = np.full(len(scene), np.inf, np.float32)
    worth[: len(costs)] = np.maximum(costs, 0) / np.maximum(areas(scene)[: len(costs)], 1.0)
    state.parameters.reshape(*simplify(scene, worth, excess))


def prune_mask(scene: Scene, density: Density, progress: float) -> BoolArray:
    """Return which shapes are faint, tiny, not finite or duplicates, at ``progress`` (share of the run)."""
    pruned = scene.opacities + scene.fades.mean(axis=1) < opacity_threshold(density, progress)
    # Many shapes on a small canvas have to be tiny.
    share = scene.canvas.width * scene.canvas.height / max(len(scene), 1)
    pruned |= areas(scene) < min(density.area, 0.1 * share)
    broken = ~np.isfinite(scene.points).all(axis=1)
    pruned |= np.logical_or.reduceat(broken, scene.first[:-1]) if len(scene) else pruned
    return pruned | duplicates(scene, density)


def duplicates(scene: Scene, density: Density) -> BoolArray:
    """Return which shapes have nearly the colour and the bounding box of a shape in front of them."""
    boxes = bounds(scene)
    # Boxes that overlap enough have nearly the same left edge: a window over the sorted edges is enough.
    order = np.argsort(boxes[:, 0], kind="stable")
    left = boxes[order, 0]
    slack = (1 - density.duplicate_overlap) * (boxes[:, 2] - boxes[:, 0])
    first = np.searchsorted(left, boxes[:, 0])
    counts = np.searchsorted(left, boxes[:, 0] + slack, "right") - first
    ends = np.cumsum(counts)
    found = np.zeros(len(scene), np.bool_)
    total = int(counts.sum())
    for start in range(0, total, PAIRS_PER_CHUNK):
        pair = np.arange(start, min(start + PAIRS_PER_CHUNK, total))
        i = np.searchsorted(ends, pair, "right")
        j = order[first[i] + pair - (ends - counts)[i]]
        similar = (i != j) & _are_similar(boxes, scene.colors, density, i, j)
        found[np.minimum(i, j)[similar]] = True
    return found


def _are_similar(
    boxes: FloatArray, colors: FloatArray, density: Density, i: IndexArray, j: IndexArray
) -> BoolArray:
    """Return which pairs of shapes have nearly the same box and colour."""
    sizes = np.maximum(1e-6, (boxes[:, 2:] - boxes[:, :2]).prod(axis=1))
    low, high = np.maximum(boxes[i, :2], boxes[j, :2]), np.minimum(boxes[i, 2:], boxes[j, 2:])
    common = np.clip(high - low, 0, None).prod(axis=1)
    overlap = common / (sizes[i] + sizes[j] - common)
    distance = np.linalg.norm(colors[j] - colors[i], axis=1)
    return np.asarray((overlap > density.duplicate_overlap) & (distance < density.duplicate_color))


def recover(step: Step, *, replaces: bool, last: bool = False) -> None:
    """Reset the shapes in which an update met a number that is not finite.

    These are the shapes that hold such a number, or else those whose gradients were not finite. They get the
    values that they had after the last densification step, or at the start.

    If ``replaces``, new shapes where the error is take their place, as in densification. If ``last``, all
    values are checked, frozen ones too.
    """
    state, parameters = step.state, step.state.parameters
    flagged = parameters.take_broken()
    if not (last or flagged.any()):
        return
    invalid = parameters.invalid()
    if not (invalid | flagged).any():
        return
    scene = state.scene()
    reset = _with_twins(scene, invalid if invalid.any() else flagged)
    state.renewed += int(reset.sum())
    parameters.reset(reset)
    step.render()
    reset[: state.base] = False
    if replaces and reset.any():
        replace_shapes(step, scene, np.flatnonzero(~reset), scene.take(np.arange(0)), len(scene))
        step.rebuild()


def _with_twins(scene: Scene, shapes: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return ``shapes`` and those that share their points."""
    both = shapes.copy()
    second = np.flatnonzero(scene.twin == 1)
    either = shapes[second] | shapes[second - 1]
    both[second[either]] = both[second[either] - 1] = True
    return both
