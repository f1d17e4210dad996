from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.reference.curves import spline_at
from tests.scenes import canvas, disc, mixed_scene, random_scene, styled_scene
from warpsplat.scene import Basis, Cap, Join, Kind, Scene
from warpsplat.scene.geometry import areas, bounds, enlarged, flatten
from warpsplat.scene.geometry import beziers as beziers_of


@pytest.mark.parametrize("cubics", [3, 4, 7])
def test_area_and_bounds_of_a_disc(cubics: int) -> None:
    scene = disc(10, 30, 15, cubics)
    assert areas(scene)[0] == pytest.approx(np.pi * 100, rel=0.02)
    np.testing.assert_allclose(bounds(scene)[0], [5, 5, 25, 25], atol=0.3)


def test_area_of_a_stroke_is_length_times_width() -> None:
    scene = random_scene(Kind.STROKE, count=1)
    line = np.stack([np.linspace(5, 35, 10), np.full(10, 9.0)], axis=1).astype(np.float32)
    straight = replace(scene, points=line, widths=np.array([4.0], np.float32))
    assert areas(straight)[0] == pytest.approx(120, rel=1e-4)
    np.testing.assert_allclose(bounds(straight)[0], [3, 7, 37, 11], atol=1e-4)


@pytest.mark.parametrize(
    ("kind", "beziers"),
    [(Kind.STROKE, 1), (Kind.STROKE, 2)] + [(kind, n) for kind in Kind for n in (3, 4, 12)],
)
def test_splines_are_flattened_where_they_are(kind: Kind, beziers: int) -> None:
    """Against de Boor's recursion, whose points the outline as cubics passes at the same parameters."""
    scene = random_scene(kind, 3, basis=Basis.SPLINE, beziers=beziers)
    (group,) = scene.alike()
    assert beziers_of(group.points, group.closed, Basis.SPLINE).shape == (3, beziers, 4, 2)
    lines = flatten(group.points, group.closed, Basis.SPLINE, pieces=5)
    t = torch.arange(5 * beziers + (kind == Kind.STROKE), dtype=torch.float64) / 5
    for line, points in zip(lines, group.points, strict=True):
        want = spline_at(torch.tensor(points, dtype=torch.float64), kind == Kind.FILL, t)
        np.testing.assert_allclose(line, want, atol=1e-5)


def test_area_of_a_splined_square() -> None:
    """Cut at its corners by parabolas: two thirds of each cut-off triangle of legs 5 are within."""
    corners = np.array([[[10, 10], [20, 10], [20, 20], [10, 20]]], np.float32)
    scene = Scene.uniform(Kind.FILL, canvas(30, 30), corners, Basis.SPLINE)
    assert areas(scene)[0] == pytest.approx(100 - 4 * 12.5 / 3, rel=0.01)
    np.testing.assert_allclose(bounds(scene)[0], [10, 10, 20, 20], atol=1e-5)


def test_shapes_of_all_lengths_are_measured_in_their_own_rows() -> None:
    scene = mixed_scene(seed=2)
    for i in range(len(scene)):
        one = scene.take(np.array([i]))
        assert areas(scene)[i] > 0
        np.testing.assert_allclose(areas(scene)[i], areas(one)[0], rtol=1e-5)
        np.testing.assert_allclose(bounds(scene)[i], bounds(one)[0], rtol=1e-5)


def test_an_enlarged_scene_looks_the_same() -> None:
    """Dashes grow with their strokes, and pixel art stays crisp."""
    scene = styled_scene(Cap.BUTT, Join.MITER, 0)
    scene = replace(scene, canvas=replace(scene.canvas, crisp=True))
    large = enlarged(scene, 3, 3 * scene.canvas.width, 3 * scene.canvas.height)
    assert large.canvas.crisp
    np.testing.assert_allclose(large.dashes[0], 3 * np.array(scene.dashes[0]))
    np.testing.assert_allclose(areas(large), 9 * areas(scene), rtol=1e-4)
