"""Contours do not cross themselves."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.drawings import RED, ROUND, WHITE, disc, drawing, polygon
from warpsplat.drawing.constraints import Constraints, Drawing
from warpsplat.drawing.crossings import Crossings, crossing
from warpsplat.drawing.fit_outlines import OutlineFit
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.problem import Run
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Canvas

CANVAS = Canvas(64, 48, WHITE)


def crosses(made: Drawing) -> list[bool]:
    return crossing(made.cubics(), made.following(), made.contour()).tolist()


def test_crossings_are_found_within_contours_only() -> None:
    bow = polygon((30, 5), (50, 25), (50, 5), (30, 25))
    square, across = polygon((5, 5), (15, 5), (15, 15), (5, 15)), polygon((10, 10), (20, 10), (20, 20))
    made = drawing(CANVAS, (RED, [bow, square, across, disc(40, 36, 8)]))
    assert crosses(made) == [True, False, True] + [False] * 12
    points = np.array([(10, 30), (40, 5), (0, 5), (30, 30), (28, 34), (12, 34)], float)
    assert crosses(drawing(CANVAS, (RED, [(points, ROUND * 2)]))) == [True, False], "a cubic with itself"


def test_only_what_would_cross_is_taken_back() -> None:
    """A corner of a square that moves across the other side stays; one elsewhere moves."""
    made = drawing(CANVAS, (RED, [polygon((5, 6), (15, 5), (16, 15), (6, 16))]), (RED, [disc(40, 24, 8)]))
    constraints, before = Constraints(made), made.scene.points.astype(float)
    moved = before + (1, 1)
    moved[0] = (20, 12)
    moved = constraints.project(moved)
    after, refused = Crossings(made, before).refuse(before, moved, constraints)
    assert refused[:4].any()
    assert not refused[4:].any()
    np.testing.assert_array_equal(after[12:], moved[12:])
    assert not Crossings(made, before).new(after).any()


@pytest.mark.parametrize("seed", range(2))
def test_fits_of_noise_do_not_cross(seed: int) -> None:
    """Small regions of all shapes: their outlines have nothing to hold on to."""
    rng = np.random.default_rng(seed)
    colors = rng.uniform(0, 1, (4, 3)).astype(np.float32)
    image = colors[rng.integers(0, 4, (12, 12)).repeat(3, 0).repeat(3, 1)]
    traced = trace(image)
    made = Drawing(traced.scene, traced.joints)
    at_first, run = sum(crosses(made)), Run(Backend.on("cpu"))
    fit = OutlineFit(image, made, run)
    fit.advance(run, 16, 4)
    fit.roam(run, 40)
    assert sum(crosses(fit.drawing)) <= at_first
