"""The whole renderer, forward and adjoint, against the float64 reference and torch autograd."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from tests.kernels.helpers import reference_image, relative_error, renderer_for
from tests.scenes import random_scene
from warpsplat.kernels.tile import column
from warpsplat.parameters import Parameters
from warpsplat.render import make_renderer
from warpsplat.scene import Kind
from warpsplat.tiles import to_tiles

CASES = [
    ("closed", 1, 1, 1.0),
    ("closed", 2, 1, 1.0),
    ("closed", 2, 1, 0.6),
    ("open", 1, 1, 1.0),
    ("open", 2, 1, 1.0),
    ("open", 3, 1, 1.0),
    ("open", 3, 3, 1.7),
    ("open", 4, 1, 1.0),
    ("open", 5, 1, 1.0),
    ("open", 6, 3, 1.0),
]
"""Kind, cubics of a stroke or of a chain of an outline, opacities, scale."""


@pytest.mark.parametrize(("kind", "cubics", "opacity_count", "scale"), CASES)
@pytest.mark.parametrize("detach", [False, True])
def test_image_and_gradients(
    device: str, kind: Kind, cubics: int, opacity_count: int, scale: float, detach: bool
) -> None:
    scene = random_scene(kind, chain_cubics=cubics, stroke_cubics=cubics, opacity_count=opacity_count, seed=3)
    renderer = renderer_for(scene, device, scale, through_scales=not detach)
    p, image = reference_image(scene, renderer, detach)
    np.testing.assert_allclose(renderer.read_image(), image.detach().numpy(), atol=2e-3)
    # The cut at Q_MAX makes single pixels differ where float32 and float64 decide differently.
    assert np.abs(renderer.read_image() - image.detach().numpy()).mean() < 2e-6

    weights = np.random.default_rng(1).normal(size=(*image.shape,))
    (image * torch.tensor(weights)).sum().backward()
    renderer.write_image_grad(weights.astype(np.float32))
    renderer.backward()
    got = renderer.parameters.gradients()
    for name in ("points", "colors", "opacities") + (("widths",) if kind == "open" else ()):
        gradient = p[name].grad
        assert gradient is not None
        assert relative_error(got[name], gradient.numpy()) < 1e-3, name


@pytest.mark.parametrize("kind", ["closed", "open"])
@pytest.mark.parametrize("name", ["exact", "splat"])
def test_sixteen_lanes_do_what_one_does(
    device: str, kind: Kind, name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The division of a tile among a GPU's threads, on any device."""
    scene = random_scene(kind, count=30, width=90, height=70, seed=4)
    scene = replace(scene, points=(1.5 * scene.points).astype(np.float32))
    weights = np.random.default_rng(0).normal(size=(70, 90, 3)).astype(np.float32)
    target = wp.array(to_tiles(np.abs(weights)), dtype=column, device=device)
    outcomes = []
    for lanes in (1, 16):
        monkeypatch.setattr("warpsplat.render.lanes_on", lambda _, lanes=lanes: lanes)
        renderer = make_renderer(name, Parameters(scene, wp.get_device(device)), 90, 70, 1.0)
        renderer.forward_complete()
        costs = renderer.removal_costs(target)
        renderer.write_image_grad(weights)
        renderer.backward()
        outcomes.append([renderer.read_image(), costs, *renderer.parameters.gradients().values()])
    for one, many in zip(*outcomes, strict=True):
        assert relative_error(many, one) < 2e-5
