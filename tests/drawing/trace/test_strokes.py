"""Ink, the areas, dots and lines in it, and the way of the pen."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.trace.line_art import CROSS, drawn, traced
from warpsplat.drawing.line_art import with_equal_widths
from warpsplat.drawing.strokes.broad import split
from warpsplat.drawing.strokes.ink import find_ink
from warpsplat.drawing.strokes.lines import trace_ink
from warpsplat.drawing.strokes.tour import toured
from warpsplat.scene import Canvas, FloatArray, Kind, Scene

PAPERS = {"plain": 1, "dark": 0, "clear": None}
"""Pictures of ink, and their paper's lightness, if it has one."""


def inked(kind: str) -> FloatArray:
    rng, clean = np.random.default_rng(0), drawn(CROSS)
    if kind in PAPERS:
        clear = np.concatenate([0 * clean, 1 - clean[..., :1]], axis=2)
        return {"plain": clean, "dark": 1 - clean, "clear": clear}[kind]
    if kind == "unevenly lit and noisy":
        light = np.linspace(0.55, 0.9, clean.shape[1])[None, :, None]
        return np.clip(clean * light + rng.normal(0, 0.02, clean.shape), 0, 1).astype(np.float32)
    image = drawn('<path d="M0 0H60V72H0Z" fill="#6bf" stroke="none"/>' + CROSS)
    crayon = (image[..., 2] > 0.9) & (image[..., 0] < 0.6)
    image[crayon] += rng.uniform(-0.3, 0.2, (int(crayon.sum()), 1)).astype(np.float32) * (1, 0.5, 0)
    return np.clip(image, 0, 1).astype(np.float32)


@pytest.mark.parametrize("kind", [*PAPERS, "unevenly lit and noisy", "coloured in"])
def test_ink_is_told_from_paper(kind: str) -> None:
    """What is coloured in is paper, too."""
    ink, share = find_ink(inked(kind)), 1 - drawn(CROSS)[..., 0]
    assert kind not in PAPERS or ink.paper == pytest.approx(PAPERS[kind])
    assert ink.mask[share > 0.5].mean() > 0.9
    wrong = (ink.mask != (share > 0.5)).mean()
    assert wrong < (0.01 if kind in PAPERS else 0.02 if "lit" in kind else 0.05)
    assert kind != "plain" or np.abs(ink.cover - share).max() < 0.1


def test_partly_covered_edges_of_broad_ink_are_measured() -> None:
    image = drawn('<path d="M20.25 12H60V60H20.25z" fill="#000" stroke="none"/><path d="M70 5V60"/>')
    areas = split(find_ink(image), mixed=True).areas
    assert areas is not None
    assert np.allclose(areas.cover[20:50, 20], 0.75, atol=0.02)


def test_ends_far_from_areas_stay() -> None:
    """A line reaches beyond its own width into the area at one of its ends."""
    image = drawn('<path d="M4 16H36V56H4Z" fill="#000" stroke="none"/><path d="M30 36H80"/>')
    (line,) = trace_ink(find_ink(image, mixed=True), mixed=True).lines
    near, far = sorted(line.points[[0, -1], 0].tolist())
    assert 30 < near < 35
    assert far == pytest.approx(80, abs=1.2)


THIN = '<path d="M8 10H88M8 62H88" stroke-width="1"/>'


@pytest.mark.parametrize("paths", ["", '<path d="M8 36H88" stroke-width="1"/>'])
def test_a_dot_beside_lines_and_on_one(paths: str) -> None:
    disc = '<circle cx="48.3" cy="36.4" r="5" fill="#000" stroke="none"/>'
    image = drawn(paths + THIN + disc)
    parts = split(find_ink(image), mixed=False)
    (dot,) = parts.dots
    assert not parts.rings
    assert dot.width == pytest.approx(10, abs=0.3)
    assert dot.place == pytest.approx((48.3, 36.4), abs=0.1)
    assert parts.apart is not None
    assert parts.apart[36, 48]
    assert not parts.apart[36, 60]


@pytest.mark.parametrize(
    ("paths", "has_rings"),
    [
        (f'{THIN}<path d="M42 30H54V42H42Z" fill="#000" stroke="none"/>', True),
        ('<circle cx="48" cy="36" r="20" stroke-width="2.9"/>', False),
    ],
    ids=["square", "broader line"],
)
def test_shapes_that_are_not_dots(paths: str, has_rings: bool) -> None:
    parts = split(find_ink(drawn(paths)), mixed=False)
    assert bool(parts.rings) == has_rings
    assert not parts.dots


@pytest.mark.parametrize("width", [1.5, 2, 4, 6])
def test_widths_are_measured(width: float) -> None:
    (line,) = trace_ink(find_ink(drawn(f'<path d="M15 20Q50 5 80 55" stroke-width="{width}"/>'))).lines
    assert line.width == pytest.approx(width, abs=0.2)


def test_corners_are_kept() -> None:
    """A square of four lines: four cubics."""
    scene = traced(drawn('<rect x="20" y="12" width="50" height="44" stroke-linejoin="round"/>'))
    assert scene.closed.tolist() == [1]
    corners = scene.points[::3]
    for place in ((20, 12), (70, 12), (70, 56), (20, 56)):
        assert np.hypot(*(corners - place).T).min() < 1.2
    assert len(corners) <= 6


LOOP = '<path d="M8 60C40 70 80 40 60 16C48 2 30 16 44 36C56 54 80 60 90 40"/>'
SPIRAL = (
    '<path d="M48 36C48 28 60 28 60 38C60 50 36 50 36 36C36 18 72 18 72 38C72 64 24 64 24 36"/>'
    '<path d="M6 20L92 48"/>'
)
SHARP = '<path d="M34 8L28 64M64 8L58 64M12 24H84M10 46H82"/>'
NET = "".join(f'<path d="M{10 + 9 * i} 64L{26 + 9 * i} 8M8 {14 + 10 * i}H88"/>' for i in range(5))


@pytest.mark.parametrize(
    ("paths", "count"),
    [
        (CROSS, 2),
        ('<path d="M6 30L90 42M6 42L90 30"/>', 2),
        (SHARP, 4),
        ('<circle cx="48" cy="36" r="22"/><path d="M10 50L86 20"/>', 2),
        ('<path d="M70 12H26V60H70M26 35H60" stroke-width="5" stroke-linejoin="round"/>', 2),
        ('<path d="M10 20H86M48 20V62"/>', 2),
        ('<path d="M20 12L76 60M22 58L78 16M48 8V66"/>', 3),
        ('<path d="M20 10L34 62L48 10L62 62L76 10"/>', 1),
        ('<path d="M28 62L48 10L68 62M35 44H61"/>', 2),
        ('<path d="M36 10L48 40L60 10M48 40V64"/>', 2),
        ('<path d="M10 50H86M30 50V34M50 50V36M70 50V28"/>', 4),
        ("".join(f'<path d="M{8 + 7 * i} 62L{28 + 7 * i} 10"/>' for i in range(9)), 9),
        (SPIRAL, 2),
        (LOOP, 1),
        (NET.replace("<path", '<path stroke-width="1.5"'), 10),
    ],
)
@pytest.mark.parametrize("is_grey", [True, False])
def test_each_drawn_line_is_one_stroke(paths: str, count: int, is_grey: bool) -> None:
    image = drawn(paths)
    scene = traced(image if is_grey else np.round(image))
    assert len(scene) == count
    if is_grey:
        assert np.ptp(scene.widths) < 0.4


def test_strokes_about_as_wide_have_one_width() -> None:
    points = np.array([[[8, y], [20, y], [35, y], [80, y]] for y in (10, 20, 30, 40)], np.float32)
    strokes = Scene.uniform(Kind.STROKE, Canvas(96, 72, None), points)
    strokes = replace(strokes, widths=np.array([3, 3.1, 2.9, 5], np.float32))
    assert with_equal_widths(strokes).widths == pytest.approx([3, 3, 3, 5], abs=1e-3)


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
