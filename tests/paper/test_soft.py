"""The paper's own soft model: image and adjoint against float64; properties."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.helpers import adjoint, relative_error, renderer_for
from tests.paper.helpers import soft_image
from tests.scenes import mixed_scene, random_scene, with_gradients
from warpsplat.paper.models import GaussianModel
from warpsplat.rendering.renderer import render
from warpsplat.scene import Kind, Scene

FILL, STROKE = Kind.FILL, Kind.STROKE
SOFT = GaussianModel()
CASES = [(FILL, 2, 1.0, True), (STROKE, 1, 1.0, True), (STROKE, 4, 1.0, True)]
CASES += [(FILL, 4, 0.6, True), (STROKE, 3, 1.7, True), (FILL, 2, 1.0, False), (STROKE, 3, 1.0, False)]


def faded(scene: Scene, seed: int = 5) -> Scene:
    """With strokes whose thirds differ in opacity."""
    rng = np.random.default_rng(seed)
    fades = np.where(scene.kind[:, None] == STROKE, rng.uniform(-0.35, 0.04, (len(scene), 3)), 0)
    return replace(scene, fades=fades.astype(np.float32))


def compare(scene: Scene, device: str, scale: float, model: GaussianModel, lanes: int | None = None) -> None:
    """Image and all gradients against the reference, for a random gradient of the image."""
    renderer = renderer_for(scene, device, scale, model=model, lanes=lanes)
    p, image = soft_image(scene, renderer, model.softness, detach=not model.through_scales)
    # The cut makes single pixels differ where float32 and float64 decide differently.
    np.testing.assert_allclose(renderer.read_image(), image.detach().numpy(), atol=2e-2)
    assert np.abs(renderer.read_image() - image.detach().numpy()).mean() < 5e-6
    weights = np.random.default_rng(1).normal(size=(*image.shape,))
    (image * torch.tensor(weights)).sum().backward()
    rows = np.flatnonzero(scene.kind == STROKE)
    for name, found in adjoint(renderer, weights.astype(np.float32)).items():
        gradient = p[name].grad
        want = np.zeros(found.shape) if gradient is None else gradient.numpy()
        # Fills have no widths and fades, so that nothing reads those gradients.
        picked = rows if name in ("fades", "widths") else slice(None)
        got, want = found[picked], want[picked]
        assert not want.size or relative_error(got, want) < 2e-3, name


@pytest.mark.parametrize(("kind", "cubics", "scale", "through_scales"), CASES)
def test_image_and_gradients(
    device: str, kind: Kind, cubics: int, scale: float, through_scales: bool
) -> None:
    scene = faded(random_scene(kind, beziers=cubics, seed=3))
    compare(scene, device, scale, GaussianModel(through_scales=through_scales))


@pytest.mark.parametrize("lanes", [1, 64])
def test_fills_and_strokes_of_different_lengths(device: str, lanes: int) -> None:
    compare(faded(mixed_scene(splines=False)), device, 1.0, GaussianModel(0.4, 1.2), lanes)


def test_an_opacity_beyond_its_bounds_is_only_led_back(device: str) -> None:
    scene = random_scene(STROKE, 1, seed=2)
    over = replace(scene, fades=np.array([[1.5, 0, 0]], np.float32))
    renderer = renderer_for(over, device, model=SOFT)
    background = scene.canvas.background
    assert background is not None
    gradients = []
    for sign in (1, -1):
        renderer.forward()
        renderer.write_image_grad(sign * (renderer.read_image() - background))
        renderer.backward()
        gradients.append(renderer.parameters.gradients()["fades"][0])
    shrinks = gradients[0]
    assert (shrinks > 0).all(), "less of the stroke is what the first gradient asks for"
    assert gradients[1][0] == 0, "it cannot be more than opaque"
    np.testing.assert_allclose(gradients[1][1:], -shrinks[1:], rtol=1e-5)


def test_gradients_are_refused(device: str) -> None:
    with pytest.raises(ValueError, match="flat colours, no gradients"):
        renderer_for(with_gradients(random_scene(FILL)), device, model=SOFT)


def test_a_render_at_twice_the_size_is_the_same_picture() -> None:
    scene = faded(random_scene(STROKE, 6, seed=9))
    small, large = (render(scene, scale=s, model=SOFT) for s in (1.0, 2.0))
    height, width = small.shape[:2]
    reduced = large.reshape(height, 2, width, 2, 3).mean(axis=(1, 3))
    assert np.abs(reduced - small).mean() < 4e-3
