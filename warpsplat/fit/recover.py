"""Numbers that are not finite: they are found between steps, and their shapes set anew.

No step makes one of finite numbers, as far as is known. Should it happen, by an overflow say, or a fault of
the device, one such colour would spoil the gradients of all shapes around, and the file.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from warpsplat.fit.density import densify
from warpsplat.fit.step import Step
from warpsplat.fit.surgery import in_front
from warpsplat.scene import Scene


def mend(step: Step, *, renews: bool, last: bool = False) -> Step:
    """Set the shapes anew that made an update meet a number that is not finite; the step to go on with.

    Those are the shapes that hold such a number; else those whose gradients were none. They get the values
    that they had after the last surgery, or at the start.

    Args:
        step: after its last ``advance``.
        renews: whether they are replaced by new shapes where the error is, as in surgery.
        last: whether all values are looked at, those too that are not updated any more.
    """
    parameters = step.state.parameters
    broken = parameters.take_broken()
    if not (last or broken.any()):
        return step
    invalid = parameters.invalid()
    if not (invalid | broken).any():
        return step
    culprits = _with_twins(step.state.scene(), invalid if invalid.any() else broken)
    step.state.renewed += int(culprits.sum())
    parameters.reset(culprits)
    if step.state.keeper:
        step.state.keeper.project()
    step.render()
    if renews:
        culprits[: step.state.base] = False
        if culprits.any():
            return _replaced(step, culprits)
    return step


def _with_twins(scene: Scene, shapes: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """``shapes`` and those whose points are the same."""
    both = shapes.copy()
    second = np.flatnonzero(scene.twin == 1)
    either = shapes[second] | shapes[second - 1]
    both[second[either]] = both[second[either] - 1] = True
    return both


def _replaced(step: Step, gone: npt.NDArray[np.bool_]) -> Step:
    """New shapes in place of ``gone`` ones."""
    state, target = step.state, step.target
    scene, image, count = state.scene(), step.renderer.read_image(), int(gone.sum())
    added = densify(step.settings, scene, target.image, image, count, state.rng, target.weights)
    if state.base:
        added = in_front(added, scene.take(np.arange(state.base)))
    state.parameters.rearrange(np.flatnonzero(~gone), added)
    return step.after_surgery()
