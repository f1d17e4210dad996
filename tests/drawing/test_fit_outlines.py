"""Drawings fitted: nearer to the picture, and as clean as before."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import BLUE, RED, WHITE, disc, drawing, logo, seam
from tests.scenes import with_gradients
from warpsplat.alpha import squares
from warpsplat.drawing.fit_outlines import Refinement, own_colors, refine_drawing, start
from warpsplat.fit.constraints import Constraints, Drawing
from warpsplat.fit.problem import Run
from warpsplat.fit.step import Step
from warpsplat.kernels import constants
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas, FloatArray, Scene
from warpsplat.scene.attributes import Joint

QUICK = Refinement(steps=60, point_rate=0.4)


def psnr(scene: Scene, target: FloatArray, backend: Backend) -> float:
    error = squares(render(scene, backend=backend) - target).mean(dtype=float) / 3
    return float(-10 * np.log10(error + 1e-12))


def assert_clean(made: Drawing, scene: Scene) -> None:
    """Lines, smooth joints, ties and borders of ``made`` hold in ``scene``."""
    points = scene.points.astype(float)
    on, following = made.links()
    lines = made.lines()
    a, b = points[on[lines]], points[following[lines]]
    np.testing.assert_allclose(points[on[lines] + 1], (2 * a + b) / 3, atol=1e-5)
    np.testing.assert_allclose(points[on[lines] + 2], (a + 2 * b) / 3, atol=1e-5)
    previous = dict(zip(following.tolist(), on.tolist(), strict=True))
    for p in on[made.joints[on] == Joint.SMOOTH].tolist():
        back, ahead = points[p] - points[previous[p] + 2], points[p + 1] - points[p]
        turn = back[0] * ahead[1] - back[1] * ahead[0]
        assert abs(turn) < 1e-4 * (1 + float(np.linalg.norm(back) * np.linalg.norm(ahead))), p
        assert back @ ahead > 0
    for number in np.unique(made.same[made.same >= 0]):
        assert len(np.unique(scene.points[made.same == number], axis=0)) == 1
    constraints = Constraints.of(made)
    size = np.array([scene.canvas.width, scene.canvas.height])
    for axis in (0, 1):
        for edge in (0, size[axis]):
            here = made.scene.points[:, axis] == edge
            assert (scene.points[here & ~constraints.line_handles, axis] == edge).all()


@pytest.mark.parametrize("background", [WHITE, None], ids=["opaque", "transparent"])
def test_a_logo_is_found_again(device: str, background: FloatArray | None) -> None:
    backend = Backend.on(device)
    exact = logo(background)
    target = render(exact.scene, backend=backend)
    off = logo(background, spread=0.5)
    scene = refine_drawing(target, off, Run(backend), QUICK).scene
    assert psnr(off.scene, target, backend) < 27
    assert psnr(scene, target, backend) > 45
    assert_clean(off, scene)
    np.testing.assert_array_equal(scene.opacities, 1)
    np.testing.assert_array_equal(scene.colors, exact.scene.colors)


def test_seams_stay_closed(device: str) -> None:
    backend = Backend.on(device)
    target = render(seam().scene, backend=backend)
    off = seam(spread=0.5)
    scene = refine_drawing(target, off, Run(backend), QUICK).scene
    assert psnr(scene, target, backend) > psnr(off.scene, target, backend) + 10
    assert_clean(off, scene)


def test_what_is_exact_stays(device: str) -> None:
    """No result is worse than its start."""
    backend = Backend.on(device)
    exact = logo()
    target = render(exact.scene, backend=backend)
    scene = refine_drawing(target, exact, Run(backend), Refinement(steps=10, point_rate=3)).scene
    assert psnr(scene, target, backend) > 70


def test_colours_are_the_pictures_own(device: str) -> None:
    backend = Backend.on(device)
    exact = logo()
    levels = np.round(render(exact.scene, backend=backend) * 255) / 255
    colors = np.clip(exact.scene.colors + np.random.default_rng(3).normal(0, 0.02, (4, 3)), 0, 1).astype(
        np.float32
    )
    off = replace(exact, scene=replace(exact.scene, colors=colors))
    target = levels.astype(np.float32)
    fitted = refine_drawing(target, off, Run(backend), replace(QUICK, colors="fitted")).scene
    np.testing.assert_allclose(fitted.colors, exact.scene.colors, atol=0.5 / 255)
    held = refine_drawing(target, off, Run(backend), QUICK).scene
    np.testing.assert_array_equal(held.colors, colors)


def test_of_a_noisy_picture_the_mean_is_taken() -> None:
    made = logo()
    rng = np.random.default_rng(4)
    target = np.clip(np.full((32, 32, 3), 0.5) + rng.normal(0, 0.01, (32, 32, 3)), 0, 1).astype(np.float32)
    scene = replace(made.scene, colors=np.full((4, 3), 0.5, np.float32))
    np.testing.assert_allclose(own_colors(scene, target), 128 / 255, atol=1e-6)


def test_a_picture_without_shapes(device: str) -> None:
    made = logo()
    none = made.scene.take(np.zeros(0, np.intp))
    empty = Drawing(none, np.zeros(0, np.int32), np.zeros(0, np.int32))
    found = refine_drawing(np.ones((64, 64, 3), np.float32), empty, Run(Backend.on(device)))
    assert len(found.scene) == 0


def test_an_opaque_picture_on_a_transparent_canvas(device: str) -> None:
    """The picture counts as opaque; what shines through the seam bounds how near shapes side by side come."""
    backend = Backend.on(device)
    exact = seam()
    scene = replace(exact.scene, canvas=replace(exact.scene.canvas, background=None))
    target = render(exact.scene, backend=backend)
    off = replace(scene, points=seam(spread=0.3).scene.points)
    found = refine_drawing(target, replace(exact, scene=off), Run(backend), QUICK).scene
    whole = np.concatenate([target, np.ones_like(target[..., :1])], axis=2)
    assert psnr(found, whole, backend) > psnr(off, whole, backend) + 3


def test_gradients_are_fitted_and_stay_as_opaque_as_they_are(device: str) -> None:
    backend = Backend.on(device)
    exact = logo()
    ramps = with_gradients(exact.scene)
    target = render(ramps, backend=backend)
    off = replace(ramps, frames=ramps.frames + np.float32(0.7) * (ramps.frames != 0))
    fitted = refine_drawing(target, replace(exact, scene=off), Run(backend), QUICK).scene
    assert psnr(fitted, target, backend) > psnr(replace(off, opacities=fitted.opacities), target, backend)
    np.testing.assert_array_equal(fitted.stop_opacities, ramps.stop_opacities)


@pytest.mark.parametrize("background", [WHITE, None])
def test_tiles_without_outlines_are_left_out(device: str, background: FloatArray | None) -> None:
    """The same steps and figures to the bit, while outlines come into tiles and leave them."""
    made = drawing(
        Canvas(96, 80, background), (RED, [disc(49.0, 40.0, 30.0)]), (BLUE, [disc(55.0, 36.0, 22.0)])
    )
    target = render(replace(made.scene, points=made.scene.points + np.array([7, 3], np.float32)))
    points, errors, still = [], [], []
    for keeps in (False, True):
        step = start(target, made, Backend.on(device, 1), Refinement(point_rate=0.9))
        step.state.parameters.keeps_colors = keeps
        step = Step(step.state, step.settings, step.target)
        figures, states = [], []
        for _ in range(12):
            step.advance()
            figures.append(step.loss_target.mean_square())
            states.append(step.renderer.bins.buffers.tile_cache.numpy().copy())
        step.render()
        assert step.measured_error() == pytest.approx(step.square_error(), rel=1e-5)
        points.append(step.state.scene().points)
        errors.append(figures)
        still.append(states)
    np.testing.assert_array_equal(*points)
    assert errors[0] == errors[1]
    assert not np.any(still[0])
    same = np.stack(still[1]) == constants.CACHED
    assert same[1:].any(axis=1).all(), "where nothing is to be found"
    assert (same[1:-1] != same[2:]).any(), "outlines come and go"
