"""Ramps fitted to the error, and their gains."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.fit.pictures import step_for
from tests.scenes import random_scene, with_stops
from warpsplat.fit.paints import with_ramps, without_gradients
from warpsplat.fit.ramps import Ramps, RampSolver
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Paint, Scene

SIZE = 48


def square(margin: float = -20.0) -> Scene:
    """One opaque square, by default far larger than the canvas."""
    low, high = margin, SIZE - margin
    sides = [np.linspace(a, b, 4)[:3] for a, b in ((low, high), (high, high), (high, low), (low, low))]
    points = np.stack([np.concatenate(sides), np.concatenate([sides[3], *sides[:3]])], axis=1)
    return Scene.uniform(
        Kind.FILL,
        Canvas(SIZE, SIZE, np.zeros(3, np.float32)),
        points[None].astype(np.float32),
        Basis.CUBIC,
        colors=np.full((1, 3), 0.5, np.float32),
        opacities=np.ones(1, np.float32),
    )


def solver_of(scene: Scene, target: FloatArray, device: str) -> RampSolver:
    step = step_for(scene, target, device)
    step.renderer.forward_complete()
    return RampSolver(step)


def error(scene: Scene, target: FloatArray, device: str) -> float:
    difference = render(scene, backend=Backend.on(device)).astype(np.float64) - target
    if difference.shape[2] == 4:
        black, white = difference[..., :3], difference[..., :3] - difference[..., 3:]
        return float((black**2 + white**2).mean() / 2)
    return float((difference**2).mean())


def only(ramps: Ramps, kind: Paint, scene: Scene, shape: int = 0) -> Scene:
    """Return ``scene`` with one shape's ramp in place of its colour."""
    chosen = np.arange(len(scene)) == shape
    return with_ramps(scene, chosen, np.full(len(scene), kind, np.int32), ramps)


def places() -> tuple[np.ndarray, np.ndarray]:
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    return x, y


def test_a_linear_ramp_is_found(device: str) -> None:
    x, y = places()
    t = ((0.8 * x + 0.6 * y) / 80)[..., None]
    target = ((1 - t) * [0.1, 0.8, 0.3] + t * [0.9, 0.2, 0.5]).astype(np.float32)
    scene = square()
    painted = only(solver_of(scene, target, device).linear(), Paint.LINEAR, scene)
    # The picture's corners lie beyond the ends.
    assert error(painted, target, device) < 1e-3 * error(scene, target, device)


def test_a_radial_ramp_is_found(device: str) -> None:
    x, y = places()
    t = (np.hypot(x - 30, y - 18) / 60)[..., None]
    target = ((1 - t) * [0.9, 0.8, 0.2] + t * [0.4, 0.1, 0.6]).astype(np.float32)
    scene = square()
    solver = solver_of(scene, target, device)
    ramps = solver.radial(0.0)
    # The centre is that of the best parabola, which is not quite the cone's.
    np.testing.assert_allclose(ramps.frames[0, :2], [30, 18], atol=1.5)
    found = error(only(ramps, Paint.RADIAL, scene), target, device)
    assert found < 0.05 * error(only(solver.linear(), Paint.LINEAR, scene), target, device)


@pytest.mark.parametrize("clear", [False, True])
def test_gains_are_decreases_of_the_error(device: str, clear: bool) -> None:
    """Beyond the best flat colour, for translucent shapes behind others."""
    scene = random_scene(Kind.FILL, 5, SIZE, SIZE, seed=2)
    scene = replace(
        scene,
        canvas=Canvas(SIZE, SIZE, None if clear else scene.canvas.background),
        colors=0.35 + np.float32(0.3) * scene.colors,
    )
    image = render(scene, backend=Backend.on(device))
    x, y = places()
    # So little that no stop leaves [0, 1], and beyond the ends of a ramp next to nothing is seen.
    wave = 0.05 * np.stack([x / SIZE, y / SIZE, np.hypot(x, y) / SIZE], axis=2)
    target = image.copy()
    target[..., :3] += wave.astype(np.float32) * (image[..., 3:] if clear else 1)
    solver = solver_of(scene, target, device)
    seen = 0
    for kind, ramps in ((Paint.LINEAR, solver.linear()), (Paint.RADIAL, solver.radial(0.0))):
        counted = np.flatnonzero(ramps.gain > 0.05 * ramps.gain.max())
        for shape in counted:
            own = np.arange(len(scene)) == shape
            flat = without_gradients(scene, own, solver.flat)
            fall = error(flat, target, device) - error(only(ramps, kind, scene, shape), target, device)
            # Ends that a shape hides in part take up to a quarter off, over five scenes.
            assert fall == pytest.approx(ramps.gain[shape], rel=0.5)
        seen += len(counted)
    assert seen > 2


def test_flattening_increases_the_error_as_predicted(device: str) -> None:
    scene = with_stops(random_scene(Kind.FILL, 5, SIZE, SIZE, seed=3), seed=4)
    scene.stop_opacities[:] = 1
    target = np.random.default_rng(0).uniform(0.3, 0.7, (SIZE, SIZE, 3)).astype(np.float32)
    solver = solver_of(scene, target, device)
    before = error(scene, target, device)
    bent = np.flatnonzero(scene.paint != Paint.FLAT)
    for shape in bent:
        flat = without_gradients(scene, np.arange(len(scene)) == shape, solver.flat)
        assert error(flat, target, device) - before == pytest.approx(solver.flattening[shape], rel=0.02)
    assert (solver.flattening[bent] != 0).all()
