"""Coverage and its adjoint, tile by tile; tile lists against brute force; capacities; properties."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch
import warp as wp

from tests import reference
from tests.kernels.helpers import plans_of, relative_error, renderer_for
from tests.scenes import disc, random_scene
from warpsplat.errors import CapacityError
from warpsplat.kernels import splat
from warpsplat.kernels.constants import TILE, TILE_PIXELS
from warpsplat.parameters import Parameters
from warpsplat.render import Capacity, render
from warpsplat.render_splat import SplatRenderer
from warpsplat.scene import Kind


def coverage_images(renderer: SplatRenderer) -> np.ndarray:
    """Slots put together: [part, padded height, padded width]; 0 where a part has no slot."""
    size = (renderer.parameters.part_count, TILE * renderer.tiles_y, TILE * renderer.tiles_x)
    images = np.zeros(size, np.float32)
    parts, tiles = renderer.slot_part.numpy(), renderer.slot_tile.numpy()
    coverage = renderer.coverage.numpy()
    for slot in np.flatnonzero(parts >= 0):
        y, x = divmod(int(tiles[slot]), renderer.tiles_x)
        block = coverage[slot].reshape(TILE, TILE).T
        images[parts[slot], TILE * y : TILE * (y + 1), TILE * x : TILE * (x + 1)] = block
    return images


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_coverage_and_adjoint(device: str, kind: Kind) -> None:
    scene = random_scene(kind, seed=21)
    renderer = renderer_for(scene, device)
    grids = reference.grids(scene, reference.tensors(scene), plans_of(renderer), 1.0)
    got = coverage_images(renderer)[:, : renderer.height, : renderer.width]
    rng = np.random.default_rng(0)
    coverage_grad = rng.normal(size=renderer.coverage.shape).astype(np.float32)
    # Compositing leaves no gradient in the padding of the tiles.
    inside = renderer.inside.numpy().reshape(-1, TILE_PIXELS)
    coverage_grad *= inside[np.minimum(renderer.slot_tile.numpy(), len(inside) - 1)]
    renderer.coverage.assign(coverage_grad * (1 - renderer.coverage.numpy()))
    wp.launch(
        splat.splat_backward,
        dim=renderer.capacity.items,
        inputs=[0, renderer.gaussian_part, renderer.slot_first, renderer.slot_last, renderer.slot_state]
        + [renderer.part_tiles, renderer.mean, renderer.conic, renderer.extent, renderer.cut]
        + [renderer.coverage_columns],
        outputs=[renderer.mean_grad, renderer.conic_grad],
        device=device,
    )
    runs = 3 if kind == "open" else 1
    tiles = renderer.slot_tile.numpy()
    for part, grid in enumerate(grids):
        mean, scale, angle = (x.detach().requires_grad_() for x in reference.gaussians(grid, runs=runs))
        cover = 1 - torch.prod(
            1
            - reference.gaussian_values(
                mean, scale, angle, reference.cuts(grid), renderer.width, renderer.height
            ),
            0,
        )
        np.testing.assert_allclose(got[part], cover.detach().numpy(), atol=2e-3)
        assert np.abs(got[part] - cover.detach().numpy()).mean() < 1e-5
        total = torch.zeros(())
        for slot in range(renderer.slot_first.numpy()[part], renderer.slot_last.numpy()[part]):
            y, x = divmod(int(tiles[slot]), renderer.tiles_x)
            block = cover[TILE * y : TILE * (y + 1), TILE * x : TILE * (x + 1)]
            weights = torch.tensor(coverage_grad[slot].reshape(TILE, TILE).T)[
                : block.shape[0], : block.shape[1]
            ]
            total = total + (block * weights).sum()
        total.backward()
        rows = slice(renderer.part_first.numpy()[part], renderer.part_last.numpy()[part])
        assert mean.grad is not None
        assert relative_error(renderer.mean_grad.numpy()[rows], mean.grad.numpy()) < 2e-3


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_tile_lists_match_brute_force(device: str, kind: Kind) -> None:
    scene = random_scene(kind, count=12, width=75, height=50, seed=4)
    renderer = renderer_for(scene, device)
    first, last = renderer.tile_first.numpy(), renderer.tile_last.numpy()
    slots, parts = renderer.sort_slots.numpy(), renderer.slot_part.numpy()
    mean, extent = renderer.mean.numpy(), renderer.extent.numpy()
    p_first, p_last = renderer.part_first.numpy(), renderer.part_last.numpy()
    for tile in range(renderer.tiles_x * renderer.tiles_y):
        listed = [int(parts[s]) for s in slots[first[tile] : last[tile]]]
        assert listed == sorted(listed, reverse=True), "front (the last row) first, each part once"
        ty, tx = divmod(tile, renderer.tiles_x)
        wanted = []
        for part in range(len(scene)):
            low = (mean - extent)[p_first[part] : p_last[part]].min(axis=0)
            high = (mean + extent)[p_first[part] : p_last[part]].max(axis=0)
            if (high >= [TILE * tx, TILE * ty]).all() and (low < [TILE * (tx + 1), TILE * (ty + 1)]).all():
                wanted.append(part)
        assert listed == wanted[::-1]


def test_slot_ranges_cover_each_pixel_once(device: str) -> None:
    renderer = renderer_for(random_scene("closed", count=9, seed=8), device)
    used = renderer.slot_part.numpy() >= 0
    assert used.sum() == renderer.needed_slots.numpy()[0]
    pairs = set(zip(renderer.slot_part.numpy()[used], renderer.slot_tile.numpy()[used], strict=True))
    assert len(pairs) == used.sum()
    assert renderer.coverage.shape == (renderer.capacity.slots, TILE_PIXELS)


def test_overflow_is_counted_and_mended(device: str) -> None:
    scene = random_scene("closed", count=10)
    whole = render(scene, renderer="splat", device=device)
    parameters = Parameters(scene, wp.get_device(device))
    small = SplatRenderer(parameters, scene.width, scene.height, 1.0, capacity=Capacity(700, 9))
    small.forward()
    assert np.isfinite(small.read_image()).all()
    assert small.needed_items.numpy()[0] > 700
    assert small.grow()
    small.forward()
    assert small.grow() or small.capacity.slots >= small.needed_slots.numpy()[0]
    small.forward_complete()
    assert not small.grow()
    np.testing.assert_array_equal(small.read_image(), whole)


def test_a_scene_past_the_limits_is_refused(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpsplat.render.SLOT_LIMIT", 3)
    with pytest.raises(CapacityError, match="fewer curves or a smaller image"):
        renderer_for(random_scene("closed"), device)


@pytest.mark.parametrize("kind", ["closed", "open"])
def test_same_bits_for_any_number_of_threads(device: str, kind: Kind) -> None:
    scene = random_scene(kind, count=20, width=90, height=70, seed=2)
    outcomes = []
    for threads in (1, 2, 3, 1):
        renderer = renderer_for(scene, device, threads=threads, fold=0.5)
        renderer.image_grad.assign(renderer.image)
        renderer.backward()
        outcomes.append([renderer.read_image(), *renderer.parameters.gradients().values()])
    for other in outcomes[1:]:
        for a, b in zip(outcomes[0], other, strict=True):
            np.testing.assert_array_equal(a, b)


@pytest.mark.parametrize("radius", [4.0, 10.0, 25.0])
def test_a_splatted_disc_covers_what_the_path_covers(device: str, radius: float) -> None:
    size = int(2 * radius + 12)
    image = render(disc(radius, size, size / 2 + 0.3), renderer="splat", device=device)[..., 0]
    centres = np.arange(size) + 0.5 - (size / 2 + 0.3)
    distance = np.hypot(*np.meshgrid(centres, centres)) - radius
    assert image.sum() == pytest.approx(np.pi * radius**2, rel=0.06)
    assert image[distance < -1.5].min() > 0.95
    assert image[distance > 1.5].max() < 0.1
    assert image[np.abs(distance) < 0.2].mean() == pytest.approx(0.5, abs=0.12)


def test_stroke_covers_caps_and_joins(device: str) -> None:
    """A stroke that turns back at its joint: the round join is a half disc beyond the turning point."""
    scene = random_scene("open", count=1, width=60, height=40)
    x = np.array([15, 22, 30, 40, 33, 26, 20, 22, 24, 26], np.float32)
    points = np.stack([x, np.full(10, 20.0, np.float32)], axis=1)[None]
    one = replace(
        scene,
        points=points,
        widths=np.array([12.0], np.float32),
        colors=np.ones((1, 3), np.float32),
        opacities=np.ones((1, 1), np.float32),
        background=np.zeros(3, np.float32),
    )
    image = render(one, renderer="splat", device=device)[..., 0]
    assert image[20, 44] > 0.9, "join: 4 px beyond the joint at x = 40, inside the radius of 6"
    assert image[20, 48] < 0.05
    assert image[20, 11] > 0.9, "cap: 4 px beyond the start at x = 15"
    assert image[20, 7] < 0.05


def test_invisible_and_outside_shapes_change_nothing(device: str) -> None:
    scene = random_scene("closed", count=3)
    clear = replace(scene, opacities=np.zeros_like(scene.opacities))
    np.testing.assert_array_equal(
        render(clear, renderer="splat", device=device), np.broadcast_to(scene.background, (36, 40, 3))
    )
    away = replace(scene, points=scene.points + np.float32(500))
    renderer = renderer_for(away, device)
    assert renderer.needed_slots.numpy()[0] == 0
    renderer.write_image_grad(np.ones((renderer.height, renderer.width, 3), np.float32))
    renderer.backward()
    assert not any(g.any() for g in renderer.parameters.gradients().values())


def test_translation_moves_the_image(device: str) -> None:
    scene = random_scene("closed", count=3, width=64, height=64, seed=9)
    inner = replace(scene, points=(0.4 * scene.points + 12).astype(np.float32))
    moved = replace(inner, points=inner.points + np.float32(16))
    a, b = render(inner, renderer="splat", device=device), render(moved, renderer="splat", device=device)
    np.testing.assert_allclose(b[16:, 16:], a[:-16, :-16], atol=3e-3)
