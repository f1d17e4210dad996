"""Tests of contours that do not cross, of parts, and of drawings without overlaps."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from warpsplat.run.svg import load_svg
from warpsplat.scene import Scene
from warpsplat.scene.connected import separated
from warpsplat.scene.cutout import cut_out
from warpsplat.scene.intersections import intersections, parts
from warpsplat.scene.simple import rings_of, simple
from warpsplat.svg.viewer import render_svg
from warpsplat.svg.write import write_svg

SIDE = 64


def scene_of(*paths: str) -> Scene:
    """Return a scene of path elements without their brackets."""
    elements = "".join(f"<path {path}/>" for path in paths)
    return load_svg(f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {SIDE} {SIDE}">{elements}</svg>')


def random_path(seed: int, count: int = 7) -> str:
    """Return a ring of cubics and lines between random points on a grid of half pixels."""
    points = np.random.default_rng(seed).integers(4, 2 * SIDE - 4, (count, 3, 2)) / 2
    pieces = [
        f"L{c[0]} {c[1]}" if i % 3 == 0 else f"C{a[0]} {a[1]} {b[0]} {b[1]} {c[0]} {c[1]}"
        for i, (a, b, c) in enumerate(points.tolist())
    ]
    return f"M{points[-1, 2, 0]} {points[-1, 2, 1]}{''.join(pieces)}z"


def pixels(scene: Scene) -> np.ndarray:
    """Return a scene as a viewer shows it, premultiplied, in [0, 1]."""
    drawn = render_svg(write_svg(scene, per_pixel=16))
    values = np.asarray(drawn.convert("RGBA"), np.float64) / 255
    values[..., :3] *= values[..., 3:]
    return values


def crossings(scene: Scene) -> int:
    """Return how often contours of the same shape cross, but for hairs: less than a unit off a node."""
    found = 0
    for shape in range(len(scene)):
        cubics = np.concatenate(rings_of(scene, shape, 16))
        pairs, places = intersections(cubics)
        at = parts(cubics[pairs[:, 0]], places[:, 0], places[:, 0])[:, 0]
        found += int((np.abs(at[:, None] - cubics[:, 0]).max(axis=2).min(axis=1, initial=np.inf) > 1).sum())
    return found


@pytest.mark.parametrize("rule", ["nonzero", "evenodd"])
@pytest.mark.parametrize("seed", range(6))
def test_crossing_contours_are_cut_and_look_the_same(seed: int, rule: str) -> None:
    scene = scene_of(f'd="{random_path(seed)}{random_path(seed + 100)}" fill-rule="{rule}"')
    assert crossings(scene) > 0
    made = simple(scene, 16)
    assert crossings(made) == 0
    assert np.abs(pixels(made) - pixels(scene)).max() < 0.3
    assert np.abs(pixels(made) - pixels(scene)).mean() < 0.001


@pytest.mark.parametrize("rule", ["nonzero", "evenodd"])
def test_contours_that_cross_in_nodes_look_the_same(rule: str) -> None:
    """A contour may enter another at a node that they share, and leave it across an edge."""
    for seed in range(40):
        random, rings = np.random.default_rng(seed), []
        shared = random.integers(4, 2 * SIDE - 4, (4, 2)) / 2
        for _ in range(3):
            corners = np.concatenate([shared, random.integers(4, 2 * SIDE - 4, (3, 2)) / 2])
            corners = corners[random.choice(len(corners), 5, replace=False)]
            # Around their mean, so that they do not cross themselves.
            around = np.arctan2(*(corners - corners.mean(axis=0)).T)
            rings.append("M" + "L".join(f"{x} {y}" for x, y in corners[np.argsort(around)].tolist()) + "z")
        scene = scene_of(f'd="{"".join(rings)}" fill-rule="{rule}"')
        assert np.abs(pixels(simple(scene, 16)) - pixels(scene)).mean() < 0.002, seed


def test_simple_contours_stay() -> None:
    scene = scene_of('d="M9 9h40v40h-40zM19 19v20h20v-20z"', f'd="{random_path(3)}" fill="none" stroke="red"')
    assert simple(scene, 16) is scene


@pytest.mark.parametrize(
    ("path", "rings"),
    [
        ("M10 10H50V50H30V49H31V51H29V50H10z", 1),  # a loop, which goes
        ("M10 10L50 50V10L10 50z", 2),  # a bow
        ("M10 10L30 30L50 10V50L30 30L10 50z", 2),  # touches itself at a node
        ("M8 8H48V40L28 8L8 40z", 2),  # has a node on one of its lines
        ("M8 8H48V40H8zM10 10L20 20L10 10zM30 30v.1h.1z", 1),  # and rings without an area, which go
    ],
)
def test_rings_that_cross_or_touch_themselves(path: str, rings: int) -> None:
    scene = scene_of(f'd="{path}" fill="red"')
    made = simple(scene, 16)
    assert [len(made.contours_of(shape)) for shape in range(len(made))] == [rings]
    np.testing.assert_allclose(pixels(made), pixels(scene), atol=0.3 if rings == 1 else 0.02)


def test_cubics_cross_where_they_do() -> None:
    """Found by brute force as well; and one with itself."""
    own, places = intersections(np.array([[(0, 0), (40, 30), (-10, 30), (30, 0)]], np.float64))
    assert own.tolist() == [[0, 0]] and np.isclose(places.sum(), 1)
    rng = np.random.default_rng(5)
    cubics = rng.uniform(0, 100, (12, 4, 2))
    pairs, places = intersections(cubics)
    found = set(map(tuple, np.sort(pairs, axis=1).tolist()))

    def at(index: int, t: float) -> np.ndarray:
        s = 1 - t
        return np.array([s**3, 3 * s * s * t, 3 * s * t * t, t**3]) @ cubics[index]

    for (i, j), (t, u) in zip(pairs.tolist(), places.tolist(), strict=True):
        assert np.abs(at(i, t) - at(j, u)).max() < 0.05
    dense = [np.stack([at(i, t) for t in np.linspace(0, 1, 400)]) for i in range(len(cubics))]
    for i, j in itertools.combinations(range(len(cubics)), 2):
        apart = np.abs(dense[i][:, None] - dense[j]).max(axis=2).min()
        assert apart < 1 or (i, j) not in found
        assert apart > 0.01 or (i, j) in found


def test_parts_have_their_holes() -> None:
    rings = "M4 4h20v20h-20zM34 4h20v20h-20zM8 8v12h12v-12zM10 10h4v4h-4zM38 8v12h12v-12z"
    scene = scene_of(f'd="{rings}" fill="red"', 'd="M2 40h9v9h-9z" fill="blue"')
    made = separated(scene, 16)
    assert [len(made.contours_of(i)) for i in range(len(made))] == [2, 2, 1, 1]
    assert made.colors[:3].tolist() == [[1, 0, 0]] * 3
    np.testing.assert_array_equal(pixels(made), pixels(scene))


@pytest.mark.parametrize("seed", range(4))
def test_cut_out_scenes_have_no_overlaps(seed: int) -> None:
    colors = ("#f00", "#0a0", "#00f", "#cc0")
    scene = scene_of(*(f'd="{random_path(10 * seed + i)}" fill="{c}"' for i, c in enumerate(colors)))
    made = cut_out(scene, 16)
    assert crossings(made) == 0
    # Seams between what is cut let the ground through; nothing else changes.
    assert np.abs(pixels(made) - pixels(scene)).mean() < 0.02
    alone = [pixels(made.take(np.array([i])))[..., 3] for i in range(len(made))]
    over = np.maximum(np.sum(alone, axis=0) - 1, 0)  # up to rounding
    assert over.max() < 0.25
    assert over.mean() < 0.001


def test_edges_that_coincide_are_shared() -> None:
    """A square over half of another one, and one beside it, with borders in common."""
    scene = scene_of('d="M10 10h40v40h-40z" fill="red"', 'd="M10 10h20v40h-20z" fill="blue"')
    made = cut_out(scene, 16)
    (left, _), (right, _) = made.contours_of(1)[0], made.contours_of(0)[0]
    corners = [sorted(map(tuple, contour[::3].round(3).tolist())) for contour in (left, right)]
    assert corners[0] == [(10, 10), (10, 50), (30, 10), (30, 50)]
    assert corners[1] == [(30, 10), (30, 50), (50, 10), (50, 50)]


def test_covered_shapes_are_left_out_unless_seen_through() -> None:
    below, above = 'd="M20 20h9v9h-9z" fill="red"', 'd="M10 10h40v40h-40z" fill="blue"'
    assert len(cut_out(scene_of(below, above), 16)) == 1
    assert len(cut_out(scene_of(below, f'{above} fill-opacity=".5"'), 16)) == 2


def test_fills_of_one_colour_become_one() -> None:
    """Beside each other, and over another one."""
    left, right = 'd="M10 10h20v40h-20z"', 'd="M30 10h20v40h-20z"'
    made = cut_out(scene_of(left, 'd="M2 2h9v5h-9z" fill="red"', right), 16)
    assert len(made) == 2
    corners = [sorted(map(tuple, contour[::3].round(3).tolist())) for contour, _ in made.contours_of(1)]
    assert {(10, 10), (50, 10), (50, 50), (10, 50)} <= set(corners[0])
    assert len(corners) == 1
