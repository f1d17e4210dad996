"""Painting orders that bring equal opacities or colours together and look the same."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import random_scene
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Kind, Scene
from warpsplat.scene.geometry import bounds
from warpsplat.svg import order
from warpsplat.svg.order import MARGIN, by_color, by_opacity
from warpsplat.svg.write import write_svg

WIDTH, HEIGHT = 192, 160


def scattered(count: int, *, seed: int = 0, levels: int = 4) -> Scene:
    """Return fills and strokes of few opacities, of which some overlap."""
    rng = np.random.default_rng(seed)
    fills = random_scene(Kind.FILL, count, WIDTH, HEIGHT, seed=seed)
    strokes = random_scene(Kind.STROKE, count // 3, WIDTH, HEIGHT, seed=seed + 1)
    scene = fills.append(strokes)
    scene = scene.take(rng.permutation(len(scene)))
    opacities = rng.integers(1, levels + 1, len(scene)) / (levels + 1)
    return replace(scene, opacities=opacities.astype(np.float32))


def runs(scene: Scene) -> int:
    """Return the number of runs of one kind and opacity."""
    return len(list(itertools.groupby(zip(scene.kind.tolist(), scene.opacities.tolist(), strict=True))))


@pytest.mark.parametrize("block", [7, order.BLOCK])
@pytest.mark.parametrize("seed", range(3))
def test_the_picture_stays_and_runs_grow(
    device: str, seed: int, block: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And it would not in any order. Many shapes are ordered in blocks."""
    monkeypatch.setattr(order, "BLOCK", block)
    scene, backend = scattered(60, seed=seed), Backend.on(device)
    before = render(scene, backend=backend)
    found = by_opacity(scene)
    np.testing.assert_array_equal(found // block, np.arange(len(scene)) // block)
    ordered = scene.take(found)
    np.testing.assert_allclose(render(ordered, backend=backend), before, rtol=0, atol=1e-6)
    by_key = np.lexsort((scene.opacities, scene.kind))
    assert np.abs(render(scene.take(by_key), backend=backend) - before).max() > 0.1
    assert runs(ordered) < (0.7 if block > len(scene) else 1) * runs(scene)
    assert len(write_svg(ordered)) < len(write_svg(scene))


def test_shapes_apart_are_sorted_and_shapes_in_one_place_stay() -> None:
    scene = scattered(12)
    places = np.repeat(np.arange(len(scene)), scene.point_counts())
    apart = replace(scene, points=(scene.points + 500 * places[:, None]).astype(np.float32))
    kinds = len(set(zip(scene.kind.tolist(), scene.opacities.tolist(), strict=True)))
    assert runs(apart) > kinds == runs(apart.take(by_opacity(apart)))
    for same in (replace(scene, points=scene.points * np.float32(0.001)), *map(scene.take, ([], [0]))):
        np.testing.assert_array_equal(by_opacity(same), np.arange(len(same)))


@pytest.mark.parametrize("gap", [0.5 * MARGIN, 1.5 * MARGIN])
def test_soft_edges_of_neighbours_keep_their_order(gap: float) -> None:
    """Shapes that share a pixel overlap even if they do not touch."""
    one = random_scene(Kind.FILL, 1)
    box = bounds(one)[0]
    right = replace(one, points=one.points + np.array([box[2] - box[0] + gap, 0], np.float32))
    far = replace(one, points=one.points + np.array([300, 300], np.float32))
    scene = replace(one.append(right).append(far), opacities=np.float32([0.5, 0.9, 0.9]))
    assert by_opacity(scene).tolist() == ([0, 1, 2] if gap < MARGIN else [1, 2, 0])


def test_colours_are_grouped(device: str) -> None:
    colors = np.random.default_rng(0).integers(0, 3, 80)
    scene = replace(scattered(60, seed=2, levels=1), colors=np.eye(3, dtype=np.float32)[colors])
    found, backend = by_color(scene), Backend.on(device)
    before, after = (render(each, backend=backend) for each in (scene, scene.take(found)))
    np.testing.assert_allclose(after, before, rtol=0, atol=1e-6)
    alike = replace(scene, opacities=colors.astype(np.float32))
    assert runs(alike.take(found)) < 0.7 * runs(alike)
