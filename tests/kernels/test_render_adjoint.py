"""The whole renderer, forward and adjoint, against the float64 reference and torch autograd."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tests.kernels.helpers import reference_image, relative_error, renderer_for
from tests.scenes import random_scene
from warpsplat.scene import Kind

CASES = [
    ("closed", 1, 1, 1.0),
    ("closed", 2, 1, 1.0),
    ("closed", 2, 1, 0.6),
    ("open", 2, 1, 1.0),
    ("open", 2, 3, 1.7),
]


@pytest.mark.parametrize(("kind", "chain_cubics", "opacity_count", "scale"), CASES)
@pytest.mark.parametrize("detach", [False, True])
def test_image_and_gradients(
    device: str, kind: Kind, chain_cubics: int, opacity_count: int, scale: float, detach: bool
) -> None:
    scene = random_scene(kind, chain_cubics=chain_cubics, opacity_count=opacity_count, seed=3)
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
