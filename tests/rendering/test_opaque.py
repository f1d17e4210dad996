"""The adjoint for opacities up to 1: that of the others where both hold, and by lanes what it is by tiles."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import relative_error
from tests.scenes import mixed_scene, with_gradients
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import Canvas, Scene

PLAIN = mixed_scene(seed=1)
PAINTED = replace(with_gradients(mixed_scene(seed=2)), canvas=Canvas(40, 36, None))


def gradients(scene: Scene, device: str, *, opaque: bool, lanes: int = 1) -> dict[str, np.ndarray]:
    backend = replace(Backend.on(device), lanes=lanes)
    renderer = Renderer(Parameters(scene, backend), Viewport(40, 36), opaque=opaque)
    renderer.forward_complete()
    weights = np.random.default_rng(0).normal(size=renderer.read_image().shape)
    renderer.write_image_grad(weights.astype(np.float32))
    renderer.backward()
    return renderer.parameters.gradients()


@pytest.mark.parametrize("scene", [PLAIN, PAINTED], ids=["plain", "painted"])
def test_it_is_the_usual_one_of_translucent_shapes(device: str, scene: Scene) -> None:
    usual = gradients(scene, device, opaque=False)
    for name, found in gradients(scene, device, opaque=True).items():
        assert relative_error(found, usual[name]) < 1e-4, name


@pytest.mark.parametrize("scene", [PLAIN, PAINTED], ids=["plain", "painted"])
def test_by_lanes(device: str, scene: Scene) -> None:
    scene = replace(scene, opacities=np.ones_like(scene.opacities))
    by_tiles = gradients(scene, device, opaque=True)
    for name, found in gradients(scene, device, opaque=True, lanes=16).items():
        assert relative_error(found, by_tiles[name]) < 1e-4, name
