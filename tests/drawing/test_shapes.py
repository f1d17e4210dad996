"""Circles, ellipses and rectangles of an image are exactly that, others are not."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.drawings import (
    BLUE,
    GOLD,
    RED,
    ROUND,
    WHITE,
    Outline,
    disc,
    drawing,
    polygon,
    rounded,
    star,
)
from warpsplat.drawing.constraints import Drawing
from warpsplat.drawing.shapes import FAMILIES, Family, nearest
from warpsplat.drawing.tidy import finish_drawing
from warpsplat.fit.problem import Run
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas
from warpsplat.svg.primitives import Primitive, primitives
from warpsplat.svg.write import write_svg

CANVAS = Canvas(80, 56, WHITE)


def found(made: Drawing, noise: float = 0.0) -> list[Primitive]:
    """Basic shapes of a drawing that begins a little off, on an image with some noise [levels]."""
    backend = Backend.on("cpu")
    target = render(made.scene, backend=backend)
    target = (target + np.random.default_rng(0).normal(0, noise / 255, target.shape)).astype(np.float32)
    moved = made.scene.points + np.random.default_rng(1).normal(0, 0.1, made.scene.points.shape)
    made.scene.points[:] = moved.astype(np.float32)
    done = finish_drawing(target, made, Run(backend)).drawing.scene
    return [one for _, one in primitives(done, done.points.astype(np.float64))]


def flat(x: float, y: float, radius: float) -> Outline:
    """A disc that is a tenth lower below than above."""
    points, _ = disc(0, 0, radius)
    points[:, 1] *= np.where(points[:, 1] < 0, 1, 0.9)
    return points + (x, y), ROUND * 4


@pytest.mark.parametrize("noise", [0, 6])
def test_what_is_nearly_a_shape_becomes_one(noise: float) -> None:
    """Its size is that of the image's, and equal sizes are equal; so are the rings of a compound path."""
    scene = drawing(
        CANVAS,
        (RED, [disc(15.3, 15.2, 10), (disc(15.3, 15.2, 5)[0][::-1][[-1, *range(11)]], ROUND * 4)]),
        (BLUE, [rounded(44, 15, 10, 3)]),
        (GOLD, [polygon((60, 5), (75, 5), (75, 25), (60, 25))]),
        *[(RED, [disc(12 + 14 * i, 42.4 + 0.02 * i, 5)]) for i in range(5)],
    )
    made = found(scene, noise)
    assert len(made) == 9
    assert sum(all(one.is_round) for one in made) == 7
    sizes = sorted((one.high[0] - one.low[0]) / 2 for one in made if all(one.is_round))
    assert len({round(size, 3) for size in sizes[:6]}) == 1
    np.testing.assert_allclose(sizes, [5] * 6 + [10], atol=0.1)
    square = next(one for one in made if one.radii[0] and not any(one.is_round))
    np.testing.assert_allclose([*square.low, *square.high, *square.radii], [34, 5, 54, 25, 3, 3], atol=0.3)


def test_what_an_image_shows_otherwise_stays() -> None:
    """A disc that is flat below, and a square with one corner cut off."""
    cut = polygon((44, 6), (64, 6), (64, 22), (60, 26), (44, 26))
    assert not found(drawing(CANVAS, (RED, [flat(20, 20, 14)]), (BLUE, [cut])))


VALUES = [30, 20, 12, 8], [30, 20, 9], [30, 20, 12, 6], [30, 20, 12, 8, 3]


@pytest.mark.parametrize(("family", "wanted"), list(zip(FAMILIES, VALUES, strict=True)))
def test_the_nearest_shape_is_the_one_that_it_was(family: Family, wanted: list[float]) -> None:
    """A tenth of the points may be anywhere: another shape may hide what is there."""
    made = family.shape(np.array(wanted, float))
    low, high, radii = np.array(made.low), np.array(made.high), np.array(made.radii)
    angle = np.linspace(0, 2 * np.pi, 96, endpoint=False)
    way = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    if radii[0]:
        points = (low + high) / 2 + np.sign(way) * ((high - low) / 2 - radii) + radii * way
    else:
        points = (low + high) / 2 + (high - low) / 2 * way / np.abs(way).max(axis=1, keepdims=True)
    points[:9] += (0, 3)
    values, off = nearest(family, points[None], np.ones((1, 96)))
    np.testing.assert_allclose(values[0], wanted, atol=0.15)
    assert off[0, 9:].max() < 0.2


def test_equal_outlines_of_a_noisy_image_are_equal() -> None:
    """Only where it is asked for; one that differs stays."""
    places = [(14.3, 14.1), (38.6, 13.7), (63.2, 14.4), (14.8, 41.2), (38.1, 40.6)]
    outlines = [*(star(x, y, 10, 4) for x, y in places), star(63, 41, 9, 5)]
    scene = drawing(CANVAS, (RED, outlines)).scene
    backend = Backend.on("cpu")
    target = render(scene, backend=backend)
    target = (target + np.random.default_rng(0).normal(0, 8 / 255, target.shape)).astype(np.float32)
    for symbols in (False, True):
        made = drawing(CANVAS, (RED, outlines), spread=0.2)
        done = finish_drawing(target, made, Run(backend), symbols=symbols)
        text = write_svg(done.drawing.scene, per_pixel=done.per_pixel, symbols=symbols)
        assert text.count("<use ") == (5 if symbols else 0)
