"""Simpler outlines: needless nodes, basic shapes, equal outlines, and what all that takes in a file."""

from __future__ import annotations

import math
from dataclasses import replace

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
    logo,
    polygon,
    rounded,
    star,
)
from tests.drawing.test_fit_outlines import assert_clean, psnr
from tests.svg.foreign import load_scene
from warpsplat.drawing import prices
from warpsplat.drawing.constraints import Drawing
from warpsplat.drawing.fit_outlines import OutlineFit
from warpsplat.drawing.tidy import finish_drawing, tidied
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas, Paint
from warpsplat.scene.attributes import Joint
from warpsplat.svg.primitives import Primitive, primitives
from warpsplat.svg.write import rounded as rounded_scene
from warpsplat.svg.write import write_svg


def split(made: Drawing) -> Drawing:
    """Return a drawing with each piece in two."""
    a, b, c, d = made.cubics().transpose(1, 0, 2)
    ab, bc, cd = (a + b) / 2, (b + c) / 2, (c + d) / 2
    points = np.stack([a, ab, (ab + bc) / 2, (ab + 2 * bc + cd) / 4, (bc + cd) / 2, cd], axis=1)
    inner = np.where(made.lines(), Joint.LINE_HANDLE, Joint.FREE)
    middle = np.where(made.lines(), Joint.CORNER, Joint.SMOOTH)
    joints = np.stack([made.joints[::3], inner, inner, middle, inner, inner], axis=1)
    both = {"first": 2 * made.scene.first, "starts": 2 * made.scene.starts}
    scene = replace(made.scene, points=points.reshape(-1, 2).astype(np.float32), **both)
    return Drawing(scene, joints.ravel().astype(np.int32))


def nodes(made: Drawing) -> int:
    return len(made.joints) // 3


CANVAS = Canvas(64, 48, WHITE)


def test_a_logo_loses_its_needless_nodes_unless_it_is_a_draft(device: str) -> None:
    """Half of them; at the end it is as good, clean, and written and read as it is."""
    backend = Backend.on(device, 1)
    exact = logo(None)
    target = render(exact.scene, backend=backend)
    made = split(logo(None, spread=0.15))
    assert not make_settings("draft").tidy and make_settings().tidy
    draft = finish_drawing(target, made, Run(backend), tidy=False).drawing
    assert nodes(draft) == nodes(made)
    assert psnr(draft.scene, target, backend) > max(45, psnr(made.scene, target, backend) + 3)
    finished = finish_drawing(target, made, Run(backend))
    drawn = finished.drawing
    assert nodes(drawn) <= nodes(exact) + 4 < nodes(made) - 20
    assert psnr(drawn.scene, target, backend) > 45
    np.testing.assert_array_equal(rounded_scene(drawn.scene, finished.per_pixel).points, drawn.scene.points)
    text = write_svg(drawn.scene, per_pixel=finished.per_pixel)
    back, _ = load_scene(text, 64, 64, "a.svg")
    assert write_svg(replace(back, canvas=drawn.scene.canvas), per_pixel=finished.per_pixel) == text


def test_small_visible_details_stay(device: str) -> None:
    """Small notches of strong contrast are no needless nodes; and the result is clean."""
    backend = Backend.on(device, 1)
    notched = polygon((6, 6), (30, 6), (31, 9), (32, 6), (58, 6), (58, 40), (6, 40))
    exact = drawing(CANVAS, (BLUE, [notched]), (GOLD, [disc(30, 25, 9, 0.4)]))
    target = render(exact.scene, backend=backend)
    fit = OutlineFit(target, exact, Run(backend))
    made = tidied(fit)
    assert nodes(made) == nodes(exact)
    assert psnr(made.scene, target, backend) > 50
    assert_clean(made, made.scene)


SHEET = Canvas(80, 56, WHITE)


def found(made: Drawing, noise: float = 0.0) -> list[Primitive]:
    """Basic shapes of a drawing that begins a little off, on an image with some noise [levels]."""
    backend = Backend.on("cpu")
    target = render(made.scene, backend=backend)
    target = (target + np.random.default_rng(0).normal(0, noise / 255, target.shape)).astype(np.float32)
    moved = made.scene.points + np.random.default_rng(1).normal(0, 0.1, made.scene.points.shape)
    made.scene.points[:] = moved.astype(np.float32)
    done = finish_drawing(target, made, Run(backend)).drawing.scene
    return [one for _, one in primitives(done, done.points.astype(np.float64))]


@pytest.mark.parametrize("noise", [0, 6])
def test_nearly_basic_shapes_become_basic_shapes(noise: float) -> None:
    """Its size is that of the image's, and equal sizes are equal; so are the rings of a compound path."""
    scene = drawing(
        SHEET,
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


def test_shapes_that_differ_from_basic_ones_stay() -> None:
    """A disc that is flat below, and a square with one corner cut off."""
    flat, joints = disc(0, 0, 14)
    flat[:, 1] *= np.where(flat[:, 1] < 0, 1, 0.9)
    cut = polygon((44, 6), (64, 6), (64, 22), (60, 26), (44, 26))
    assert not found(drawing(SHEET, (RED, [(flat + 20, joints)]), (BLUE, [cut])))


def test_equal_outlines_of_a_noisy_image_are_equal() -> None:
    """Only where it is asked for; one that differs stays."""
    places = [(14.3, 14.1), (38.6, 13.7), (63.2, 14.4), (14.8, 41.2), (38.1, 40.6)]
    outlines = [*(star(x, y, 10, 4) for x, y in places), star(63, 41, 9, 5)]
    scene = drawing(SHEET, (RED, outlines)).scene
    backend = Backend.on("cpu")
    target = render(scene, backend=backend)
    target = (target + np.random.default_rng(0).normal(0, 8 / 255, target.shape)).astype(np.float32)
    for symbols in (False, True):
        made = drawing(SHEET, (RED, outlines), spread=0.2)
        done = finish_drawing(target, made, Run(backend), symbols=symbols)
        text = write_svg(done.drawing.scene, per_pixel=done.per_pixel, symbols=symbols)
        assert text.count("<use ") == (5 if symbols else 0)


LARGE = Canvas(400, 400, WHITE)
COUNT = 100


def written(made: Drawing, **options: bool) -> int:
    return len(write_svg(made.scene, per_pixel=10, **options))


def ring(corners: int, seed: int, *, bent: bool = False) -> Outline:
    """A closed outline of lines, or of cubics, around somewhere."""
    rng = np.random.default_rng(seed)
    around = np.sort(rng.random(corners)) * 2 * np.pi
    away = 50 * rng.uniform(0.5, 1, (corners, 1)) * np.stack([np.cos(around), np.sin(around)], axis=1)
    points, joints = polygon(*(rng.uniform(60, 340, 2) + away))
    if bent:
        points = points + np.where(np.arange(3 * corners)[:, None] % 3, rng.normal(0, 5, points.shape), 0)
        joints = [Joint.CORNER, Joint.FREE, Joint.FREE] * corners
    return points, joints


def of_rings(corners: int, **options: bool) -> Drawing:
    return drawing(LARGE, (BLUE, [ring(corners, seed, **options) for seed in range(COUNT)]))


def each(more: Drawing, fewer: Drawing, count: int = COUNT) -> float:
    return (written(more) - written(fewer)) / count


def test_the_price_of_a_node_matches_its_bytes() -> None:
    """A cubic, a line, and the handles between the two, of the size that they have in logos."""
    few, many, bent, more_bent = of_rings(6), of_rings(9), of_rings(6, bent=True), of_rings(9, bent=True)
    assert each(many, few, 3 * COUNT) == pytest.approx(prices.LINE, rel=0.15)
    assert each(more_bent, bent, 3 * COUNT) == pytest.approx(prices.CUBIC, rel=0.15)
    assert each(bent, few, 6 * COUNT) == pytest.approx(prices.HANDLES, rel=0.25)


def test_the_price_of_a_region_matches_its_bytes() -> None:
    """A path of four cubics, and one in a gradient."""
    rings = [ring(4, seed, bent=True) for seed in range(COUNT)]
    tones = np.random.default_rng(1).random((COUNT, 3))
    made = drawing(LARGE, *((tuple(tone), [own]) for tone, own in zip(tones, rings, strict=True)))
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
def test_the_price_of_a_basic_shape_matches_its_bytes(outline: Outline) -> None:
    made = drawing(LARGE, (BLUE, [outline]))
    ((_, whole),) = primitives(made.scene, 10.0 * made.scene.points.astype(np.float64), whole=True)
    other = ring(5, 0)
    bare = written(made.take(np.zeros(0, np.intp))) + len('<path d="" fill="#03c"/>')
    joined = drawing(LARGE, (BLUE, [other, outline])), drawing(LARGE, (BLUE, [other]))
    taken = min(written(made) - bare, each(*joined, 1))
    assert abs(taken - prices.of_primitive(whole)) <= 4


def test_the_worth_of_a_byte() -> None:
    """Half of the error for twice the bytes, at 1.8 dB; nothing less than the negligible error counts."""
    gained = 1e-3 - sum(prices.worth(1e-3 * 10 ** (-0.18 * math.log2(s / 1e3)), s) for s in range(1000, 2000))
    assert gained == pytest.approx(1e-3 * 10**-0.18, rel=0.01)
    assert (
        prices.worth(0, 1000) == prices.worth(prices.LEAST_ERROR, 1000) > prices.worth(0, 1000, negligible=0)
    )
    assert prices.worth(1e-3, 1000, price=3) == pytest.approx(3 * prices.worth(1e-3, 1000))
