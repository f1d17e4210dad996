"""Where the image has outlines, and what moving them costs, against renders."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import BLUE, GOLD, WHITE, disc, drawing, logo, polygon
from warpsplat.drawing.constraints import Constraints, Drawing, with_ends
from warpsplat.drawing.fit_outlines import OutlineFit, matching
from warpsplat.drawing.model import errors
from warpsplat.drawing.solve import Equations, newton_step
from warpsplat.fit.problem import Run
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas, FloatArray


def moved(made: Drawing, offset: tuple[float, float]) -> Drawing:
    points = made.scene.points + np.array(offset, np.float32)
    return replace(made, scene=replace(made.scene, points=points))


@pytest.mark.parametrize("background", [WHITE, None], ids=["opaque", "transparent"])
def test_measured_places_and_errors_match_a_known_shift(device: str, background: FloatArray | None) -> None:
    """And what moving them costs: the error of the samples is that of the render."""
    exact = drawing(
        Canvas(64, 64, background),
        (BLUE, [disc(32, 32, 20, 0.2)]),
        (GOLD, [polygon((24, 24), (42, 27), (30, 40))]),
    )
    backend = Backend.on(device, 1)
    target = matching(render(exact.scene, backend=backend), exact.scene.canvas)
    offset = (0.3, -0.2)
    fit = OutlineFit(target, moved(exact, offset), Run(backend))
    found = fit.places()
    at = fit.drawing.cubics()[found.cubic]
    off = (found.across * -np.array(offset)).sum(axis=1)
    t = found.t[:, None]
    s = 1 - t
    here = s**3 * at[:, 0] + 3 * s * s * t * at[:, 1] + 3 * s * t * t * at[:, 2] + t**3 * at[:, 3]
    got = ((found.place - here) * found.across).sum(axis=1)
    shares = found.weight / found.weight.sum()
    assert (shares * (got - off) ** 2).sum() < 0.1 * (shares * off**2).sum()
    total = errors(found, fit.drawing.cubics()).sum()
    assert total == pytest.approx(fit.error, rel=0.25)


def test_the_gradient_matches_finite_differences(device: str) -> None:
    """Against central differences along free numbers."""
    backend = Backend.on(device, 1)
    exact = logo()
    target = render(exact.scene, backend=backend)
    fit = OutlineFit(target, moved(exact, (0.25, 0.15)), Run(backend))
    freedom = Constraints(exact).freedom(fit.points)
    fit._measure.error(fit.points)
    gradient = freedom.adjoint(fit._measure.gradient())
    rng = np.random.default_rng(0)
    for _ in range(3):
        way = rng.normal(size=freedom.size)
        shift = 2e-3 * freedom.times(way).reshape(-1, 2)
        ends = [fit._measure.error(fit.points + sign * shift)[0] for sign in (1, -1)]
        assert (ends[0] - ends[1]) / 4e-3 == pytest.approx(gradient @ way, rel=0.05, abs=2e-6)


def test_a_newton_step_matches_dense_normal_equations() -> None:
    """Against dense ones in float64."""
    made, rng = logo(), np.random.default_rng(1)
    fit = OutlineFit(render(made.scene), moved(made, (0.2, 0.1)), Run(Backend.on("cpu", 1)))
    samples, following = fit.places(), made.following()
    points = fit.points

    def gradient_at(points: np.ndarray) -> np.ndarray:
        return Equations(samples, with_ends(points, following), following).gradient

    def error_and_gradient(points: np.ndarray) -> tuple[float, np.ndarray]:
        cubics = with_ends(points, following)
        return float(errors(samples, cubics).sum()), gradient_at(points)

    gradient = error_and_gradient(points)[1]
    change, h = rng.normal(size=points.size), 1e-4
    ends = [error_and_gradient(points + sign * h * change.reshape(-1, 2)) for sign in (1, -1)]
    assert (ends[0][0] - ends[1][0]) / (2 * h) == pytest.approx(gradient @ change, rel=1e-5)
    freedom = Constraints(made).freedom(points)
    damping, least = np.full(len(following), 0.1), 1e-7
    equations = Equations(samples, with_ends(points, following), following)
    found = newton_step(equations, freedom, gradient, damping, least)
    # The gradient is linear in the points: its differences are the curvature.
    flat = np.zeros_like(points)
    steps = np.eye(points.size).reshape(-1, *points.shape)
    full = np.stack([gradient_at(step) for step in steps])
    full -= gradient_at(flat)
    own = np.zeros((len(following), 4))
    t, weight = samples.t, 2 * damping[samples.cubic] * samples.weight
    shares = np.stack([(1 - t) ** 3, 3 * (1 - t) ** 2 * t, 3 * (1 - t) * t**2, t**3], axis=1)
    np.add.at(own, samples.cubic, weight[:, None] * shares**2)
    stiff = own[:, :3].copy()
    stiff[following, 0] += own[:, 3]
    wide = np.stack([freedom.times(row) for row in np.eye(freedom.size)], axis=1)
    squared = freedom.value**2 * np.repeat(stiff.ravel(), 2)[freedom.row]
    added = np.bincount(freedom.column, squared, freedom.size)
    matrix = wide.T @ full @ wide + np.diag(added + least)
    want = np.linalg.solve(matrix, -freedom.adjoint(gradient))
    assert np.linalg.norm(wide @ (found - want)) < 0.05 * np.linalg.norm(wide @ want)
