"""Painting orders that bring equal opacities or colours together and look the same."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import random_scene
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray, IndexArray, Kind, Scene
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


def overlapping(boxes: FloatArray) -> list[tuple[int, int]]:
    """Return the pairs of boxes less than ``MARGIN`` apart."""
    low, high = np.split(boxes.astype(np.float64), 2, axis=1)
    gaps = np.maximum(low[:, None], low) - np.minimum(high[:, None], high)
    return [(i, j) for i, j in np.argwhere(np.triu(gaps.max(axis=2) < MARGIN - 1e-4, 1)).tolist()]


def check(scene: Scene, found: IndexArray) -> None:
    """Assert that ``found`` is a permutation in which overlapping shapes keep their order."""
    np.testing.assert_array_equal(np.sort(found), np.arange(len(scene)))
    place = np.argsort(found)
    for i, j in overlapping(bounds(scene)):
        assert place[i] < place[j], (i, j)


@pytest.mark.parametrize("seed", range(4))
def test_overlapping_shapes_keep_their_order_and_runs_grow(seed: int) -> None:
    scene = scattered(90, seed=seed)
    found = by_opacity(scene)
    check(scene, found)
    assert len(overlapping(bounds(scene))) > len(scene), "there is something to keep"
    assert runs(scene.take(found)) < 0.7 * runs(scene), "about half"
    assert len(write_svg(scene.take(found))) < len(write_svg(scene))


@pytest.mark.parametrize("seed", range(3))
def test_the_picture_stays(device: str, seed: int) -> None:
    """And would not in any order."""
    scene = scattered(60, seed=seed)
    backend = Backend.on(device)
    before = render(scene, backend=backend)
    found = by_opacity(scene)
    assert (found != np.arange(len(scene))).any()
    np.testing.assert_allclose(render(scene.take(found), backend=backend), before, rtol=0, atol=1e-6)
    by_key = np.lexsort((scene.opacities, scene.kind))
    assert np.abs(render(scene.take(by_key), backend=backend) - before).max() > 0.1


def test_shapes_apart_are_sorted_and_shapes_in_one_place_stay() -> None:
    scene = scattered(12)
    places = np.repeat(np.arange(len(scene)), scene.point_counts())
    moved = (scene.points + 500 * places[:, None]).astype(np.float32)
    apart = replace(scene, points=moved)
    kinds = len(set(zip(scene.kind.tolist(), scene.opacities.tolist(), strict=True)))
    assert runs(apart) > kinds == runs(apart.take(by_opacity(apart)))
    for count in (0, 1):
        assert by_opacity(scene.take(np.arange(count))).tolist() == list(range(count))
    centre = replace(scene, points=(scene.points * np.float32(0.001)))
    np.testing.assert_array_equal(by_opacity(centre), np.arange(len(scene)))


@pytest.mark.parametrize("gap", [0.5 * MARGIN, 1.5 * MARGIN])
def test_soft_edges_of_neighbours_keep_their_order(gap: float) -> None:
    """Shapes that share a pixel overlap even if they do not touch."""
    one = random_scene(Kind.FILL, 1)
    box = bounds(one)[0]
    right = replace(one, points=one.points + np.array([box[2] - box[0] + gap, 0], np.float32))
    far = replace(one, points=one.points + np.array([300, 300], np.float32))
    scene = replace(one.append(right).append(far), opacities=np.float32([0.5, 0.9, 0.9]))
    assert by_opacity(scene).tolist() == ([0, 1, 2] if gap < MARGIN else [1, 2, 0])


@pytest.mark.parametrize("block", [1, 7, 80])
def test_many_shapes_are_ordered_in_blocks(block: int, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scattered(60)
    whole = runs(scene.take(by_opacity(scene)))
    monkeypatch.setattr(order, "BLOCK", block)
    found = by_opacity(scene)
    check(scene, found)
    np.testing.assert_array_equal(found // block, np.arange(len(scene)) // block)
    assert (runs(scene.take(found)) == whole) == (block >= len(scene))


def test_colours_are_grouped() -> None:
    scene = scattered(60, seed=2, levels=1)
    rng = np.random.default_rng(0)
    colors = rng.integers(0, 3, len(scene))
    scene = replace(scene, colors=np.eye(3, dtype=np.float32)[colors])
    found = by_color(scene)
    check(scene, found)
    alike = replace(scene, opacities=colors.astype(np.float32))
    assert runs(alike.take(found)) < 0.7 * runs(alike)
