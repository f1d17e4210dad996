"""Little way with the pen lifted."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from warpsplat.drawing.strokes.tour import toured
from warpsplat.scene import Canvas, Kind, Scene

CANVAS = Canvas(100, 100, None)


def strokes(ends: np.ndarray) -> Scene:
    """Straight strokes, shape (stroke, 2, 2)."""
    points = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * (np.arange(4)[None, :, None] / 3)
    return Scene.uniform(Kind.STROKE, CANVAS, points, widths=np.full(len(ends), 2.0))


def pen_up(scene: Scene) -> float:
    """Travel of the lifted pen between strokes; each one that is closed ends where it begins."""
    chains = [scene.points_of(i) for i in range(len(scene))]
    ends = [
        (chain[0], chain[0] if closed else chain[-1])
        for chain, closed in zip(chains, scene.closed, strict=True)
    ]
    return sum(float(np.hypot(*(b[0] - a[1]))) for a, b in itertools.pairwise(ends))


def segments(scene: Scene) -> set[frozenset[tuple[float, ...]]]:
    """The strokes, whatever their direction."""
    chains = (scene.points_of(i).round(3) for i in range(len(scene)))
    return {frozenset((tuple(chain[0].tolist()), tuple(chain[-1].tolist()))) for chain in chains}


def test_a_tour_keeps_the_strokes_and_is_near_the_shortest() -> None:
    rng = np.random.default_rng(1)
    scene = strokes(rng.uniform(0, 100, (5, 2, 2)).astype(np.float32))
    found = toured(scene)
    assert segments(found) == segments(scene)

    def way(order: tuple[int, ...], turned: tuple[int, ...]) -> float:
        ends = [scene.points_of(i)[[0, -1] if not t else [-1, 0]] for i, t in zip(order, turned, strict=True)]
        return sum(float(np.hypot(*(b[0] - a[1]))) for a, b in itertools.pairwise(ends))

    best = min(
        way(order, turned)
        for order in itertools.permutations(range(5))
        for turned in itertools.product((0, 1), repeat=5)
    )
    assert pen_up(found) <= 1.02 * best


def test_a_long_row_in_disorder_is_drawn_along() -> None:
    rng = np.random.default_rng(0)
    x = rng.permutation(80).astype(np.float32)
    ends = np.stack([np.stack([x, 0 * x], axis=1), np.stack([x, 0 * x + 5], axis=1)], axis=1)
    scene = strokes(ends)
    assert pen_up(toured(scene)) == pytest.approx(79)
    assert pen_up(scene) > 10 * 79


def test_pens_are_not_mixed() -> None:
    rng = np.random.default_rng(2)
    scene = strokes(rng.uniform(0, 100, (30, 2, 2)).astype(np.float32))
    layer = np.repeat([0, 1], 15).astype(np.int32)
    found = toured(replace(scene, layer=layer))
    assert found.layer.tolist() == layer.tolist()
    assert segments(found.take(np.arange(15))) == segments(scene.take(np.arange(15)))


def test_rings_begin_where_the_pen_comes_by() -> None:
    turn = np.linspace(0, 2 * np.pi, 12, endpoint=False)
    ring = np.stack([50 + 20 * np.cos(turn), 50 + 20 * np.sin(turn)], axis=1).astype(np.float32)
    line = np.stack([np.linspace(0, 29, 4), np.full(4, 50)], axis=1).astype(np.float32)
    scene = Scene(
        CANVAS,
        np.full(2, Kind.STROKE, np.int32),
        np.array([0, 4, 16], np.int32),
        points=np.concatenate([line, ring]),
        closed=np.array([0, 1], np.int32),
        widths=np.ones(2, np.float32),
    )
    found = toured(scene)
    assert pen_up(found) == pytest.approx(1, abs=1e-4)
    assert sorted(map(tuple, found.points.tolist())) == sorted(map(tuple, scene.points.tolist()))
