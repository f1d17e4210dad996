"""Recovery from numbers that are not finite: between steps, their shapes are reset or replaced.

No step is known to produce them from finite numbers. If one did, by an overflow or a fault of the device, one
such colour would spoil the gradients of all shapes around it, and the file.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from warpsplat.fit.densification import replace_shapes
from warpsplat.fit.step import Step
from warpsplat.scene import Scene


def recover(step: Step, *, replaces: bool, last: bool = False) -> Step:
    """Reset the shapes in which an update met a number that is not finite; return the step to continue with.

    These are the shapes that hold such a number, or else those whose gradients were not finite. They get the
    values that they had after the last densification step, or at the start.

    Args:
        step: after its last ``advance``.
        replaces: whether new shapes where the error is take their place, as in densification.
        last: check all values, frozen ones too.
    """
    state, parameters = step.state, step.state.parameters
    flagged = parameters.take_broken()
    if not (last or flagged.any()):
        return step
    invalid = parameters.invalid()
    if not (invalid | flagged).any():
        return step
    scene = state.scene()
    reset = _with_twins(scene, invalid if invalid.any() else flagged)
    state.recovered += int(reset.sum())
    parameters.reset(reset)
    if state.projection:
        state.projection.project()
    step.render()
    reset[: state.base] = False
    if not (replaces and reset.any()):
        return step
    replace_shapes(step, scene, np.flatnonzero(~reset), scene.take(np.arange(0)), len(scene))
    return step.rebuilt()


def _with_twins(scene: Scene, shapes: npt.NDArray[np.bool_]) -> npt.NDArray[np.bool_]:
    """Return ``shapes`` and those that share their points."""
    both = shapes.copy()
    second = np.flatnonzero(scene.twin == 1)
    either = shapes[second] | shapes[second - 1]
    both[second[either]] = both[second[either] - 1] = True
    return both
