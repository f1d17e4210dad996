"""Files written here, read back: nothing is lost, the bytes are the same, and lines have few characters."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import logo, seam
from tests.scenes import CURVES, mixed_scene, ragged_scene, random_scene, started_alike, with_gradients
from tests.svg.foreign import ROUND, SMALL, load_scene
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, Canvas, Kind, Paint, Scene
from warpsplat.svg.commands import (
    Pair,
    Segment,
    choices,
    minus,
    row,
    segments_of,
    shortest,
    shortest_ring,
)
from warpsplat.svg.data import cubic_data
from warpsplat.svg.paths import cubics
from warpsplat.svg.viewer import on_white, premultiplied, render_own, render_svg
from warpsplat.svg.write import GRIDS, rounded, write_svg

CUBIC, SPLINE = CURVES
BOTH = {
    Kind.FILL: [(CUBIC, 4), (SPLINE, 12), (SPLINE, 3), (CUBIC, 2), (SPLINE, 7), (CUBIC, 5)],
    Kind.STROKE: [(CUBIC, 3), (SPLINE, 5), (SPLINE, 1), (CUBIC, 1), (SPLINE, 2)],
}
"""Bases and numbers of Béziers."""


def check(back: Scene, scene: Scene, per_pixel: float) -> None:
    """Assert that ``back`` is ``scene`` as a file holds it."""
    held = rounded(scene, per_pixel)
    for name in ("kind", "basis", "first"):
        np.testing.assert_array_equal(getattr(back, name), getattr(scene, name))
    back = started_alike(back, held)
    for name in ("points", "colors", "opacities", "widths"):
        np.testing.assert_allclose(getattr(back, name), getattr(held, name), rtol=3e-7, atol=1e-6)
    np.testing.assert_allclose(back.canvas.background, scene.canvas.background, atol=0.5001 / 255)


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize(("width", "height"), [(41, 37), (769, 511), (4001, 2999)])
def test_files_come_back(kind: Kind, width: int, height: int) -> None:
    outlines = [(kind, basis, beziers) for basis, beziers in BOTH[kind]]
    for seed, per_pixel in enumerate((*GRIDS, 1000.0)):
        scene = ragged_scene(outlines, width, height, seed=seed)
        if per_pixel < 1:  # so that no cubic shrinks to a point, which a fill's path leaves out
            scene = replace(scene, points=(scene.points % 40 * np.float32(2 / per_pixel)))
        text = write_svg(scene, per_pixel=per_pixel)
        back, has_background = load_scene(text, width, height, "a.svg")
        check(back, scene, per_pixel)
        assert has_background
        assert write_svg(back, per_pixel=per_pixel) == text
        assert write_svg(rounded(scene, per_pixel), per_pixel=per_pixel) == text


@pytest.mark.parametrize("basis", CURVES)
def test_dots(basis: Basis) -> None:
    """A stroke without extent is visible and stays; such a fill is not."""
    for kind in Kind:
        scene = random_scene(kind, count=2, seed=2, basis=basis)
        scene.points[: scene.first[1]] = [20.0, 18.0]
        text = write_svg(scene, per_pixel=2)
        back, _ = load_scene(text, 40, 36, "a.svg")
        assert write_svg(back, per_pixel=2) == write_svg(scene.take(np.arange(2)[-len(back) :]), per_pixel=2)
        if kind == Kind.STROKE:
            check(back, scene, 2)
            dotless = write_svg(scene.take(np.arange(1, 2)), per_pixel=2)
            assert (on_white(render_svg(text)) != on_white(render_svg(dotless))).any()


def test_cubics_without_extent_are_left_out_of_fills() -> None:
    scene = random_scene(Kind.FILL, count=1)
    scene.points[3:7] = scene.points[3]
    back, _ = load_scene(write_svg(scene, per_pixel=4), 40, 36, "a.svg")
    held = rounded(scene, 4)
    left = Scene.uniform(Kind.FILL, scene.canvas, np.delete(held.points, [4, 5, 6], axis=0)[None])
    np.testing.assert_allclose(started_alike(back, left).points, left.points, atol=1e-6)


def scene_of(data: str, style: str = "") -> Scene:
    return load_scene(f'{SMALL}<path d="{data}" {style}/></svg>', 40, 30, "a.svg")[0]


RING = "M10 5q5 0 5 5t-5 5-5-5 5-5"
"""A ring of four quadratics through the midpoints of a square's sides; its corners are the control points."""
CORNERS = [[15, 5], [15, 15], [5, 15], [5, 5]]
ABSOLUTE, MIXED = "M10 5Q15 5 15 10T10 15T5 10T10 5", "m10 5q5 0 5 5T10 15 5 10t5-5Z"
DECIMALS = "M10.0 5.0q5.0 0 5 5t-5.0004 5-4.9996-5 5-5"


@pytest.mark.parametrize("data", [RING, RING + "z", ABSOLUTE, MIXED, DECIMALS])
def test_smooth_rings_are_splines(data: str) -> None:
    scene = scene_of(data)
    assert scene.basis.tolist() == [SPLINE]
    np.testing.assert_allclose(scene.points, CORNERS, atol=2e-3)


@pytest.mark.parametrize("transform", ["rotate(30)", "scale(.5 2)", "matrix(1 .2 .3 1 4 5)"])
def test_splines_stay_splines_under_transforms(transform: str) -> None:
    moved = scene_of(RING, f'transform="{transform}"')
    assert moved.basis.tolist() == [SPLINE]
    cubics = scene_of(RING + "l0 0", f'transform="{transform}"')
    assert cubics.basis.tolist() == [CUBIC]
    joints = (moved.points + np.roll(moved.points, 1, axis=0)) / 2
    np.testing.assert_allclose(joints, cubics.points[:12:3], atol=1e-5)


CUBIC_PATHS = {
    "a corner at the start": "M10 5q5 0 5 5t-10 0 5-5",
    "not back at the start": "M10 5q5 0 5 5t-5 5-5-5",
    "closed by a line": "M10 5q5 0 5 5t-5 5-5-5z",
    "a second quadratic": "M10 5q5 0 5 5 0 5-5 5t-5-5 5-5",
    "a line between": "M10 5q5 0 5 5t-5 5l0 0t-5-5 5-5",
    "smooth from the start": "M10 5t5 5t-5 5-5-5 5-5z",
    "cubics": "M10 5c5 0 5 5 5 5s-5 5-5 5z",
    "a hole with a corner": RING + "M10 8q2 0 2 2t-2 2-2-2z",
    "two quadratics": "M10 5q5 0 5 5t-5-5",
}


@pytest.mark.parametrize("data", CUBIC_PATHS.values(), ids=CUBIC_PATHS.keys())
def test_other_rings_are_cubics(data: str) -> None:
    scene = scene_of(data)
    assert scene.basis.tolist() == [CUBIC]
    text = write_svg(scene, per_pixel=100)
    given = f'{SMALL}<rect width="40" height="30" fill="#fff"/><path d="{data}"/></svg>'
    assert psnr(*(on_white(render_svg(t, zoom=4)) for t in (text, given))) > 40


def test_strokes_of_smooth_quadratics_are_splines_clamped_at_both_ends() -> None:
    scene = scene_of("M4 6Q10 2 14 8t6 2 6-3M3 20q5-5 9 0", ROUND)
    assert scene.basis.tolist() == [SPLINE]
    (first, _), (second, is_closed) = scene.contours_of(0)
    np.testing.assert_allclose(first, [[4, 6], [10, 2], [18, 14], [22, 6], [26, 7]], atol=1e-5)
    np.testing.assert_allclose(second, [[3, 20], [8, 15], [12, 20]], atol=1e-5)
    assert not is_closed
    assert scene_of("M3 20q5-5 9 0M5 9h20M30 5t4 4", ROUND).basis.tolist() == [CUBIC]
    assert scene_of("M4 6Q10 2 14 8t6 2z", ROUND).basis.tolist() == [CUBIC], "closed by a line"
    closed = scene_of(RING + "z", ROUND)
    np.testing.assert_allclose(closed.points, CORNERS, atol=1e-5)
    assert closed.closed.tolist() == [1]


def likeness(scene: Scene, device: str) -> float:
    """Return the PSNR of our rendering and that of the file [dB]."""
    mine = render(rounded(scene, 10), backend=Backend.on(device)).astype(np.float64)
    shown = premultiplied(render_own(write_svg(scene, per_pixel=10)))
    return psnr(255 * mine, shown[..., : mine.shape[2]])


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("clear", [False, True])
def test_a_viewer_shows_what_we_render(device: str, seed: int, clear: bool) -> None:
    scene = with_gradients(mixed_scene(80, 70, seed=seed), seed=seed)
    if clear:
        scene = replace(scene, canvas=Canvas(80, 70, None))
    assert likeness(scene, device) > 38


def test_equal_gradients_are_written_once() -> None:
    scene = with_gradients(random_scene(Kind.FILL, 3))
    text = write_svg(scene.take(np.array([0, 0, 1, 2])))
    assert text.count("<linearGradient") == text.count("<radialGradient") == 1
    assert text.count("url(#g0)") == 1, "in the group of both"


def test_a_skewed_frame(device: str) -> None:
    """Lines of equal colour run along the second axis, which is not at a right angle."""
    scene = with_gradients(random_scene(Kind.FILL, 2, seed=3), seed=2)
    frames = scene.frames.copy()
    frames[0] = [20, 18, 8, 3, 5, 9]
    paint = np.array([Paint.LINEAR, Paint.FLAT], np.int32)
    assert likeness(replace(scene, frames=frames, paint=paint), device) > 38


def segments(seed: int, count: int) -> list[Segment]:
    """Return a chain of lines, some level or upright, and of cubics, some smooth."""
    rng = np.random.default_rng(seed)
    at, mirrored = (0, 0), (0, 0)
    chain = []
    for _ in range(count):
        step = rng.integers(-20, 30, 2) * rng.permutation([1, rng.integers(0, 2)])
        end = (at[0] + int(step[0]), at[1] + int(step[1]))
        if rng.integers(0, 2):
            chain.append(Segment(at, None, end))
            mirrored = end
        else:
            first, second = rng.integers(-99, 99, (2, 2)).tolist()
            handles = (mirrored if rng.integers(0, 2) else (first[0], first[1]), (second[0], second[1]))
            chain.append(Segment(at, handles, end))
            mirrored = chain[-1].mirrored()
        at = end
    return chain


def every_text(pen: Pair | None, chain: list[Segment]) -> list[str]:
    """Return all ways to write a chain."""
    texts, options = [], []
    mirrored = chain[0].start
    for segment in chain:
        options.append(choices(segment, mirrored))
        mirrored = segment.mirrored()
    moves = (("M", chain[0].start), ("m", minus(chain[0].start, pen or (0, 0))))
    for (move, numbers), ways in itertools.product(moves, itertools.product(*options)):
        text, last = move + row(numbers, False), {"M": "L", "m": "l"}[move]
        for letter, values in ways:
            text += row(values, True) if letter == last else letter + row(values, False)
            last = letter
        texts.append(text)
    return texts


@pytest.mark.parametrize("seed", range(20))
def test_no_other_text_is_shorter(seed: int) -> None:
    chain = segments(seed, 4)
    pen = None if seed % 2 else (7, -9)
    assert len(shortest(pen, chain)) == min(map(len, every_text(pen, chain)))


def test_a_line_that_closes_is_left_out() -> None:
    """The command that closes a ring draws it, wherever the ring of a fill starts."""
    square = [(0, 0), (100, 0), (103, 50), (0, 50)]
    chain = [Segment(a, None, b) for a, b in zip(square, [*square[1:], square[0]], strict=True)]
    text, end = shortest_ring(None, chain)
    assert text.count("l") + text.count("h") + text.count("v") + text.count("H") + text.count("V") <= 3
    (drawn,) = cubics(text, keep_dots=False)
    assert len(drawn.points) == 13
    assert tuple(drawn.points[-1]) == end
    grid = [(int(x), int(y)) for x, y in np.repeat(square, 3, axis=0)]
    stroked, pen = cubic_data(segments_of(grid, [True] * 4, True), grid[0], True, None, None)
    assert stroked.endswith("z")
    assert pen == (0, 0)
    (drawn,) = cubics(stroked, keep_dots=True)
    assert drawn.is_closed
    np.testing.assert_allclose(drawn.points[::3], [*square, square[0]])


@pytest.mark.parametrize("per_pixel", GRIDS[2:])
def test_files_of_drawings_come_back(per_pixel: float) -> None:
    """They are read as the rounded drawing, and written again as the same bytes."""
    for made in (logo(), seam()):
        scene = made.scene
        text = write_svg(scene, per_pixel=per_pixel)
        canvas = scene.canvas
        back, _ = load_scene(text, canvas.width, canvas.height, "a.svg")
        assert write_svg(back, per_pixel=per_pixel) == text
        held = rounded(scene, per_pixel)
        for shape in range(len(scene)):
            for (ring, _), (other, _) in zip(back.contours_of(shape), held.contours_of(shape), strict=True):
                turns = [np.roll(ring, 3 * k, axis=0) for k in range(len(ring) // 3)]
                kept = np.abs(np.stack([t for t in turns if t.shape == other.shape]) - other).max(axis=(1, 2))
                assert kept.min() < 1e-4
