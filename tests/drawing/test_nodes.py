"""Candidates for simpler outlines, and which of them are taken."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.drawings import BLUE, GOLD, RED, WHITE, Outline, disc, drawing, logo, polygon, seam
from tests.drawing.test_fit_outlines import assert_clean, psnr
from tests.drawing.test_merge import halves
from warpsplat.drawing.cells import (
    ORIGIN,
    ROW_SPAN,
    Cells,
    by_cell,
    cells_around,
    columns_and_rows,
    joined,
    sum_within,
)
from warpsplat.drawing.nodes import Edit, Outlines, applied, turned
from warpsplat.drawing.tidy import apart, finish_drawing, rounds_for, tidied
from warpsplat.fit.constraints import Drawing
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.renderer import render
from warpsplat.rendering.tiles import to_tiles
from warpsplat.scene import Canvas
from warpsplat.scene.attributes import Joint
from warpsplat.svg.read import load_scene
from warpsplat.svg.write import rounded, write_svg


def cells_at(places: Sequence[tuple[int, int]]) -> Cells:
    """Those in columns and rows."""
    columns, rows = np.array(places).T
    return np.unique((columns + ORIGIN) * ROW_SPAN + rows + ORIGIN)


def split(made: Drawing) -> Drawing:
    """Return a drawing with each piece in two."""
    scene, on, following = made.scene, *made.links()
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


def edits_of(made: Drawing, kind: str) -> list[Edit]:
    return [edit for edit in Outlines(made).edits() if edit.kind == kind]


CANVAS = Canvas(64, 48, WHITE)


def test_needless_nodes_are_named() -> None:
    """Of a square all but its corners, of a disc every other; no corner."""
    square, ring = polygon((8, 8), (40, 8), (40, 40), (8, 40)), disc(30, 24, 15)
    assert not edits_of(drawing(CANVAS, (RED, [square])), "without")
    for outline, saved, count in ((square, 7, 4), (ring, 19, 7)):  # of a ring all but the first
        made = split(drawing(CANVAS, (RED, [outline])))
        edits = [edit for edit in edits_of(made, "without") if edit.off < 0.05]
        assert len(edits) == count
        assert {edit.saved for edit in edits} == {saved}
        for edit in edits:
            left = applied(made, [edit])
            assert nodes(left) == nodes(made) - 1
            assert left.lines().sum() == (7 if saved == 7 else 0)


def test_nodes_of_a_seam_go_in_all_shapes_at_once() -> None:
    """The place where the third region meets the others stays, and the corners of the canvas."""
    made = split(seam())
    edits = [edit for edit in edits_of(made, "without") if edit.off < 0.05]
    sides = [edit for edit in edits if len(edit.removed) == 3]
    shared = [edit for edit in edits if len(edit.removed) == 6]
    assert len(edits) == len(sides) + len(shared)
    assert len(shared) == 3, "of the two halves of the seam, and the line that meets it"
    left = applied(made, shared)
    for number in np.unique(left.same[left.same >= 0]):
        assert len(np.unique(left.scene.points[left.same == number], axis=0)) == 1


def test_almost_straight_cubics_are_named() -> None:
    outline, joints = polygon((8, 8), (40, 8), (40, 40), (8, 40))
    bent = outline.copy()
    bent[1:3, 1] += (0.4, 0.4)
    bent[4:6, 0] += (8, 8)
    made = drawing(CANVAS, (RED, [(bent, [Joint.CORNER, Joint.FREE, Joint.FREE] * 2 + joints[6:])]))
    (edit,) = edits_of(made, "straight")
    assert edit.off == pytest.approx(0.3, abs=0.05)
    assert applied(made, [edit]).lines().tolist() == [True, False, True, True]


def test_almost_level_lines_and_tangents_are_named() -> None:
    made = drawing(CANVAS, (RED, [polygon((8, 8), (40, 8.3), (38, 40), (8, 40))]))
    (edit,) = edits_of(made, "level")
    left = applied(made, [edit])
    assert left.scene.points[0, 1] == left.scene.points[3, 1]
    assert not edits_of(left, "level")
    slanted = drawing(CANVAS, (RED, [disc(30, 24, 15, 0.02)]))
    edits = edits_of(slanted, "tangent")
    assert len(edits) == 4
    assert not edits_of(applied(slanted, edits), "tangent")
    assert not edits_of(drawing(CANVAS, (RED, [disc(30, 24, 15, 0.3)])), "tangent")


def test_chosen_candidates_have_no_cell_in_common() -> None:
    edits = Outlines(split(logo())).edits()
    chosen = apart(edits)
    assert 1 < len(chosen) < len(edits)
    assert sum(len(edit.cells) for edit in chosen) == len(joined([edit.cells for edit in chosen]))
    assert all(np.intersect1d(edit.cells, joined([e.cells for e in chosen])).size for edit in edits)


def test_what_was_refused_is_not_measured_again() -> None:
    outlines = Outlines(split(logo()))
    edits = outlines.edits()
    refused = {edit.key for edit in edits[::2]}
    assert [e.key for e in outlines.edits(refused)] == [e.key for e in edits if e.key not in refused]
    assert not outlines.edits({edit.key for edit in edits})


def test_cells_around_cubics() -> None:
    """Those of its points and their neighbours, each by itself; also beyond the border."""
    level = np.array([(1, 1), (3, 1), (5, 1), (7, 1)], float)
    dot = np.full((4, 2), -0.5)
    first, second = cells_around(np.stack([level, dot]))
    columns, rows = columns_and_rows(first)
    assert sorted(zip(columns.tolist(), rows.tolist(), strict=True)) == [
        (x, y) for x in range(-1, 5) for y in range(-1, 2)
    ]
    assert second.tolist() == cells_at([(x, y) for x in (-2, -1, 0) for y in (-2, -1, 0)]).tolist()


def test_errors_within_an_edit() -> None:
    """Those of its cells, whole or cut by the border, none beyond."""
    errors = np.random.default_rng(0).random((7, 9))
    sums = by_cell(to_tiles(errors[..., None].astype(np.float32))[:, 0], Viewport(9, 7))
    for cells, want in (
        ([(0, 0), (4, 3)], errors[:2, :2].sum() + errors[6, 8]),
        ([(-1, 0), (-2, -2), (5, 1), (1, 4), (9, 9)], 0),
        ([(2, 1)], errors[2:4, 4:6].sum()),
    ):
        assert sum_within(sums, cells_at(cells)) == pytest.approx(want)


def test_large_pictures_have_fewer_rounds() -> None:
    assert [rounds_for(side * side) for side in (64, 1250, 2048, 10_000)] == [16, 16, 6, 4]


def test_turned_outlines_are_the_same() -> None:
    made = split(seam())
    again = turned(made)
    assert (again.scene.points != made.scene.points).any()
    for shape in range(len(made.scene)):
        rows = [sorted(map(tuple, d.scene.points_of(shape).tolist())) for d in (made, again)]
        assert rows[0] == rows[1]
    assert again.lines().sum() == made.lines().sum()


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
    made = tidied(target, exact, Run(backend))
    assert nodes(made) == nodes(exact)
    assert psnr(made.scene, target, backend) > 50
    assert_clean(made, made.scene)
