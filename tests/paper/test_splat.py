"""Splats: image and adjoint against float64, tile lists, the fold loss, and how rows are placed."""

from __future__ import annotations

import hashlib
import math
from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from tests.helpers import (
    SPLAT,
    adjoint,
    compare,
    relative_error,
    renderer_for,
)
from tests.kernels.test_elementary import run
from tests.paper.helpers import grid_of, plans_of
from tests.paper.reference.grid import fold_area, grids
from tests.reference.curves import tensors
from tests.scenes import disc, mixed_scene, points_by_shape, random_scene, with_points
from warpsplat.kernels import constants
from warpsplat.metrics import psnr
from warpsplat.paper.constants import COUNT_MAX, PLATEAU
from warpsplat.paper.kernels.strips import bounded_product, normal_quantile, normal_tail
from warpsplat.paper.models import SplatModel
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, Kind, Scene
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg

FILL, STROKE = Kind.FILL, Kind.STROKE
CASES = [(FILL, n, 1.0) for n in (2, 4, 6)] + [(STROKE, n, 1.0) for n in (1, 2, 3, 4, 5)]
CASES += [(FILL, 4, 0.6), (STROKE, 3, 1.7)]


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "cubics", "scale"), CASES)
@pytest.mark.parametrize("through_scales", [True, False])
def test_image_and_gradients(
    device: str, kind: Kind, cubics: int, scale: float, through_scales: bool
) -> None:
    compare(
        random_scene(kind, beziers=cubics, seed=3),
        device,
        scale,
        model=SplatModel(through_scales=through_scales),
    )


FILL_OF_FOUR = random_scene(FILL, 1, beziers=4)
REFUSED = {
    "odd number of cubics": random_scene(FILL, beziers=3),
    "shape 0 has several contours": replace(  # though all of its points would make two chains
        FILL_OF_FOUR, starts=np.array([0, 6, 12], np.int32), closed=np.ones(2, np.int32)
    ),
    "shape 4 is a spline, not cubics": random_scene(FILL).append(
        random_scene(STROKE, count=1, basis=Basis.SPLINE)
    ),
}


@pytest.mark.parametrize("message", REFUSED)
def test_fills_without_two_chains_are_refused(device: str, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        renderer_for(REFUSED[message], device, model=SPLAT)


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize("through_scales", [True, False])
def test_mixed_scenes(device: str, seed: int, through_scales: bool) -> None:
    compare(mixed_scene(seed=seed, splines=False), device, model=SplatModel(through_scales=through_scales))


@pytest.mark.parametrize("kind", list(Kind))
def test_the_file_looks_as_the_render(device: str, kind: Kind) -> None:
    """The contrast is strong: a splat's plateau is a little below its opacity."""
    scene = random_scene(kind, count=10, width=96, height=80, seed=3)
    shown = on_white(render_svg(write_svg(scene, opacity_scale=PLATEAU)))
    mine = render(scene, model=SPLAT, backend=Backend.on(device)).astype(np.float64) * 255
    assert psnr(mine, shown) > 30


def folded_scene() -> Scene:
    """Random blobs, the side of each pushed in past the opposite one."""
    scene = random_scene(Kind.FILL, seed=5)
    points = points_by_shape(scene)
    middle = points.mean(axis=1)
    points[:, 2:4] = 2 * middle[:, None] - points[:, 2:4]
    return replace(scene, points=with_points(scene, points))


def test_gradient(device: str) -> None:
    """Folded fills between strokes, which may fold."""
    scene = folded_scene().append(random_scene(Kind.STROKE, 2)).append(folded_scene())
    weight = 3.0
    renderer = renderer_for(scene, device, model=SplatModel(fold=weight))
    p = tensors(scene)
    signs = grid_of(renderer).shape_grid.numpy()["sign"]
    assert not signs[scene.kind == Kind.STROKE].any()
    areas = [
        fold_area(grid, float(sign))
        for grid, sign in zip(grids(scene, p, plans_of(renderer), 1.0), signs, strict=True)
    ]
    total = torch.stack(areas).sum()
    assert float(total.detach()) > 10
    (weight * total / (scene.canvas.width * scene.canvas.height)).backward()
    assert p["points"].grad is not None
    renderer.backward()
    assert relative_error(renderer.parameters.gradients()["points"], p["points"].grad.numpy()) < 1e-4


def test_orientation_does_not_matter_and_a_disc_has_no_fold(device: str) -> None:
    scene = disc(12, 40, 20)
    mirrored = replace(scene, points=np.ascontiguousarray(scene.points[..., ::-1]))
    for s, sign in ((scene, 1.0), (mirrored, -1.0)):
        renderer = renderer_for(s, device, model=SplatModel(fold=1.0))
        assert grid_of(renderer).shape_grid.numpy()["sign"][0] == sign
        renderer.backward()
        assert not renderer.parameters.gradients()["points"].any()


@pytest.mark.parametrize("kind", list(Kind))
def test_degenerate_shapes_do_no_harm(device: str, kind: Kind) -> None:
    """All points equal, two ends equal, straight lines: finite image, finite gradients."""
    scene = random_scene(kind, count=3)
    points = points_by_shape(scene)
    points[0] = points[0, 0]
    points[1, 1:4] = points[1, 0]
    points[2, :, 1] = 7.0
    broken = replace(scene, points=with_points(scene, points))
    renderer = renderer_for(broken, device, model=SplatModel(fold=1.0))
    assert np.isfinite(renderer.read_image()).all()
    for name, gradient in adjoint(renderer, np.float32([1, -1, 0.5])).items():
        assert np.isfinite(gradient).all(), name


wp.set_module_options(constants.MODULE_OPTIONS)  # others would need their own precompiled headers

TAILS = (np.linspace(3e-4, 0.7, 500) ** 2).astype(np.float32)
DEVIATIONS = np.linspace(0, 5.4, 1000).astype(np.float32)


@wp.kernel
def normal_tails(x: wp.array[wp.float32], out: wp.array[wp.float32]):  # type: ignore[no-untyped-def]
    i = wp.tid()
    out[i] = normal_tail(x[i])  # type: ignore[index]


@wp.kernel
def normal_quantiles(x: wp.array[wp.float32], out: wp.array[wp.float32]):  # type: ignore[no-untyped-def]
    i = wp.tid()
    out[i] = normal_quantile(x[i])  # type: ignore[index]


def digest(values: np.ndarray) -> str:
    return hashlib.sha256(values.astype("<f4").tobytes()).hexdigest()[:16]


def test_the_normal_distribution() -> None:
    made = run(normal_tails, DEVIATIONS, "cpu")
    exact = np.array([0.5 * math.erfc(z / math.sqrt(2)) for z in DEVIATIONS.astype(np.float64)])
    assert np.abs(made - exact).max() < 2e-7
    assert np.abs(made / exact - 1).max() < 4e-6
    assert (np.diff(made) <= 1e-7).all()
    assert digest(made) == "37eedcb99077d630"


def test_quantiles_are_the_inverse() -> None:
    quantiles = run(normal_quantiles, TAILS, "cpu")
    back = run(normal_tails, quantiles.astype(np.float32), "cpu")
    assert np.abs(back / TAILS - 1).max() < 1e-5
    assert digest(quantiles) == "88120ddf5e997572"


def test_counts_do_not_wrap() -> None:
    pairs = [(3, 4), (2**20, 2**20), (2**31 - 1, 2**31 - 1), (-(2**31), 5), (0, 9)]
    assert [bounded_product(a, b) for a, b in pairs] == [12, COUNT_MAX, COUNT_MAX, 0, 0]
