from __future__ import annotations

import numpy as np
import pytest
import torch
import warp as wp

from tests.helpers import relative_error, run
from tests.reference import losses
from tests.scenes import disc, mixed_scene, random_scene
from warpsplat.kernels.loss import shape as kernels
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Parameters
from warpsplat.scene import Basis, Kind, Scene

SCENES = ["fills", "strokes", "splined fills", "splined strokes", "mixed"]


def scene_of(name: str) -> Scene:
    if name == "mixed":
        return mixed_scene(seed=6)
    kind = Kind.FILL if name.endswith("fills") else Kind.STROKE
    return random_scene(kind, count=6, seed=6, basis=Basis.SPLINE if "splined" in name else Basis.CUBIC)


def launch(kernel: wp.Kernel, scene: Scene, device: str, weight: float) -> tuple[np.ndarray, np.ndarray]:
    """(gradient of the points, loss of each shape)."""
    parameters = Parameters(scene, Backend.on(device))
    each = wp.zeros(len(scene), dtype=float, device=device)
    run(kernel, len(scene), device, parameters.arrays, weight=weight, contour_loss=each)
    return parameters.gradients()["points"], each.numpy()


@pytest.mark.parametrize("name", SCENES)
def test_bending(device: str, name: str) -> None:
    scene = scene_of(name)
    scene.points[: scene.first[1]] = scene.points[0]
    got, each = launch(kernels.bending_backward, scene, device, 0.7)
    x = torch.tensor(scene.points, dtype=torch.float64, requires_grad=True)
    energy = losses.bending(scene, x)
    (0.7 * energy.sum()).backward()
    parts = np.split(energy.detach().numpy(), np.cumsum(scene.bezier_counts())[:-1])
    np.testing.assert_allclose(each, [part.sum() for part in parts], rtol=1e-4, atol=1e-9)
    assert x.grad is not None
    assert relative_error(got, x.grad.numpy()) < 1e-4


@pytest.mark.parametrize("name", ["fills", "strokes", "mixed"])
def test_xing(device: str, name: str) -> None:
    scene = scene_of(name)
    scene.points[:] += np.random.default_rng(0).normal(0, 6, scene.points.shape).astype(np.float32)
    got, each = launch(kernels.xing_backward, scene, device, 0.7)
    points = torch.tensor(scene.points, dtype=torch.float64, requires_grad=True)
    value = losses.xing(scene, points)
    assert float(value.detach()) > 0.05
    (0.7 * value).backward()
    count = (scene.bezier_counts()).sum()
    assert each.sum() / count == pytest.approx(float(value.detach()), rel=1e-4)
    assert points.grad is not None
    assert relative_error(got, points.grad.numpy()) < 1e-4


def thrown(kind: Kind) -> Scene:
    scene = random_scene(kind, count=20, seed=6, basis=Basis.SPLINE)
    scene.points[:] += np.random.default_rng(0).normal(0, 6, scene.points.shape).astype(np.float32)
    return scene


@pytest.mark.parametrize(
    "scene", [*map(thrown, Kind), disc(10, 30, 15)], ids=[*(k.name for k in Kind), "disc"]
)
def test_neither_quadratics_nor_convex_outlines_cross_themselves(device: str, scene: Scene) -> None:
    """Wherever the points of quadratics lie."""
    assert float(losses.xing(scene, torch.tensor(scene.points, dtype=torch.float64))) < 1e-12
    got, each = launch(kernels.xing_backward, scene, device, 1.0)
    assert not each.any()
    assert not got.any()
