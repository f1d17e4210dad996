"""Outlines in the fewest characters."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from tests.drawing.drawings import logo, seam
from warpsplat.svg.commands import (
    Pair,
    Rings,
    Segment,
    choices,
    minus,
    plus,
    row,
    segments_of,
    shortest,
    shortest_ring,
)
from warpsplat.svg.data import cubic_data
from warpsplat.svg.paths import cubics
from warpsplat.svg.read import load_scene
from warpsplat.svg.write import GRIDS, rounded, write_svg


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


def test_a_closed_outline_begins_where_its_text_is_short() -> None:
    """At one of the better quarter of its starts."""
    chain = segments(3, 40)
    chain.append(Segment(chain[-1].end, None, chain[0].start))
    text, end = shortest_ring((3, 4), chain)
    turned = (chain[i:] + chain[:i] for i in range(len(chain)))
    texts = [f"{shortest((3, 4), one[:-1] if one[-1].handles is None else one)}z" for one in turned]
    assert text in texts
    assert len(text) <= sorted(map(len, texts))[len(texts) // 4]
    (drawn,) = cubics(text, keep_dots=True)
    assert tuple(drawn.points[0]) == tuple(drawn.points[-1]) == end


@pytest.mark.parametrize("seed", range(4))
def test_copies_of_a_ring_are_drawn_in_their_places(seed: int) -> None:
    chain = segments(seed, 9)
    chain.append(Segment(chain[-1].end, None, chain[0].start))
    rings = Rings()
    pen: Pair | None = None
    steps = [(0, 0), (900, -40), (1800, 7), (-2000, 300)]
    texts = []
    for step in steps:
        moved = [
            Segment(
                plus(a, step), handles and (plus(handles[0], step), plus(handles[1], step)), plus(b, step)
            )
            for a, handles, b in chain
        ]
        texts.append(rings.data(pen, moved)[0])
        best, _ = shortest_ring(pen, moved)
        assert len(texts[-1]) <= len(best) + 2
        pen = rings.data(pen, moved)[1]
    first, *others = cubics("".join(texts), keep_dots=True)
    for step, other in zip(steps[1:], others, strict=True):
        assert np.allclose(other.points - step, first.points)


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
