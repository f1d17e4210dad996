"""Scenes, and what is measured of their shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.reference.curves import spline_at
from tests.scenes import canvas, contours_scene, disc, mixed_scene, random_scene, styled_scene, with_gradients
from warpsplat.scene import ATTRIBUTES, NO_DASHES, TRAITS, Basis, Cap, Join, Kind, Rule, Scene
from warpsplat.scene.geometry import areas, bounds, enlarged, flatten
from warpsplat.scene.geometry import beziers as beziers_of


def test_arrays_must_fit() -> None:
    scene = with_gradients(random_scene(Kind.FILL))
    for attribute in ATTRIBUTES:
        value = getattr(scene, attribute.name)
        with pytest.raises(ValueError, match=f"{attribute.name} "):
            replace(scene, **{attribute.name: np.concatenate([value, value[:1]])})
    with pytest.raises(ValueError, match="opacities"):
        replace(scene, opacities=np.ones((4, 3), np.float32))
    with pytest.raises(ValueError, match="basis has shape"):
        replace(scene, basis=scene.basis[1:])
    with pytest.raises(ValueError, match="first does not run from 0 to 48 points in 5 numbers"):
        replace(scene, first=scene.first[:-1])


@pytest.mark.parametrize(
    ("basis", "kind", "counts"),
    [(Basis.CUBIC, Kind.FILL, (0, 4, 7)), (Basis.CUBIC, Kind.STROKE, (1, 6, 12))]
    + [(Basis.SPLINE, kind, (2,)) for kind in Kind],
)
def test_shapes_have_whole_curves(basis: Basis, kind: Kind, counts: tuple[int, ...]) -> None:
    for count in counts:
        with pytest.raises(ValueError, match=f"a {kind.name.lower()} cannot have {count} control points"):
            Scene.uniform(kind, canvas(9, 9), np.zeros((2, count, 2), np.float32), basis)
    scene = Scene.uniform(kind, canvas(9, 9), np.zeros((2, 5, 2), np.float32), Basis.SPLINE)
    assert scene.bezier_counts().tolist() == 2 * [5 if kind == Kind.FILL else 3]


def test_take_and_append() -> None:
    """Shapes of different lengths keep their rows, in any order, even twice."""
    scene = mixed_scene(seed=1)
    index = np.array([5, 0, 5, 3])
    taken = scene.take(index)
    both = scene.append(taken)
    assert len(both) == len(scene) + 4
    for i, j in [*enumerate(range(len(scene))), *enumerate(index, len(scene))]:
        np.testing.assert_array_equal(both.points_of(i), scene.points_of(j))
        assert (both.kind[i], both.basis[i]) == (scene.kind[j], scene.basis[j])
        for name in ("colors", "opacities", "widths"):
            np.testing.assert_array_equal(getattr(both, name)[i], getattr(scene, name)[j])
    assert both.canvas is scene.canvas
    empty = scene.take(np.arange(0))
    assert len(empty) == len(empty.points) == 0
    np.testing.assert_array_equal(empty.append(scene).points, scene.points)


def test_contours_and_traits_go_with_their_shapes() -> None:
    scene = contours_scene(Kind.FILL, Rule.EVENODD).append(mixed_scene())
    scene = replace(scene, cap=np.arange(len(scene), dtype=np.int32) % len(Cap))
    index = np.array([7, 1, 0, 7])
    for taken in (scene.take(index), scene.take(index[:2]).append(scene.take(index[2:]))):
        for i, j in enumerate(index):
            for (a, closed), (b, as_before) in zip(taken.contours_of(i), scene.contours_of(j), strict=True):
                np.testing.assert_array_equal(a, b)
                assert closed == as_before
            for trait in TRAITS:
                assert getattr(taken, trait.name)[i] == getattr(scene, trait.name)[j]
    assert scene.contour_beziers().tolist()[:3] == [5, 6, 7]
    assert scene.bezier_counts()[0] == 18


def test_dashes_of_two_scenes() -> None:
    """Each shape keeps its own pattern."""
    dash = np.array([0, NO_DASHES], np.int32)
    one = replace(random_scene(Kind.STROKE, 2), dash=dash, dashes=((0.0, 3.0, 2.0),))
    two = replace(one, dashes=((1.0, 5.0, 5.0),))
    both = one.append(two)
    patterns = [both.dashes[d] if d >= 0 else None for d in both.dash]
    assert patterns == [(0.0, 3.0, 2.0), None, (1.0, 5.0, 5.0), None]
    assert one.append(one).dashes == one.dashes


def test_a_shape_without_its_twin_is_alone() -> None:
    pair = random_scene(Kind.FILL, 2)
    pair = replace(pair, points=np.tile(pair.points_of(0), (2, 1)), twin=np.array([0, 1], np.int32))
    assert pair.take(np.array([0, 1])).twin.tolist() == [0, 1]
    assert pair.take(np.array([1])).twin.tolist() == [0]
    assert pair.take(np.array([1, 0])).twin.tolist() == [0, 0]
    with pytest.raises(ValueError, match="shape 0 has not the points of the one before it"):
        replace(pair, twin=np.array([1, 0], np.int32))
    with pytest.raises(ValueError, match="not those of the shapes' contours"):
        replace(pair, starts=pair.starts[:-1])


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


def test_an_enlarged_scene_looks_the_same() -> None:
    """Dashes grow with their strokes, and pixel art stays crisp."""
    scene = styled_scene(Cap.BUTT, Join.MITER, 0)
    scene = replace(scene, canvas=replace(scene.canvas, crisp=True))
    large = enlarged(scene, 3, 3 * scene.canvas.width, 3 * scene.canvas.height)
    assert large.canvas.crisp
    np.testing.assert_allclose(large.dashes[0], 3 * np.array(scene.dashes[0]))
    np.testing.assert_allclose(areas(large), 9 * areas(scene), rtol=1e-4)
