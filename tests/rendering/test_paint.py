"""Gradients, transparent canvases, and pictures between shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import adjoint, compare, renderer_for
from tests.scenes import disc, mixed_scene, picture_scene, random_scene, with_gradients, with_stops
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import NO_PICTURE, Canvas, KeptPicture, Kind, Paint, Scene, Spread


def transparent(scene: Scene) -> Scene:
    return replace(scene, canvas=Canvas(scene.canvas.width, scene.canvas.height, None))


def spread(paint: Paint, spread: Spread) -> Scene:
    scene = with_gradients(random_scene(Kind.FILL, 3, seed=4), seed=5)
    both = {"paint": paint, "spread": spread}
    return replace(
        scene, **{name: np.where(scene.paint > 0, v, 0).astype(np.int32) for name, v in both.items()}
    )


def out_of_order() -> Scene:
    """A stop that lies before the one before it counts as lying there, and does not move by itself."""
    scene = with_gradients(random_scene(Kind.FILL, 4, seed=6), seed=7)
    offsets = scene.stop_offsets.copy()
    offsets[scene.stop_first[2] : scene.stop_first[3]] = [0.2, 0.7, 0.4]
    return replace(scene, stop_offsets=offsets)


def stops(*offsets: float) -> Scene:
    return with_stops(random_scene(Kind.FILL, 6, seed=10), offsets, seed=11)


# Two ascending stops, padded, from a circle's centre, go a shorter way. Columns of longer chains reach one
# interval, several, or lie beyond either end; two stops may lie in one place.
STOPS = {"ramps": (0.1, 0.8), "chains": (0.15, 0.3, 0.42, 0.5, 0.95), "steps": (0.15, 0.4, 0.4, 0.6, 0.6)}
MIXED = with_gradients(mixed_scene(seed=1))
SCENES: dict[str, tuple[Scene, float]] = {
    "mixed": (MIXED, 1),
    "mixed, enlarged": (MIXED, 1.7),
    "mixed, transparent": (transparent(MIXED), 1),
    "flat, transparent": (transparent(random_scene(Kind.FILL)), 1),
    "stops out of order": (out_of_order(), 1),
    **{f"{p.name}, {s.name}": (spread(p, s), 1) for p in (Paint.LINEAR, Paint.RADIAL) for s in Spread},
    **{name: (stops(*offsets), 1.3) for name, offsets in STOPS.items()},
    **{f"{name}, transparent": (transparent(stops(*offsets)), 1.3) for name, offsets in STOPS.items()},
}


@pytest.mark.parametrize("lanes", [1, 64])
@pytest.mark.parametrize(("scene", "scale"), SCENES.values(), ids=SCENES.keys())
def test_gradients(device: str, scene: Scene, scale: float, lanes: int) -> None:
    compare(scene, device, scale, lanes=lanes)


def test_two_stops_in_one_place_are_a_step(device: str) -> None:
    """Also at either end, where what lies beyond has the outer one's colour."""
    colors = np.eye(3, dtype=np.float32)[[0, 1, 1, 2]]
    scene = replace(
        disc(60, 40, 20),
        paint=np.array([Paint.LINEAR], np.int32),
        frames=np.array([[10, 0, 20, 0, 0, 20]], np.float32),
        stop_first=np.array([0, 4], np.int32),
        stop_offsets=np.array([0, 0, 1, 1], np.float32),
        stop_colors=colors,
        stop_opacities=np.ones(4, np.float32),
    )
    row = renderer_for(scene, device).read_image()[20]
    np.testing.assert_allclose(row[[9, 10, 29, 30]], colors, atol=1e-6)


def test_empty_pixels_are_exactly_zero(device: str) -> None:
    image = renderer_for(transparent(disc(9, 40, 20)), device).read_image()
    assert image.shape == (40, 40, 4)
    assert not image[:8].any()
    np.testing.assert_allclose(image[20, 20], np.ones(4), atol=1e-6)


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
def test_gradients_through_pictures_match_finite_differences(device: str, lanes: int) -> None:
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
