"""What prices say that things take, beside what they take in real files."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import BLUE, WHITE, Outline, disc, drawing, polygon, rounded
from warpsplat.drawing import prices
from warpsplat.drawing.constraints import Drawing
from warpsplat.scene import Canvas, Paint
from warpsplat.scene.attributes import Joint
from warpsplat.svg.primitives import primitives
from warpsplat.svg.sizes import USE
from warpsplat.svg.write import write_svg

CANVAS = Canvas(400, 400, WHITE)
COUNT = 100


def written(made: Drawing, **options: bool) -> int:
    return len(write_svg(made.scene, per_pixel=10, **options))


def ring(corners: int, seed: int, *, bent: bool = False, size: float = 50.0) -> Outline:
    """A closed outline of lines, or of cubics, around somewhere."""
    rng = np.random.default_rng(seed)
    around = np.sort(rng.random(corners)) * 2 * np.pi
    ends = rng.uniform(60, 340, 2) + size * rng.uniform(0.5, 1, (corners, 1)) * np.stack(
        [np.cos(around), np.sin(around)], 1
    )
    points, joints = polygon(*ends)
    if bent:
        points = points + np.where(np.arange(3 * corners)[:, None] % 3, rng.normal(0, 5, points.shape), 0)
        joints = [Joint.CORNER, Joint.FREE, Joint.FREE] * corners
    return points, joints


def of_rings(corners: int, **options: bool) -> Drawing:
    return drawing(CANVAS, (BLUE, [ring(corners, seed, **options) for seed in range(COUNT)]))


def each(more: Drawing, fewer: Drawing, count: int = COUNT) -> float:
    return (written(more) - written(fewer)) / count


def test_a_node_takes_what_it_costs() -> None:
    """A cubic, a line, and the handles between the two, of the size that they have in logos."""
    lines, cubics = (
        each(of_rings(9), of_rings(6), 3 * COUNT),
        each(of_rings(9, bent=True), of_rings(6, bent=True), 3 * COUNT),
    )
    assert lines == pytest.approx(prices.LINE, rel=0.15)
    assert cubics == pytest.approx(prices.CUBIC, rel=0.15)
    assert (written(of_rings(6, bent=True)) - written(of_rings(6))) / (6 * COUNT) == pytest.approx(
        prices.HANDLES, rel=0.25
    )


def test_a_level_line_takes_what_it_costs() -> None:
    """Stairs of level and upright lines."""
    steps = np.random.default_rng(0).uniform(5, 25, (COUNT, 2, 6))

    def stairs(count: int) -> Drawing:
        found = []
        for x, y in 40 + np.cumsum(steps, axis=2):
            corners = [point for i in range(count) for point in ((x[i], y[i]), (x[i + 1], y[i]))]
            found.append(polygon(*corners, (x[count], y[count]), (x[0], y[count])))
        return drawing(CANVAS, (BLUE, found))

    assert each(stairs(5), stairs(2), 6 * COUNT) == pytest.approx(prices.LEVEL, rel=0.25)


def test_a_region_takes_what_it_costs() -> None:
    """A path of four cubics, and one in a gradient."""
    rings = [ring(4, seed, bent=True) for seed in range(COUNT)]
    tones = np.random.default_rng(1).random((COUNT, 3))
    made = drawing(CANVAS, *((tuple(tone), [own]) for tone, own in zip(tones, rings, strict=True)))
    half = made.take(np.arange(0, COUNT, 2))
    assert each(made, half, COUNT // 2) == pytest.approx(prices.REGION, rel=0.15)
    frames = np.random.default_rng(2).uniform(50, 350, (COUNT, 6)).astype(np.float32)
    shaded = replace(
        made.scene,
        paint=np.full(COUNT, Paint.LINEAR, np.int32),
        frames=frames,
        stop_first=2 * np.arange(COUNT + 1, dtype=np.int32),
        stop_offsets=np.tile(np.array([0, 1], np.float32), COUNT),
        stop_colors=np.random.default_rng(3).random((2 * COUNT, 3)).astype(np.float32),
        stop_opacities=np.ones(2 * COUNT, np.float32),
    )
    taken = (written(replace(made, scene=shaded)) - written(half)) / COUNT + prices.REGION / 2
    assert taken == pytest.approx(prices.SHADED, rel=0.15)


@pytest.mark.parametrize(
    "outline",
    [disc(100, 100, 30), rounded(100, 100, 30, 8), polygon((70, 80), (130, 80), (130, 120), (70, 120))],
)
def test_a_basic_shape_takes_what_it_costs(outline: Outline) -> None:
    made = drawing(CANVAS, (BLUE, [outline]))
    ((_, shape),) = primitives(made.scene, 10.0 * made.scene.points.astype(np.float64))
    whole, other = shape.rounded(), ring(5, 0)
    assert whole is not None
    bare = written(made.take(np.zeros(0, np.intp))) + len('<path d="" fill="#03c"/>')
    joined = drawing(CANVAS, (BLUE, [other, outline])), drawing(CANVAS, (BLUE, [other]))
    taken = min(written(made) - bare, each(*joined, 1))
    assert abs(taken - prices.of_primitive(whole)) <= 4


def test_an_equal_outline_takes_what_it_costs() -> None:
    one, joints = ring(7, 0, bent=True)
    shifts = np.random.default_rng(4).integers(-40, 40, (COUNT, 2))
    made = drawing(CANVAS, *((BLUE, [(np.round(one, 1) + shift, joints)]) for shift in shifts))
    few = made.take(np.arange(COUNT // 2))
    taken = (written(made, symbols=True) - written(few, symbols=True)) / (COUNT // 2)
    assert taken == pytest.approx(USE, abs=3)


def test_what_a_byte_is_worth() -> None:
    """Half of the error for twice the bytes, at 1.8 dB; nothing less than the negligible error counts."""
    gained = 1e-3 - sum(prices.worth(1e-3 * 10 ** (-0.18 * math.log2(s / 1e3)), s) for s in range(1000, 2000))
    assert gained == pytest.approx(1e-3 * 10**-0.18, rel=0.01)
    assert (
        prices.worth(0, 1000) == prices.worth(prices.LEAST_ERROR, 1000) > prices.worth(0, 1000, negligible=0)
    )
    assert prices.worth(1e-3, 1000, price=3) == pytest.approx(3 * prices.worth(1e-3, 1000))
