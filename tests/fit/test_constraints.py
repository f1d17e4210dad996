"""What a drawing's outlines keep: the projection and its adjoint against NumPy in float64."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from tests.drawing.drawings import drawing, logo, polygon, seam
from tests.helpers import relative_error
from warpsplat.fit.constraints import AFTER, BEFORE, Constraints, Drawing, Keeper
from warpsplat.kernels.constants import NONE
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Parameters
from warpsplat.scene import Canvas
from warpsplat.scene.joints import Joint

DRAWINGS: dict[str, Callable[[], Drawing]] = {"logo": logo, "seam": seam}


def aligned(points: np.ndarray, p: int, j: int, k: int, free: int) -> None:
    """Handles of a smooth joint on its direction, in place."""
    back, ahead = points[p] - points[j], points[k] - points[p]
    if free == AFTER:
        u = back / np.linalg.norm(back)
    elif free == BEFORE:
        u = ahead / np.linalg.norm(ahead)
    else:
        u = np.linalg.eigh(np.outer(back, back) + np.outer(ahead, ahead))[1][:, 1]
        u = u * np.sign(u @ (back + ahead))
    if free & BEFORE:
        points[j] = points[p] - max(back @ u, 0.05) * u
    if free & AFTER:
        points[k] = points[p] + max(ahead @ u, 0.05) * u


def projected(points: np.ndarray, c: Constraints) -> np.ndarray:
    """Where the points may be."""
    points = points.copy()
    for joint in zip(c.joint_point, c.joint_before, c.joint_after, c.joint_free, strict=True):
        aligned(points, *joint)
    flat = points.reshape(-1)
    for i in range(len(c.tie_pinned)):
        members = c.tie_member[c.tie_first[i] : c.tie_first[i + 1]]
        flat[members] = flat[members[0]]
    for a in np.flatnonzero(c.line_end != NONE):
        b = c.line_end[a]
        points[a + 1], points[a + 2] = (2 * points[a] + points[b]) / 3, (points[a] + 2 * points[b]) / 3
    return points


def keeper_of(made: Drawing, device: str) -> tuple[Keeper, Parameters, Constraints]:
    parameters = Parameters(made.scene, Backend.on(device))
    constraints = Constraints.of(made)
    return Keeper(constraints, parameters), parameters, constraints


def put(parameters: Parameters, what: str, values: np.ndarray) -> None:
    getattr(parameters.groups["points"], what).assign(values.astype(np.float32))


@pytest.mark.parametrize("name", DRAWINGS)
def test_points_are_brought_to_where_they_may_be(device: str, name: str) -> None:
    made = DRAWINGS[name]()
    keeper, parameters, constraints = keeper_of(made, device)
    np.testing.assert_allclose(
        projected(made.scene.points.astype(float), constraints), made.scene.points, atol=1e-4
    )
    off = made.scene.points + np.random.default_rng(1).normal(0, 0.7, made.scene.points.shape)
    put(parameters, "value", off)
    keeper.project()
    np.testing.assert_allclose(parameters.scene().points, projected(off, constraints), atol=1e-4)
    keeper.project()
    np.testing.assert_allclose(
        parameters.scene().points, projected(projected(off, constraints), constraints), atol=1e-4
    )


@pytest.mark.parametrize("name", DRAWINGS)
def test_the_gradient_is_that_of_what_is_free(device: str, name: str) -> None:
    """Against central differences of the projection, along directions in which ties move as one."""
    made = DRAWINGS[name]()
    keeper, parameters, constraints = keeper_of(made, device)
    rng = np.random.default_rng(2)
    weights = rng.normal(size=made.scene.points.shape)
    at = projected(made.scene.points.astype(float), constraints)
    put(parameters, "grad", weights)
    program = parameters.backend.program()
    keeper.record_adjoint(program)
    program.run()
    got = parameters.gradients()["points"].reshape(-1)
    first = constraints.tie_first
    want = np.zeros(got.shape)
    leader = np.arange(len(want))
    for i in range(len(first) - 1):
        leader[constraints.tie_member[first[i] : first[i + 1]]] = constraints.tie_member[first[i]]
    pinned = set(constraints.tie_member[first[:-1][constraints.tie_pinned == 1]].tolist())
    for i in range(len(want)):
        shift = 1e-4 * (leader == leader[i]).reshape(-1, 2) * (leader[i] not in pinned)
        ends = [projected(at + sign * shift, constraints) for sign in (1, -1)]
        want[i] = (weights * (ends[0] - ends[1])).sum() / 2e-4
    laid = np.repeat(constraints.laid, 2)
    assert relative_error(got[~laid], want[~laid]) < 1e-4
    assert not want[laid].any()
    assert np.abs(want[~laid]).max() > 1


def test_what_binds_what() -> None:
    """The third region's corner lies on the seam's smooth joint, whose handles are those of two regions."""
    made = seam()
    constraints = Constraints.of(made)
    (p,) = constraints.joint_point
    assert made.joints[p] == Joint.SMOOTH
    assert constraints.joint_free.tolist() == [BEFORE | AFTER]
    groups = np.split(constraints.tie_member, constraints.tie_first[1:-1])
    middle = next(g for g in groups if 2 * p in g)
    np.testing.assert_array_equal(made.scene.points[middle // 2], [[24, 16]] * 3)
    handles = [g for g in groups if g[0] // 2 in (constraints.joint_before[0], constraints.joint_after[0])]
    assert [len(g) for g in handles] == [2] * 4, "the handle whose joint binds it is first"
    level = next(g for g in groups if 2 * p + 1 in g)
    np.testing.assert_array_equal(made.scene.points.reshape(-1)[level], 16.0)
    assert len(level) == 5, "both ends of the line in both regions, and the joint"
    for group, pinned in zip(groups, constraints.tie_pinned, strict=True):
        values = made.scene.points.reshape(-1)[group]
        size = np.array([48, 32])[group % 2]
        assert pinned == ((values == 0) | (values == size)).any()


def test_levels_and_uprights_of_a_rounded_square_are_ties() -> None:
    """Its joints bind no handles by themselves: the tangents are level or upright, and stay so."""
    made = drawing(Canvas(64, 64, None), ((0, 0, 0), logo_square()))
    constraints = Constraints.of(made)
    assert len(constraints.joint_point) == 0
    assert np.diff(constraints.tie_first).tolist() == [4] * 4, "two ends and two handles a side"


def logo_square() -> list[tuple[np.ndarray, list[Joint]]]:
    made = logo()
    rows = slice(0, int(made.scene.first[1]))
    return [(made.scene.points[rows].astype(float), [Joint(j) for j in made.joints[rows]])]


def test_a_line_of_one_region_is_one_of_all() -> None:
    made = seam()
    joints = made.joints.copy()
    lower = slice(int(made.scene.first[2]), None)
    joints[lower][joints[lower] == Joint.LINE_HANDLE] = Joint.FREE
    on, _ = made.links()
    lines = Drawing(made.scene, joints, made.same).lines()
    assert lines[on < made.scene.first[2]].sum() == 6
    assert lines[on >= made.scene.first[2]].sum() == 1


@pytest.mark.parametrize("field", ["joints", "same"])
def test_arrays_that_do_not_fit(field: str) -> None:
    made = drawing(Canvas(9, 9, None), ((0, 0, 0), [polygon((1, 1), (8, 1), (4, 8))]))
    arrays = {"joints": made.joints, "same": made.same}
    arrays[field] = arrays[field][:-1]
    with pytest.raises(ValueError, match=field):
        Drawing(made.scene, **arrays)


@pytest.mark.parametrize(("line", "bound"), [(10.0, True), (1.0, False)])
def test_a_line_of_no_length_says_no_direction(line: float, bound: bool) -> None:
    """The rounding of its end would turn a handle twenty times as long by pixels."""
    points = np.array(
        [[10, 10], [10, 10], [10, 10], [12, 12], [26, 24], [40, 20], [50, 50], [40, 50], [20, 40]]
    )
    outline = points.astype(float)
    outline[3] = outline[0] + line * np.array([0.6, 0.8])
    outline[1:3] = outline[0] + np.outer([1 / 3, 2 / 3], outline[3] - outline[0])
    outline[4] = outline[3] + 20 * np.array([0.6, 0.8])
    kinds = [Joint.CORNER, *2 * [Joint.LINE_HANDLE], Joint.SMOOTH, *2 * [Joint.FREE], Joint.CORNER]
    made = drawing(Canvas(64, 64, None), ((0, 0, 0), [(outline, [*kinds, *2 * [Joint.FREE]])]))
    assert (Constraints.of(made).joint_point.tolist() == [3]) is bound
