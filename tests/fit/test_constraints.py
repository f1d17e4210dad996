"""Constraints of a drawing's outlines: the projection and its adjoint against NumPy in float64."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.drawings import logo, seam
from tests.helpers import relative_error
from warpsplat.fit.constraints import AFTER, BEFORE, Constraints, Drawing, Projection
from warpsplat.kernels.constants import NONE
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Parameters
from warpsplat.scene.attributes import Joint

DRAWINGS = pytest.mark.parametrize("made", [logo(), seam()], ids=["logo", "seam"])


def align(points: np.ndarray, p: int, j: int, k: int, free: int) -> None:
    """Turn the handles of a smooth joint into its direction, in place."""
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
    points = points.copy()
    for joint in zip(c.joint_point, c.joint_before, c.joint_after, c.joint_free, strict=True):
        align(points, *joint)
    flat = points.reshape(-1)
    for members in ties_of(c):
        flat[members] = flat[members[0]]
    for a in np.flatnonzero(c.line_end != NONE):
        b = c.line_end[a]
        points[a + 1], points[a + 2] = (2 * points[a] + points[b]) / 3, (points[a] + 2 * points[b]) / 3
    return points


def ties_of(c: Constraints) -> list[np.ndarray]:
    """Return the coordinates of each tie."""
    return np.split(c.tie_member, c.tie_first[1:-1])


def projection_of(made: Drawing, device: str) -> tuple[Projection, Parameters, Constraints]:
    parameters = Parameters(made.scene, Backend.on(device))
    constraints = Constraints.of(made)
    return Projection(constraints, parameters), parameters, constraints


@DRAWINGS
def test_points_are_projected(device: str, made: Drawing) -> None:
    projection, parameters, constraints = projection_of(made, device)
    exact = made.scene.points.astype(float)
    np.testing.assert_allclose(projected(exact, constraints), exact, atol=1e-4)
    wanted = exact + np.random.default_rng(1).normal(0, 0.7, exact.shape)
    parameters.groups["points"].value.assign(wanted.astype(np.float32))
    for _ in range(2):
        wanted = projected(wanted, constraints)
        projection.project()
        np.testing.assert_allclose(parameters.scene().points, wanted, atol=1e-4)


@DRAWINGS
def test_the_gradient_is_that_of_the_free_coordinates(device: str, made: Drawing) -> None:
    """Against central differences of the projection, along directions in which ties move as one."""
    projection, parameters, constraints = projection_of(made, device)
    weights = np.random.default_rng(2).normal(size=made.scene.points.shape)
    at = projected(made.scene.points.astype(float), constraints)
    parameters.groups["points"].grad.assign(weights.astype(np.float32))
    program = parameters.backend.program()
    projection.record_adjoint(program)
    program.run()
    got = parameters.gradients()["points"].reshape(-1)
    want = np.zeros(got.shape)
    leader = np.arange(len(want))
    for members in ties_of(constraints):
        leader[members] = members[0]
    pinned = set(constraints.tie_member[constraints.tie_first[:-1][constraints.tie_pinned == 1]].tolist())
    for i in range(len(want)):
        shift = 1e-4 * (leader == leader[i]).reshape(-1, 2) * (leader[i] not in pinned)
        ends = [projected(at + sign * shift, constraints) for sign in (1, -1)]
        want[i] = (weights * (ends[0] - ends[1])).sum() / 2e-4
    of_lines = np.repeat(constraints.line_handles, 2)
    assert relative_error(got[~of_lines], want[~of_lines]) < 1e-4
    assert not want[of_lines].any()
    assert np.abs(want[~of_lines]).max() > 1


def test_joints_and_ties_of_a_seam() -> None:
    """The third region's corner lies on the seam's smooth joint, whose handles are those of two regions."""
    made = seam()
    constraints = Constraints.of(made)
    (p,) = constraints.joint_point
    assert made.joints[p] == Joint.SMOOTH
    assert constraints.joint_free.tolist() == [BEFORE | AFTER]
    groups = ties_of(constraints)
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
