"""Outlines fitted: constraints, crossings, and pictures found again."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import BLUE, RED, ROUND, WHITE, disc, drawing, logo, outline, polygon, seam
from warpsplat.alpha import squares
from warpsplat.drawing.constraints import Constraints, Drawing
from warpsplat.drawing.crossings import crossing
from warpsplat.drawing.fit_outlines import OutlineFit
from warpsplat.drawing.tidy import finish_drawing
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.problem import Run
from warpsplat.fit.schedule import Phase
from warpsplat.fit.settings import Density, make_settings
from warpsplat.fit.state import FitState
from warpsplat.fit.step import Step, Target
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas, FloatArray, Scene
from warpsplat.scene.attributes import Joint

LEAN = outline(
    (10, 10), ((20, 8), (30, 12), (40, 14)), ((42, 40),), ((30, 41), (20, 42), (11, 40)), ((10, 10),)
)
"""Cubics that lines direct."""

DRAWINGS = pytest.mark.parametrize(
    "made",
    [
        logo(),
        seam(),
        drawing(Canvas(64, 48, WHITE), (RED, [LEAN]), (BLUE, [polygon((0, 0), (9, 0), (5, 9))])),
    ],
    ids=["logo", "seam", "lean"],
)


@DRAWINGS
def test_points_are_projected(made: Drawing) -> None:
    """What keeps the constraints stays; what is projected keeps them."""
    constraints = Constraints(made)
    exact = constraints.project(made.scene.points.astype(float))
    np.testing.assert_allclose(exact, made.scene.points, atol=1e-4)
    moved = constraints.project(exact + np.random.default_rng(1).normal(0, 0.7, exact.shape))
    assert np.abs(moved - exact).max() > 0.5
    np.testing.assert_allclose(constraints.project(moved), moved, atol=1e-9)


@DRAWINGS
def test_free_numbers_move_points_along_the_constraints(made: Drawing) -> None:
    """To first order; and all motions that the projection leaves are theirs."""
    constraints = Constraints(made)
    at = constraints.project(made.scene.points.astype(float))
    freedom = constraints.freedom(at)
    rng = np.random.default_rng(2)
    way = rng.normal(size=freedom.size)
    off = []
    for step in (1e-2, 1e-3):
        moved = at + step * freedom.times(way).reshape(-1, 2)
        off.append(np.abs(constraints.project(moved) - moved).max())
    assert off[1] < 0.02 * off[0] or off[1] < 1e-12
    matrix = np.stack([freedom.times(row) for row in np.eye(freedom.size)], axis=1)
    for _ in range(5):
        shift = 1e-6 * rng.normal(size=at.shape)
        shift[np.minimum(at, np.array([made.scene.canvas.width, made.scene.canvas.height]) - at) < 1e-3] = 0
        change = (constraints.project(at + shift) - at).ravel() / 1e-6
        found = np.linalg.lstsq(matrix, change, rcond=None)[0]
        np.testing.assert_allclose(matrix @ found, change, atol=1e-4)
    ways = rng.normal(size=(2, freedom.size))
    np.testing.assert_allclose(freedom.times(ways[0]) @ ways[1], freedom.adjoint(ways[1]) @ ways[0])


def test_held_points_stay() -> None:
    made = logo()
    every = np.arange(len(made.joints))
    held = every % 6 == 0
    constraints = Constraints(made, held)
    at = made.scene.points.astype(float)
    freedom = constraints.freedom(at)
    change = freedom.times(np.random.default_rng(0).normal(size=freedom.size)).reshape(-1, 2)
    assert not change[held].any()
    assert (change[every % 6 == 3] != 0).any(axis=1).all()


CANVAS = Canvas(64, 48, WHITE)


def crosses(made: Drawing) -> list[bool]:
    return crossing(made.cubics(), made.following(), made.contour()).tolist()


def test_crossings_are_found_within_contours_only() -> None:
    bow = polygon((30, 5), (50, 25), (50, 5), (30, 25))
    square, across = polygon((5, 5), (15, 5), (15, 15), (5, 15)), polygon((10, 10), (20, 10), (20, 20))
    made = drawing(CANVAS, (RED, [bow, square, across, disc(40, 36, 8)]))
    assert crosses(made) == [True, False, True] + [False] * 12
    points = np.array([(10, 30), (40, 5), (0, 5), (30, 30), (28, 34), (12, 34)], float)
    assert crosses(drawing(CANVAS, (RED, [(points, ROUND * 2)]))) == [True, False], "a cubic with itself"


@pytest.mark.parametrize("seed", range(2))
def test_fits_of_noise_do_not_cross(seed: int) -> None:
    """Small regions of all shapes: their outlines have nothing to hold on to."""
    rng = np.random.default_rng(seed)
    colors = rng.uniform(0, 1, (4, 3)).astype(np.float32)
    image = colors[rng.integers(0, 4, (12, 12)).repeat(3, 0).repeat(3, 1)]
    traced = trace(image)
    made = Drawing(traced.scene, traced.joints)
    at_first, run = sum(crosses(made)), Run(Backend.on("cpu"))
    fit = OutlineFit(image, made, run)
    fit.advance(run, 16, 4)
    fit.roam(run, 40)
    assert sum(crosses(fit.drawing)) <= at_first


def psnr(scene: Scene, target: FloatArray, backend: Backend) -> float:
    error = squares(render(scene, backend=backend) - target).mean(dtype=float) / 3
    return float(-10 * np.log10(error + 1e-12))


def assert_clean(made: Drawing, scene: Scene) -> None:
    """Lines, smooth joints, ties and borders of ``made`` hold in ``scene``."""
    points = scene.points.astype(float)
    on, following = np.arange(0, len(points), 3), 3 * made.following()
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
    of_lines = (np.repeat(lines, 3).reshape(-1, 3) & [False, True, True]).ravel()
    size = np.array([scene.canvas.width, scene.canvas.height])
    for axis in (0, 1):
        for edge in (0, size[axis]):
            here = made.scene.points[:, axis] == edge
            assert (scene.points[here & ~of_lines, axis] == edge).all()


def fitted(target: FloatArray, made: Drawing, backend: Backend, steps: int = 20) -> Scene:
    run = Run(backend)
    fit = OutlineFit(target, made, run)
    fit.advance(run, steps)
    return fit.drawing.scene


@pytest.mark.parametrize("background", [WHITE, None], ids=["opaque", "transparent"])
def test_a_logo_is_found_again(device: str, background: FloatArray | None) -> None:
    backend = Backend.on(device)
    exact = logo(background)
    target = render(exact.scene, backend=backend)
    off = logo(background, spread=0.5)
    scene = fitted(target, off, backend)
    assert psnr(off.scene, target, backend) < 27
    assert psnr(scene, target, backend) > 45
    assert_clean(off, scene)
    assert psnr(fitted(target, exact, backend), target, backend) > 70, "what is exact stays"
    np.testing.assert_array_equal(scene.opacities, 1)
    np.testing.assert_array_equal(scene.colors, exact.scene.colors)


def test_seams_stay_closed(device: str) -> None:
    backend = Backend.on(device)
    target = render(seam().scene, backend=backend)
    off = seam(spread=0.5)
    scene = fitted(target, off, backend)
    assert psnr(scene, target, backend) > psnr(off.scene, target, backend) + 10
    assert_clean(off, scene)


def test_a_picture_without_shapes(device: str) -> None:
    made = logo()
    none = made.scene.take(np.zeros(0, np.intp))
    empty = Drawing(none, np.zeros(0, np.int32))
    found = finish_drawing(np.ones((64, 64, 3), np.float32), empty, Run(Backend.on(device)))
    assert len(found.drawing.scene) == 0


def test_an_opaque_picture_on_a_transparent_canvas(device: str) -> None:
    """The picture counts as opaque; what shines through the seam bounds how near shapes side by side come."""
    backend = Backend.on(device)
    exact = seam()
    scene = replace(exact.scene, canvas=replace(exact.scene.canvas, background=None))
    target = render(exact.scene, backend=backend)
    off = replace(scene, points=seam(spread=0.3).scene.points)
    found = fitted(target, replace(exact, scene=off), backend)
    whole = np.concatenate([target, np.ones_like(target[..., :1])], axis=2)
    assert psnr(found, whole, backend) > psnr(off, whole, backend) + 3


@pytest.mark.parametrize("background", [WHITE, None])
def test_tiles_without_outlines_are_left_out(device: str, background: FloatArray | None) -> None:
    """The same steps and figures to the bit, while outlines come into tiles and leave them."""
    made = drawing(
        Canvas(96, 80, background), (RED, [disc(49.0, 40.0, 30.0)]), (BLUE, [disc(55.0, 36.0, 22.0)])
    )
    target = render(replace(made.scene, points=made.scene.points + np.array([7, 3], np.float32)))
    points, errors = [], []
    for keeps in (False, True):
        state = FitState.start(made.scene, Backend.on(device, 1), np.random.default_rng(0))
        state.parameters.keeps_colors = keeps
        for name in ("colors", "opacities"):
            state.parameters.hold(name, np.ones(len(made.scene), np.bool_))
        settings = make_settings(texture=0.0, bending=0.0, rates={"points": 0.9, "colors": 0.0})
        settings = replace(settings, coarse=0.0, density=Density(interval=0))
        step = Step(state, settings, Target(target, Phase(96, 80, slack=1.0)))
        errors.append([])
        for _ in range(12):
            step.advance()
            errors[-1].append(step.loss_target.mean_square())
        assert keeps == bool(np.any(step.renderer.bins.buffers.tile_cache.numpy()))
        step.render()
        assert step.measured_error() == pytest.approx(step.objective.square_error(), rel=1e-5)
        points.append(step.state.scene().points)
    np.testing.assert_array_equal(*points)
    assert errors[0] == errors[1]


def test_level_edges_pass_small_minima(device: str) -> None:
    """The row and the column beside an edge have a trace of its colour, as JPEG leaves it."""
    backend = Backend.on(device)

    def box(low: float) -> Drawing:
        corners = polygon((low, low), (48 - low, low), (48 - low, 48 - low), (low, 48 - low))
        return drawing(Canvas(48, 48, WHITE), (BLUE, [corners]))

    target = render(box(10.3).scene, backend=backend)
    target[9:39, 9:39][[0, -1]] = target[9:39, 9:39][:, [0, -1]] = 0.9 + 0.1 * np.array(BLUE)
    fit = OutlineFit(target, box(9.6), Run(backend))
    fit.advance(Run(backend), 12, far=4)
    np.testing.assert_allclose(fit.points[::3], box(10.3).scene.points[::3], atol=0.05)
