"""Splats: image and adjoint against float64, coverage, tile lists against brute force; properties."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from tests.helpers import (
    SPLAT,
    adjoint,
    compare,
    renderer_for,
)
from tests.paper.helpers import grid_of
from tests.scenes import canvas, disc, mixed_scene, random_scene
from warpsplat.kernels.constants import TILE
from warpsplat.metrics import psnr
from warpsplat.paper.constants import PLATEAU
from warpsplat.paper.models import SplatModel
from warpsplat.paper.split import subcurve
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, FloatArray, Kind, Scene
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg

FILL, STROKE = Kind.FILL, Kind.STROKE
CASES = [(FILL, n, 1.0) for n in (2, 4, 6)] + [(STROKE, n, 1.0) for n in (1, 2, 3, 4, 5)]
CASES += [(FILL, 4, 0.6), (STROKE, 3, 1.7)]


def splatted(scene: Scene, device: str) -> FloatArray:
    return render(scene, model=SPLAT, backend=Backend.on(device))


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


@pytest.mark.parametrize("kind", list(Kind))
def test_tile_lists_match_brute_force(device: str, kind: Kind) -> None:
    scene = random_scene(kind, count=12, width=75, height=50, seed=4)
    renderer = renderer_for(scene, device, model=SPLAT)
    bins, grid = renderer.bins.buffers, grid_of(renderer)
    first, last = bins.tile_first.numpy(), bins.tile_last.numpy()
    slots, shapes = bins.sort_slots.numpy(), bins.slot_shape.numpy()
    mean, extent = grid.mean.numpy(), grid.extent.numpy()
    g_first, g_last = grid.gaussian_first.numpy(), grid.gaussian_last.numpy()
    for tile in range(renderer.viewport.tile_count):
        listed = [int(shapes[s]) for s in slots[first[tile] : last[tile]]]
        assert listed == sorted(listed, reverse=True), "front (the last row) first, each shape once"
        ty, tx = divmod(tile, renderer.viewport.tiles_x)
        wanted = []
        for shape in range(len(scene)):
            low = (mean - extent)[g_first[shape] : g_last[shape]].min(axis=0)
            high = (mean + extent)[g_first[shape] : g_last[shape]].max(axis=0)
            if (high >= [TILE * tx, TILE * ty]).all() and (low < [TILE * (tx + 1), TILE * (ty + 1)]).all():
                wanted.append(shape)
        assert listed == wanted[::-1]


@pytest.mark.parametrize("radius", [4.0, 10.0, 25.0])
def test_a_splatted_disc_covers_what_the_path_covers(device: str, radius: float) -> None:
    size = int(2 * radius + 12)
    image = splatted(disc(radius, size, size / 2 + 0.3), device)[..., 0]
    centres = np.arange(size) + 0.5 - (size / 2 + 0.3)
    distance = np.hypot(*np.meshgrid(centres, centres)) - radius
    assert image.sum() == pytest.approx(np.pi * radius**2, rel=0.06)
    assert image[distance < -1.5].min() > 0.95
    assert image[distance > 1.5].max() < 0.1
    assert image[np.abs(distance) < 0.2].mean() == pytest.approx(0.5, abs=0.12)


def test_stroke_covers_caps_and_joins(device: str) -> None:
    """A stroke that turns back at its joint: the round join is a half disc beyond the turning point."""
    scene = random_scene(STROKE, count=1, width=60, height=40)
    x = np.array([15, 22, 30, 40, 33, 26, 20, 22, 24, 26], np.float32)
    points = np.stack([x, np.full(10, 20.0, np.float32)], axis=1)
    one = replace(
        scene,
        points=points,
        widths=np.array([12.0], np.float32),
        colors=np.ones((1, 3), np.float32),
        opacities=np.ones(1, np.float32),
        canvas=replace(scene.canvas, background=np.zeros(3, np.float32)),
    )
    image = splatted(one, device)[..., 0]
    assert image[20, 44] > 0.9, "join: 4 px beyond the joint at x = 40, inside the radius of 6"
    assert image[20, 48] < 0.05
    assert image[20, 11] > 0.9, "cap: 4 px beyond the start at x = 15"
    assert image[20, 7] < 0.05


def test_invisible_and_outside_shapes_change_nothing(device: str) -> None:
    scene = random_scene(FILL, count=3)
    clear = replace(scene, opacities=np.zeros_like(scene.opacities))
    np.testing.assert_array_equal(
        splatted(clear, device), np.broadcast_to(scene.canvas.background, (36, 40, 3))
    )
    away = replace(scene, points=scene.points + np.float32(500))
    renderer = renderer_for(away, device, model=SPLAT)
    assert renderer.needed_slots.numpy()[0] == 0
    assert not any(g.any() for g in adjoint(renderer).values())


@pytest.mark.parametrize("cuts", [(0.5,), (0.1, 0.15, 0.9), (0.01, 0.02, 0.03, 0.04), (0.2, 0.4, 0.6, 0.8)])
def test_a_stroke_looks_the_same_of_any_number_of_cubics(device: str, cuts: tuple[float, ...]) -> None:
    """One cubic cut into several, of equal and of unequal lengths."""
    whole = np.array([[8, 50], [20, -10], [44, 80], [56, 10]], np.float64)
    pieces = [subcurve(whole[None], a, b)[0] for a, b in itertools.pairwise((0.0, *cuts, 1.0))]
    chain = np.concatenate([pieces[0], *(p[1:] for p in pieces[1:])])
    pictures = []
    for points in (whole, chain):
        scene = Scene.uniform(
            STROKE,
            canvas(64, 64),
            points[None].astype(np.float32),
            colors=np.ones((1, 3), np.float32),
            opacities=np.full(1, 0.9, np.float32),
            widths=np.full(1, 6, np.float32),
        )
        pictures.append(splatted(scene, device))
    assert np.abs(pictures[0] - pictures[1]).mean() < 3e-3


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
