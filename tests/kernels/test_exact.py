"""Exact coverage: image and adjoint against float64, the truth by supersampling, and odd shapes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
import torch
import warp as wp

from tests import reference, reference_exact
from tests.kernels.helpers import relative_error
from tests.scenes import disc, random_scene
from warpsplat.kernels import constants
from warpsplat.kernels.stroke import half_plane, half_plane_slope
from warpsplat.metrics import psnr
from warpsplat.parameters import Parameters
from warpsplat.render import Capacity, render
from warpsplat.render_exact import ExactRenderer
from warpsplat.scene import Kind, Scene
from warpsplat.svg import write_svg
from warpsplat.viewer import on_white, render_svg

CASES = [
    ("closed", 1, 1, 1.0),
    ("closed", 2, 1, 0.7),
    ("closed", 3, 1, 2.0),
    ("open", 2, 1, 1.0),
    ("open", 2, 3, 1.3),
]


def exact(scene: Scene, device: str, scale: float = 1.0, **options: object) -> ExactRenderer:
    size = round(scene.width * scale), round(scene.height * scale)
    renderer = ExactRenderer(Parameters(scene, wp.get_device(device)), *size, scale, **options)
    renderer.forward_complete()
    return renderer


def compare(scene: Scene, device: str, scale: float = 1.0, tolerance: float = 1e-3) -> None:
    """Image and all gradients, for a random gradient of the image."""
    renderer = exact(scene, device, scale)
    p = reference.tensors(scene)
    pieces = np.diff(renderer.cubic_first.numpy(), axis=1).tolist()
    image = reference_exact.render(scene, p, pieces, renderer.width, renderer.height, scale)
    np.testing.assert_allclose(renderer.read_image(), image.detach().numpy(), atol=2e-4)
    weights = np.random.default_rng(1).normal(size=(*image.shape,))
    (image * torch.tensor(weights)).sum().backward()
    renderer.write_image_grad(weights.astype(np.float32))
    renderer.backward()
    got = renderer.parameters.gradients()
    for name in ("points", "colors", "opacities") + (("widths",) if scene.kind == "open" else ()):
        gradient = p[name].grad
        assert gradient is not None
        assert relative_error(got[name], gradient.numpy()) < tolerance, name


@pytest.mark.parametrize(("kind", "chain_cubics", "opacity_count", "scale"), CASES)
def test_image_and_gradients(
    device: str, kind: Kind, chain_cubics: int, opacity_count: int, scale: float
) -> None:
    compare(random_scene(kind, chain_cubics=chain_cubics, opacity_count=opacity_count, seed=3), device, scale)


@pytest.mark.parametrize("seed", range(4))
def test_self_overlap_and_off_canvas(device: str, seed: int) -> None:
    """Points thrown about: loops, opposite windings, outlines across every border of the canvas."""
    rng = np.random.default_rng(seed)
    scene = random_scene("closed", count=5, seed=seed)
    points = scene.points + rng.normal(0, 14, scene.points.shape).astype(np.float32)
    compare(replace(scene, points=points), device)
    strokes = random_scene("open", count=4, seed=seed)
    points = strokes.points + rng.normal(0, 9, strokes.points.shape).astype(np.float32)
    compare(replace(strokes, points=points), device, tolerance=3e-3)


@pytest.mark.parametrize("seed", range(3))
def test_strokes_wider_than_tiles(device: str, seed: int) -> None:
    """A row of pixels near one segment may span many tiles; some are covered throughout."""
    scene = random_scene("open", count=3, width=120, height=90, seed=seed)
    wide = replace(scene, widths=np.array([30, 55, 80], np.float32))
    compare(wide, device, tolerance=3e-3)
    assert constants.FULL in exact(wide, device).slot_state.numpy()


@pytest.mark.parametrize("step", [8, 16])
@pytest.mark.parametrize("seed", range(5))
def test_edges_on_the_borders_of_tiles(device: str, step: int, seed: int) -> None:
    """Straight outlines with corners on a grid, on and off the canvas: what decides a slot's state."""
    rng = np.random.default_rng(seed)
    scene = random_scene("closed", count=4, width=64, height=64, seed=seed)
    corners = step * rng.integers(-2, 64 // step + 3, (4, 4, 2)).astype(np.float32)
    corners[0, 1::2, 0] = corners[0, ::2, 0]
    following = np.roll(corners, -1, axis=1)
    sides = [(1 - t) * corners + t * following for t in (0, 1 / 3, 2 / 3)]
    straight = replace(scene, points=np.stack(sides, axis=2).reshape(4, 12, 2).astype(np.float32))
    renderer = exact(straight, device)
    pieces = np.diff(renderer.cubic_first.numpy(), axis=1).tolist()
    image = reference_exact.render(straight, reference.tensors(straight), pieces, 64, 64, 1.0)
    np.testing.assert_allclose(renderer.read_image(), image.detach().numpy(), atol=1e-4)


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_finite_differences(device: str, kind: Kind) -> None:
    """No reference at all: the loss itself, a random direction in all points, central differences."""
    scene = random_scene(kind, count=3, seed=6)
    rng = np.random.default_rng(0)
    weights = cv2.GaussianBlur(rng.normal(size=(36, 40, 3)), (0, 0), 2.0)
    renderer = exact(scene, device)
    renderer.write_image_grad(weights.astype(np.float32))
    renderer.backward()
    gradient = renderer.parameters.gradients()["points"].astype(np.float64)
    step = 0.02
    for _ in range(3):
        direction = rng.normal(size=scene.points.shape)
        values = []
        for sign in (1, -1):
            moved = replace(scene, points=(scene.points + sign * step * direction).astype(np.float32))
            values.append((exact(moved, device).read_image().astype(np.float64) * weights).sum())
        numeric = (values[0] - values[1]) / (2 * step)
        scale = np.abs(gradient * direction).sum()
        assert abs(numeric - (gradient * direction).sum()) < 0.01 * scale


@pytest.mark.parametrize("kind", ["closed", "open"])
@pytest.mark.parametrize("size", [1.0, 0.15])
def test_against_a_supersampled_truth(device: str, kind: Kind, size: float) -> None:
    """At least 50 dB; ``size`` 0.15 makes strokes of 0.2 to 1 px."""
    scene = random_scene(kind, count=12, width=96, height=80, seed=3)
    scene = replace(scene, widths=scene.widths * np.float32(size))
    big = on_white(render_svg(write_svg(scene, precision=4), zoom=16))
    truth = cv2.resize(big, (96, 80), interpolation=cv2.INTER_AREA)
    rounded = replace(
        scene,
        colors=(np.round(scene.colors * 255) / 255).astype(np.float32),
        background=(np.round(scene.background * 255) / 255).astype(np.float32),
        widths=np.round(scene.widths, 2),
        opacities=np.round(scene.opacities, 3),
    )
    mine = render(rounded, device=device).astype(np.float64) * 255
    # resvg rounds to 8 bits at each translucent layer, which no supersampling mends: a level of bias.
    assert psnr(mine, truth) > 46
    opaque = replace(rounded, opacities=np.ones_like(scene.opacities))
    big = on_white(render_svg(write_svg(opaque, precision=4), zoom=16))
    truth = cv2.resize(big, (96, 80), interpolation=cv2.INTER_AREA)
    mine = render(opaque, device=device).astype(np.float64) * 255
    assert psnr(mine, truth) > 50


def test_an_opaque_square_covers_exactly_its_pixels(device: str) -> None:
    corners = np.array([[10, 8], [30, 8], [30, 28], [10, 28]], float)
    sides = [np.linspace(a, b, 4)[:3] for a, b in zip(corners, np.roll(corners, -1, 0), strict=True)]
    square = replace(disc(1, 48, 0), points=np.concatenate(sides)[None].astype(np.float32))
    image = render(square, device=device)[..., 0]
    assert (image > 1e-5).sum() == 400
    np.testing.assert_allclose(image[8:28, 10:30], 1, atol=1e-5)


def test_half_plane() -> None:
    """The closed form against counting points of a fine grid; its slope against differences."""
    grid = (np.arange(400) + 0.5) / 400 - 0.5
    x, y = np.meshgrid(grid, grid)
    for angle in (0, 0.2, np.pi / 4, 1.3, 2.5, 4.0):
        n = wp.vec2(np.cos(angle), np.sin(angle))
        for distance in (-0.8, -0.6, -0.3, 0.0, 0.2, 0.55, 0.71):
            counted = (n[0] * x + n[1] * y < distance).mean()
            assert half_plane(distance, n) == pytest.approx(counted, abs=4e-3)
            around = (half_plane(distance + 1e-3, n) - half_plane(distance - 1e-3, n)) / 2e-3
            assert half_plane_slope(distance, n) == pytest.approx(around, abs=6e-3)


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_degenerate_shapes_do_no_harm(device: str, kind: Kind) -> None:
    scene = random_scene(kind, count=5)
    points = scene.points.copy()
    points[0] = points[0, 0]
    points[1, 1:4] = points[1, 0]
    points[2, :, 1] = 7.0
    points[3, :, 0] = 16.0
    points[4] = np.nan
    renderer = exact(replace(scene, points=points), device)
    assert np.isfinite(renderer.read_image()).all()
    renderer.write_image_grad(np.broadcast_to(np.float32([1, -1, 0.5]), (renderer.height, renderer.width, 3)))
    renderer.backward()
    for name, gradient in renderer.parameters.gradients().items():
        assert np.isfinite(gradient[:4]).all(), name


@pytest.mark.parametrize("kind", ["closed", "open"])
@pytest.mark.parametrize("far", [3e9, 1e30, np.inf, np.nan])
def test_numbers_of_any_size_do_no_harm(device: str, kind: Kind, far: float) -> None:
    """A file may hold any number, in a point or a width."""
    scene = random_scene(kind, count=4)
    points, widths = scene.points.copy(), scene.widths.copy()
    points[0, 3:6, 0] = far
    points[1, 4, 1] = -far
    points[2, 1:3] = far
    widths[3] = min(far, 1e30) if kind == "open" else 0
    renderer = exact(replace(scene, points=points, widths=widths), device)
    renderer.write_image_grad(np.ones((renderer.height, renderer.width, 3), np.float32))
    renderer.backward()
    assert np.isfinite(renderer.read_image()).all()
    assert np.isfinite(renderer.parameters.gradients()["colors"]).all()


def test_opaque_shapes_and_none_at_all(device: str) -> None:
    scene = random_scene("closed", count=6)
    renderer = exact(replace(scene, opacities=np.ones_like(scene.opacities)), device)
    renderer.write_image_grad(np.ones((renderer.height, renderer.width, 3), np.float32))
    renderer.backward()
    for gradient in renderer.parameters.gradients().values():
        assert np.isfinite(gradient).all()
    nothing = render(scene.take(np.arange(0)), device=device)
    np.testing.assert_allclose(nothing, np.broadcast_to(scene.background, nothing.shape))


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_same_bits_for_any_number_of_threads(device: str, kind: Kind) -> None:
    scene = random_scene(kind, count=20, width=90, height=70, seed=2)
    outcomes = []
    for threads in (1, 2, 3, 1):
        renderer = exact(scene, device, threads=threads)
        renderer.image_grad.assign(renderer.image)
        renderer.backward()
        outcomes.append([renderer.read_image(), *renderer.parameters.gradients().values()])
    for other in outcomes[1:]:
        for a, b in zip(outcomes[0], other, strict=True):
            np.testing.assert_array_equal(a, b)


def test_overflow_is_counted_and_mended(device: str) -> None:
    scene = random_scene("closed", count=10)
    renderer = exact(scene, device, capacity=Capacity(50, 9))
    assert renderer.capacity.items >= renderer.needed_items.numpy()[0] > 50
    np.testing.assert_array_equal(renderer.read_image(), render(scene, device=device))


def test_full_tiles_take_the_short_path(device: str) -> None:
    renderer = exact(disc(60, 120, 60), device)
    states = renderer.slot_state.numpy()[renderer.slot_part.numpy() >= 0]
    assert set(np.unique(states)) == {constants.FULL, constants.UNCOVERED, constants.PARTIAL}
