"""Scenes of shapes of different kinds, bases and lengths: image and adjoint, for both models of coverage."""

from __future__ import annotations

import numpy as np
import pytest

from tests.helpers import SPLAT, adjoint, compare, renderer_for
from tests.scenes import MIXED_CUBICS, Outline, mixed_scene, ragged_scene
from warpsplat.rendering.models import EXACT, Model
from warpsplat.scene import Basis, Kind, Scene

CUBIC, SPLINE = Basis.CUBIC, Basis.SPLINE
ODD: dict[str, list[Outline]] = {
    "fills": [(Kind.FILL, CUBIC, n) for n in (1, 3, 2, 5, 4)],
    "strokes": [(Kind.STROKE, CUBIC, n) for n in (4, 1, 3, 2, 5)],
    "mixed": [*MIXED_CUBICS, (Kind.FILL, CUBIC, 1), (Kind.STROKE, CUBIC, 4), (Kind.FILL, CUBIC, 3)],
    "splined fills": [(Kind.FILL, SPLINE, n) for n in (5, 3, 12, 4, 8)],
    "splined strokes": [(Kind.STROKE, SPLINE, n) for n in (4, 1, 9, 2, 3)],
    "both bases": [
        (kind, basis, n)
        for n in (3, 4)
        for kind, basis in (
            (Kind.STROKE, SPLINE),
            (Kind.FILL, CUBIC),
            (Kind.FILL, SPLINE),
            (Kind.STROKE, CUBIC),
        )
    ],
}


def scene_for(model: Model, width: int = 40, height: int = 36, *, seed: int) -> Scene:
    """Mixed as far as the model can show it."""
    return mixed_scene(width, height, seed=seed, splines=model is EXACT)


@pytest.mark.parametrize("seed", [0, 2])
def test_exact(device: str, seed: int) -> None:
    compare(mixed_scene(seed=seed), device)


@pytest.mark.slow
@pytest.mark.parametrize("shapes", ODD.values(), ids=ODD.keys())
@pytest.mark.parametrize("scale", [1.0, 1.6])
def test_exact_of_any_lengths(device: str, shapes: list[Outline], scale: float) -> None:
    compare(ragged_scene(shapes, seed=1), device, scale)


@pytest.mark.parametrize("model", [EXACT, SPLAT], ids=["exact", "splat"])
def test_depth_is_the_order_of_rows_whatever_the_kind(device: str, model: Model) -> None:
    """Turned round, the scene is another picture, and the right one."""
    scene = scene_for(model, seed=3)
    turned = scene.take(np.arange(len(scene))[::-1])
    a, b = (renderer_for(s, device, model=model).read_image() for s in (scene, turned))
    assert np.abs(a - b).max() > 0.1
    compare(turned, device, model=model)


@pytest.mark.parametrize("model", [EXACT, SPLAT], ids=["exact", "splat"])
def test_a_shape_alone_and_in_company_is_the_same(device: str, model: Model) -> None:
    """The gradient of a shape that nothing overlaps does not depend on what else is in the arrays."""
    scene = scene_for(model, 250, 40, seed=4)
    for i in range(len(scene)):
        points = scene.points_of(i)
        points += np.array([25 * i + 12, 20], np.float32) - points.mean(axis=0)
        points[:, 0] = np.clip(points[:, 0], 25 * i + 5, 25 * i + 20)
    weights = np.random.default_rng(0).normal(size=(40, 250, 3)).astype(np.float32)
    whole = renderer_for(scene, device, model=model)
    together = adjoint(whole, weights)
    for i in range(len(scene)):
        one = renderer_for(scene.take(np.array([i])), device, model=model)
        alone = adjoint(one, weights)
        np.testing.assert_allclose(
            together["points"][scene.first[i] : scene.first[i + 1]], alone["points"], atol=1e-4
        )
        for name in ("colors", "opacities", "widths"):
            np.testing.assert_allclose(together[name][i], alone[name][0], rtol=1e-4, atol=1e-4)
