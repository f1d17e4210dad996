"""Run by ``test_new_attribute`` in a copy of the package with another attribute, ``glows``.

A fill has three of them, in [0, 1], that nothing draws; a loss in this file gives them a gradient.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import warp as wp

from tests.fit.pictures import picture
from tests.kernels import trials
from tests.scenes import mixed_scene, random_scene
from warpsplat.fit import losses
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.schedule import phases
from warpsplat.fit.settings import make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.scene import Kind, Scene
from warpsplat.svg.read import load_scene
from warpsplat.svg.write import write_svg

RATE = 0.05
AIM = np.array([0.3, 2.0, -1.0], np.float32)
"""The latter two are out of bounds."""


def launch_glow(program: Program, inputs: losses.LossInputs, weight: float) -> None:
    parameters = inputs.renderer.parameters
    program.launch(
        trials.glow_backward,
        parameters.shape_count,
        parameters.arrays,
        aim=wp.vec3(*AIM.tolist()),
        split=True,
    )


def glows(scene: Any) -> np.ndarray:
    return np.asarray(scene.glows)


def lit(scene: Scene) -> Scene:
    """``scene`` with glows, of fills only."""
    values = np.random.default_rng(0).uniform(0.4, 0.6, (len(scene), 3)).astype(np.float32)
    values[scene.kind != Kind.FILL] = 0
    glows(scene)[:] = values
    return scene


def check_surgery(scene: Scene) -> None:
    """In NumPy and on the device, moments included."""
    keep = np.array([4, 0, 3])
    np.testing.assert_array_equal(glows(scene.take(keep)), glows(scene)[keep])
    np.testing.assert_array_equal(glows(scene.append(scene.take(keep)))[len(scene) :], glows(scene)[keep])
    parameters = Parameters(scene, Backend.on("cpu"))
    group = parameters.groups["glows"]
    moments = np.random.default_rng(1).normal(size=(len(scene), 3)).astype(np.float32)
    group.moment1.assign(moments)
    group.moment2.assign(moments + 1)
    parameters.rearrange(keep, scene.take(np.array([1])))
    group = parameters.groups["glows"]
    np.testing.assert_array_equal(glows(parameters.scene()), glows(scene)[[4, 0, 3, 1]])
    np.testing.assert_array_equal(group.moment1.numpy(), [*moments[keep], np.zeros(3)])
    np.testing.assert_array_equal(group.moment2.numpy(), [*(moments[keep] + 1), np.zeros(3)])


def check_training(scene: Scene) -> None:
    """Gradients bind by name; Adam moves what has the attribute, at its rate, within its bounds."""
    losses.SHAPE_LOSSES = (*losses.SHAPE_LOSSES, losses.Loss(lambda *_: 1.0, launch_glow, "a trial"))
    image = picture()
    settings = make_settings(iterations=200)
    state = FitState.start(scene, Backend.on("cpu"), np.random.default_rng(0))
    step = Step(state, settings, Target(image, phases(settings, 64, 48)[-1]))
    step.advance()
    fills = scene.kind == Kind.FILL
    np.testing.assert_allclose(state.parameters.gradients()["glows"], glows(scene) - AIM, atol=1e-6)
    moved = glows(state.scene()) - glows(scene)
    np.testing.assert_allclose(moved[fills], np.sign(AIM - glows(scene))[fills] * RATE, rtol=1e-3)
    for _ in range(99):
        step.advance()
    assert not glows(state.scene())[~fills].any()
    np.testing.assert_allclose(glows(state.scene())[fills], np.tile([0.3, 1, 0], (fills.sum(), 1)), atol=0.03)


def check_run() -> None:
    """All else of a run goes on: new shapes, surgery, the file and its reader."""
    done = fit(Problem(picture(), make_settings(curves=12, iterations=100)), Run(Backend.on("cpu")))
    assert (glows(done.scene)[:, 1] > 0.5).all()
    text = write_svg(random_scene(Kind.FILL))
    assert not glows(load_scene(text, 40, 36, "a.svg")[0]).any()


if __name__ == "__main__":
    check_surgery(lit(mixed_scene(64, 48)))
    check_training(lit(mixed_scene(64, 48)))
    check_run()
