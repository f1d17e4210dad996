"""Blending and its adjoint on coverages of our own; what a shape's removal costs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.helpers import SPLAT, adjoint, coverage_images, relative_error, renderer_for
from tests.reference.composite import composite
from tests.reference.curves import tensors
from tests.scenes import mixed_scene, random_scene, with_gradients
from warpsplat.kernels import constants
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.rendering.tiles import to_tiles
from warpsplat.scene import Basis, Canvas, Kind, Scene


@pytest.mark.needs("paper")  # the coverages that it takes as given are those of splats
@pytest.mark.parametrize("opaque", [False, True])
def test_blending_and_adjoint(device: str, opaque: bool) -> None:
    """The image, and the gradients of colours, opacities and coverages."""
    scene = random_scene(Kind.FILL, count=8, seed=5)
    if opaque:
        scene.opacities[:] = 0.996
    renderer = renderer_for(scene, device, model=SPLAT)
    height, width = scene.canvas.height, scene.canvas.width
    covers = [torch.tensor(c[:height, :width].astype(np.float64)) for c in coverage_images(renderer)]
    for c in covers:
        c.requires_grad_()
    p = tensors(scene)
    image = composite(covers, p, scene)
    np.testing.assert_allclose(renderer.read_image(), image.detach().numpy(), atol=2e-4)
    weights = np.random.default_rng(2).normal(size=image.shape)
    (image * torch.tensor(weights)).sum().backward()
    got = adjoint(renderer, weights)
    for name in ("colors", "opacities"):
        gradient = p[name].grad
        assert gradient is not None
        # Behind TRANSMITTANCE_MIN the kernels stop: up to 1e-4 of a weight is missing there.
        assert relative_error(got[name], gradient.numpy()) < (2e-3 if opaque else 2e-5)
    # The gradient of s where the coverage was: d coverage / ds = 1 - coverage.
    bins = renderer.bins.buffers
    shapes, tiles = bins.slot_shape.numpy(), bins.slot_tile.numpy()
    grads = renderer.coverage.buffers.coverage_pixels.numpy()
    compared = 0
    for slot in np.flatnonzero((shapes >= 0) & (bins.slot_state.numpy() == constants.PARTIAL)):
        y, x = divmod(int(tiles[slot]), renderer.viewport.tiles_x)
        cover = covers[shapes[slot]]
        assert cover.grad is not None
        where = (slice(16 * y, 16 * y + 16), slice(16 * x, 16 * x + 16))
        block = (cover.grad * (1 - cover.detach()))[where].numpy()
        mine = grads[slot].reshape(16, 16).T[: block.shape[0], : block.shape[1]]
        # behind / (1 - alpha): what float32 leaves of a difference, magnified 250 times by an opaque shape.
        np.testing.assert_allclose(mine, block, atol=3e-2 if opaque else 2e-4)
        assert np.abs(mine - block).mean() < 1e-4
        compared += 1
    assert compared > 10


PAINTED = with_gradients(random_scene(Kind.FILL, 4, seed=8), seed=9)
SCENES = {
    "fills": random_scene(Kind.FILL, count=9, seed=3),
    "strokes": random_scene(Kind.STROKE, count=9, seed=3),
    "splines": random_scene(Kind.FILL, count=9, seed=3, basis=Basis.SPLINE),
    "mixed": mixed_scene(seed=3),
    "painted": PAINTED,
    "transparent": replace(PAINTED, canvas=Canvas(40, 36, None)),
}


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("scene", SCENES.values(), ids=SCENES.keys())
def test_removal_costs_match_brute_force(device: str, scene: Scene, weighted: bool) -> None:
    """Measured by taking shapes away; of a transparent canvas on black and on white."""
    rng = np.random.default_rng(0)
    renderer = renderer_for(scene, device)
    target = rng.uniform(size=renderer.read_image().shape).astype(np.float32)
    weights = rng.uniform(0, 2, (*target.shape[:2], 1)).astype(np.float32) ** weighted
    aim = renderer.backend.columns_of(to_tiles(target))
    importance = renderer.backend.columns_of(to_tiles(weights)[:, 0]) if weighted else None
    got = renderer.removal_costs(aim, importance)

    def error(shown: Scene) -> float:
        off = (render(shown, backend=Backend.on(device)) - target).astype(np.float64)
        papers = (off[..., :3] - paper * off[..., 3:] for paper in (0, 1))
        return float(np.mean([weights * each**2 for each in (papers if off.shape[2] == 4 else [off])]))

    for i in range(len(scene)):
        without = error(scene.take(np.delete(np.arange(len(scene)), i)))
        assert got[i] == pytest.approx(without - error(scene), rel=1e-3, abs=1e-6)
