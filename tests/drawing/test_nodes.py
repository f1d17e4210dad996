"""Candidates for simpler outlines, and which of them are taken."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from tests.drawing.drawings import BLUE, GOLD, RED, WHITE, Outline, disc, drawing, logo, polygon
from tests.drawing.test_fit_outlines import assert_clean, psnr
from tests.drawing.trace.test_cubics import halves
from warpsplat.drawing import prices
from warpsplat.drawing.constraints import Drawing
from warpsplat.drawing.fit_outlines import OutlineFit
from warpsplat.drawing.model import before_fit
from warpsplat.drawing.nodes import STRAIGHT, WITHOUT, Edits, applied, candidates
from warpsplat.drawing.tidy import finish_drawing, tidied
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Canvas
from warpsplat.scene.attributes import Joint
from warpsplat.svg.read import load_scene
from warpsplat.svg.write import rounded, write_svg


def split(made: Drawing) -> Drawing:
    """Return a drawing with each piece in two."""
    scene, following = made.scene, 3 * made.following()
    on = np.arange(0, len(scene.points), 3)
    outlines: dict[int, list[Outline]] = {}
    contours = np.searchsorted(scene.starts, on, side="right").tolist()
    owners = np.searchsorted(scene.first, on, side="right").tolist()
    ends = zip(on.tolist(), following.tolist(), made.lines().tolist(), contours, owners, strict=True)
    for (owner, _), pieces in itertools.groupby(ends, lambda piece: (piece[4], piece[3])):
        points, joints = [], []
        for a, b, is_line, *_ in pieces:
            first, second = halves(scene.points[[a, a + 1, a + 2, b]].astype(float), 0.5)
            points += [*first[:3], *second[:3]]
            inner = [Joint.LINE_HANDLE] * 2 if is_line else [Joint.FREE] * 2
            joints += [made.joints[a], *inner, Joint.CORNER if is_line else Joint.SMOOTH, *inner]
        outlines.setdefault(owner - 1, []).append((np.array(points), joints))
    return drawing(scene.canvas, *((scene.colors[owner], own) for owner, own in outlines.items()))


def nodes(made: Drawing) -> int:
    return len(made.joints) // 3


def edits_of(made: Drawing, kind: int) -> Edits:
    edits = candidates(made, np.zeros((nodes(made), 2), np.bool_))
    return edits.take(edits.kind == kind)


def growth_of(made: Drawing, edits: Edits) -> np.ndarray:
    """In squares of canvas units, by length."""
    fit = OutlineFit(render(made.scene), made, Run(Backend.on("cpu", 1)))
    samples = fit.places()
    weight = np.full(len(samples.t), 1.0)
    return before_fit(replace(samples, weight=weight), made, edits)


CANVAS = Canvas(64, 48, WHITE)


def test_needless_nodes_cost_nothing() -> None:
    """Of a square all but its corners, of a disc every other."""
    square, ring = polygon((8, 8), (40, 8), (40, 40), (8, 40)), disc(30, 24, 15)
    for outline, saved, count in ((square, prices.LINE, 4), (ring, prices.CUBIC, 8)):
        made = split(drawing(CANVAS, (RED, [outline])))
        edits = edits_of(made, WITHOUT)
        assert set(edits.at.tolist()) == set(range(8))
        cheap = edits.take(growth_of(made, edits) < 0.1)
        assert len(cheap.at) == count
        assert set(cheap.saved.tolist()) == {saved}
        for i in range(count):
            left, keep = applied(made, cheap.take(np.array([i])))
            assert nodes(left) == nodes(made) - 1 == keep.sum()
            assert left.lines().sum() == (7 if outline is square else 0)


def test_an_outline_of_two_pieces_keeps_them() -> None:
    lens = [*disc(30, 24, 15)[0][:6]]
    lens[4:] = [np.array([20.0, 60.0]), np.array([40.0, 60.0])]
    made = drawing(CANVAS, (RED, [(np.array(lens), [Joint.CORNER, Joint.FREE, Joint.FREE] * 2)]))
    assert not len(edits_of(made, WITHOUT).at)


def test_almost_straight_cubics_cost_little() -> None:
    outline, joints = polygon((8, 8), (40, 8), (40, 40), (8, 40))
    bent = outline.copy()
    bent[1:3, 1] += (0.4, 0.4)
    bent[4:6, 0] += (8, 8)
    made = drawing(CANVAS, (RED, [(bent, [Joint.CORNER, Joint.FREE, Joint.FREE] * 2 + joints[6:])]))
    edits = edits_of(made, STRAIGHT)
    growth = growth_of(made, edits)
    assert growth[0] < 0.01 * growth[1]
    left, _ = applied(made, edits.take(growth < growth.max()))
    assert left.lines().tolist() == [True, False, True, True]


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
    np.testing.assert_array_equal(rounded(drawn.scene, finished.per_pixel).points, drawn.scene.points)
    text = write_svg(drawn.scene, per_pixel=finished.per_pixel)
    back, _ = load_scene(text, 64, 64, "a.svg")
    assert write_svg(replace(back, canvas=drawn.scene.canvas), per_pixel=finished.per_pixel) == text


def test_what_is_seen_stays(device: str) -> None:
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
