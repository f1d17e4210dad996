"""Pictures between shapes: composited as a viewer composites them, and what is below or above learns so."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import adjoint, renderer_for
from tests.scenes import picture_scene, random_scene
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import NO_PICTURE, Canvas, KeptPicture, Kind, Scene


def shown(height: int, width: int, seed: int = 0) -> KeptPicture:
    """Opaque in the middle, thinner towards its edges, empty at them."""
    rng = np.random.default_rng(seed)
    y, x = (np.abs(np.linspace(-1, 1, n)) for n in (height, width))
    opacity = np.clip(2 - 2 * np.maximum(y[:, None], x), 0, 1)[..., None]
    pixels = np.concatenate([opacity * rng.random((height, width, 3)), opacity], axis=2)
    return KeptPicture("<g/>", (1, 1), (7, 9), pixels.astype(np.float32))


def between(below: Scene, above: Scene, picture: KeptPicture) -> Scene:
    """The picture on a rectangle between two scenes."""
    return below.append(picture_scene(below.canvas, picture)).append(above)


@pytest.mark.parametrize("clear", [False, True])
@pytest.mark.parametrize("lanes", [1, 64])
def test_a_picture_lies_over_what_is_below(device: str, lanes: int, clear: bool) -> None:
    below = random_scene(Kind.FILL, 5, 60, 50, seed=1)
    if clear:
        below = replace(below, canvas=Canvas(60, 50, None))
    above = random_scene(Kind.FILL, 0, 60, 50)
    picture = shown(30, 41)
    image = renderer_for(between(below, above, picture), device, lanes=lanes).read_image()
    expected = render(below, backend=Backend.on(device)).copy()
    place = expected[7:37, 9:50]
    channels = expected.shape[2]
    place[:] = picture.pixels[..., :channels] + (1 - picture.pixels[..., 3:]) * place
    np.testing.assert_allclose(image, expected, atol=1e-5)


@pytest.mark.parametrize("lanes", [1, 64])
def test_gradients_see_it(device: str, lanes: int) -> None:
    """Those of shapes on either side are those of the composite; the picture has none."""
    below, above = random_scene(Kind.FILL, 3, 60, 50, seed=1), random_scene(Kind.FILL, 3, 60, 50, seed=2)
    scene = between(below, above, shown(30, 41))
    assert scene.picture.tolist() == 3 * [NO_PICTURE] + [0] + 3 * [NO_PICTURE]
    weights = np.random.default_rng(5).normal(size=(50, 60, 3)).astype(np.float32)

    def value(scene: Scene) -> float:
        return float((renderer_for(scene, device, lanes=lanes).read_image() * weights).sum(dtype=np.float64))

    renderer = renderer_for(scene, device, lanes=lanes)
    gradients = adjoint(renderer, weights)
    assert np.isfinite(gradients["points"]).all()
    np.testing.assert_array_equal(gradients["colors"][3], 0)
    for name, row in (("colors", (1, 0)), ("colors", (5, 2)), ("opacities", (0,)), ("opacities", (4,))):
        ends = []
        for step in (0.02, -0.02):
            moved = getattr(scene, name).copy()
            moved[row] += step
            ends.append(value(replace(scene, **{name: moved})))
        assert gradients[name][row] == pytest.approx((ends[0] - ends[1]) / 0.04, rel=0.01, abs=0.01)


def test_reduced_pictures_are_averages(device: str) -> None:
    """At half the size, of an even place, each pixel is the mean of four."""
    picture = replace(shown(30, 40), corner=(8, 10))
    nothing = random_scene(Kind.FILL, 0, 60, 50)
    scene = between(nothing, nothing, picture)
    whole = render(scene, backend=Backend.on(device))
    half = render(scene, scale=0.5, backend=Backend.on(device))
    np.testing.assert_allclose(half, whole.reshape(25, 2, 30, 2, 3).mean(axis=(1, 3)), atol=2e-3)
