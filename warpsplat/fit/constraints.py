"""Constraints of a drawing's outlines in a fit: corners, straight lines, smooth joints, seams and borders."""

from __future__ import annotations

from dataclasses import dataclass, fields
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import warp as wp

from warpsplat.kernels import constraints as kernels
from warpsplat.kernels.constants import NONE
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.program import Program
from warpsplat.scene import Basis, FloatArray, IndexArray, Scene
from warpsplat.scene.attributes import Joint
from warpsplat.scene.scene import ranges

Ints = npt.NDArray[np.int32]
Links = npt.NDArray[np.intp]

SAME_COORDINATE = 1e-3
"""Difference [canvas units] below which coordinates are equal, like those of the ends of an upright line."""

MAX_LEVERAGE = 8.0
"""Maximum length of a handle that a line directs, in lengths of the line: rounding rotates longer ones."""

BEFORE, AFTER = 1, 2
"""Flags of the neighbours of a smooth joint that are free handles; another one is the far end of a line."""


@dataclass(frozen=True)
class Drawing:
    """Shapes whose outlines have constraints."""

    scene: Scene
    """Fills of cubics."""
    joints: Ints
    """``Joint`` of each point, shape (point,)."""
    same: Ints
    """Points with the same number, 0 or more, are one place in several shapes; NONE for others. Shape
    (point,)."""

    def __post_init__(self) -> None:
        """Raise ``ValueError`` unless shapes agree, and the scene has fills of cubics only."""
        count = len(self.scene.points)
        for name, values in (("joints", self.joints), ("same", self.same)):
            if values.shape != (count,):
                raise ValueError(f"{name} has shape {values.shape}, not ({count},)")
        if (self.scene.basis != Basis.CUBIC).any() or not self.scene.closed.all():
            raise ValueError("a drawing has closed outlines of cubics")

    def take(self, index: IndexArray) -> Drawing:
        """Return the shapes ``index``, in that order."""
        points = ranges(self.scene.first[:-1][index], self.scene.point_counts()[index])
        return Drawing(self.scene.take(index), self.joints[points], self.same[points])

    def links(self) -> tuple[Links, Links]:
        """Return the points on the outlines, in order, and the next one of each contour; shape (cubic,)."""
        starts = self.scene.starts.astype(np.intp)
        on = np.concatenate([np.arange(a, b, 3) for a, b in pairwise(starts)])
        following = on + 3
        last = np.searchsorted(on, starts[1:] - 3)
        following[last] = starts[:-1]
        return on, following

    def lines(self) -> npt.NDArray[np.bool_]:
        """Return which cubics are straight lines, in the order of ``links``, shape (cubic,).

        The handles of a line are marked as such in at least one of the shapes that share it.
        """
        on, _ = self.links()
        marked = self.joints == Joint.LINE_HANDLE
        marked |= (self.same >= 0) & np.isin(self.same, self.same[marked])
        return np.asarray(marked[on + 1] & marked[on + 2])


@dataclass(frozen=True)
class Constraints:
    """A drawing's constraints, in arrays named as the parameters of ``kernels.constraints``.

    A tie is a set of coordinates that are equal.
    """

    line_end: Ints
    """End of the line that begins at each point, or NONE, shape (point,)."""
    line_start: Ints
    """Start of the line that ends at each point, or NONE, shape (point,)."""
    joint_point: Ints
    """Smooth joints that direct handles, shape (joint,); at level and upright tangents ties do."""
    joint_before: Ints
    joint_after: Ints
    joint_free: Ints
    turned_by: Ints
    """Joints whose line has its far end at each point, or NONE, shape (point, 2)."""
    tie_first: Ints
    """First member of each tie and, last, the number of members, shape (tie + 1,)."""
    tie_member: Ints
    """Coordinates of each tie as 2 x point + axis, shape (member,)."""
    tie_pinned: Ints
    """1 for ties that stay as they are, shape (tie,)."""

    @staticmethod
    def of(drawing: Drawing) -> Constraints:
        """Return the constraints of ``drawing``.

        Coordinates that are equal along a line or a tangent stay equal, those on the border stay. Of several
        smooth joints that could direct a handle, the first one does.
        """
        points, canvas = drawing.scene.points, drawing.scene.canvas
        count = len(points)
        on, following = drawing.links()
        straight = drawing.lines()
        line_end, line_start = np.full((2, count), NONE, np.int32)
        line_end[on[straight]] = following[straight]
        line_start[following[straight]] = on[straight]
        ties = _Ties(2 * count)
        ties.join_same(drawing.same)
        ties.join_where(_equal(points, on[straight], following[straight]), on[straight], following[straight])
        joints, leaders = _smooth_joints(drawing, line_start, line_end, ties)
        turned = np.full((count, 2), NONE, np.int32)
        for number, (_, begin, end, side) in enumerate(joints):
            if side == AFTER:
                turned[begin, 0] = number
            elif side == BEFORE:
                turned[end, 1] = number
        of_lines = set(np.concatenate([on[straight] + 1, on[straight] + 2]).tolist())
        point, before, after, free = np.asarray(joints, np.int32).reshape(-1, 4).T
        size = np.array([canvas.width, canvas.height])
        border = np.asarray(np.minimum(np.abs(points), np.abs(points - size)) < SAME_COORDINATE)
        first, member, pinned = ties.groups(leaders, set(on.tolist()), of_lines, border)
        return Constraints(line_end, line_start, point, before, after, free, turned, first, member, pinned)

    @property
    def line_handles(self) -> npt.NDArray[np.bool_]:
        """Return which points are handles of lines, shape (point,)."""
        found = np.zeros(len(self.line_end), np.bool_)
        starts = np.flatnonzero(self.line_end != NONE)
        found[starts + 1] = found[starts + 2] = True
        return found


def _equal(points: FloatArray, a: Links, b: Links) -> npt.NDArray[np.bool_]:
    """Return in which axes points ``a`` and ``b`` have equal coordinates, shape (pair, 2)."""
    return np.asarray(np.abs(points[a] - points[b]) < SAME_COORDINATE)


def _smooth_joints(
    drawing: Drawing, line_start: Ints, line_end: Ints, ties: _Ties
) -> tuple[list[tuple[int, int, int, int]], set[int]]:
    """Return point, neighbours and flags of the smooth joints that direct handles, and these handles.

    Where the tangent is level or upright, ``ties`` get the handles instead.
    """
    points = drawing.scene.points
    on, following = drawing.links()
    before_of = np.zeros(len(points), np.intp)
    before_of[following] = on
    places = np.where(drawing.same >= 0, drawing.same, -1 - np.arange(len(points))).tolist()
    smooth = on[drawing.joints[on] == Joint.SMOOTH]
    starts, ends = line_start[smooth], line_end[smooth]
    handles = np.stack([before_of[smooth] + 2, smooth + 1], axis=1)
    free = np.stack([starts == NONE, ends == NONE], axis=1)
    reach = _reach(points, smooth, handles, free)
    lines = np.stack([starts, ends], axis=1)
    turned = ~free.all(axis=1) & (reach > MAX_LEVERAGE * _reach(points, smooth, lines, ~free))
    around = np.where(free, handles, lines)
    flat = _equal(points, around[:, 0], smooth) & _equal(points, smooth, around[:, 1])
    bound, directed = set[int](), set[int]()
    joints = []
    for i in np.flatnonzero(free.any(axis=1)).tolist():
        own = handles[i][free[i]].tolist()
        keys = {places[handle] for handle in own}
        if keys & bound or turned[i]:
            continue
        bound |= keys
        if flat[i].any():
            for handle in own:
                ties.join_where(flat[i : i + 1], smooth[i : i + 1], np.array([handle]))
        else:
            (before, after), sides = around[i].tolist(), free[i].tolist()
            joints.append((int(smooth[i]), before, after, BEFORE * sides[0] + AFTER * sides[1]))
            directed.update(own)
    return joints, directed


def _reach(points: FloatArray, on: Links, others: Links, counted: npt.NDArray[np.bool_]) -> FloatArray:
    """Return the distance from points ``on`` to the farther ``counted`` one of two ``others``, (point, 2)."""
    distance = np.linalg.norm(points[others] - points[on][:, None], axis=2)
    return np.asarray(np.where(counted, distance, 0).max(axis=1, initial=0))


class _Ties:
    """Sets of equal coordinates, by union-find."""

    def __init__(self, count: int) -> None:
        self._parent = list(range(count))
        self._joined: set[int] = set()
        """Coordinates that are equal to others: few of them all."""

    def root(self, i: int) -> int:
        """Return the representative of a coordinate."""
        while self._parent[i] != i:
            self._parent[i] = self._parent[self._parent[i]]
            i = self._parent[i]
        return i

    def join_where(self, axes: npt.NDArray[np.bool_], a: Links, b: Links) -> None:
        """Join the coordinates of each pair of points ``a`` and ``b`` along ``axes``, shape (pair, 2)."""
        pairs, which = np.nonzero(axes)
        for first, second in zip(
            (2 * a[pairs] + which).tolist(), (2 * b[pairs] + which).tolist(), strict=True
        ):
            i, j = sorted((self.root(first), self.root(second)))
            self._parent[j] = i
            self._joined |= {first, second}

    def join_same(self, same: Ints) -> None:
        """Join the points with the same number."""
        points = np.flatnonzero(same >= 0)
        _, first, number = np.unique(same[points], return_index=True, return_inverse=True)
        self.join_where(np.ones((len(points), 2), np.bool_), points[first][number], points)

    def groups(
        self, leaders: set[int], on: set[int], of_lines: set[int], border: npt.NDArray[np.bool_]
    ) -> tuple[Ints, Ints, Ints]:
        """Return first members, members and pins of the ties of several coordinates or of pinned ones.

        In a tie, points of ``leaders`` come first, then those ``on`` the outlines. The handles ``of_lines``
        follow from the ends of these and are in none. Coordinates on the ``border``, shape (point, 2), are
        pinned, with their ties.
        """
        pinned = border.reshape(-1)
        members: dict[int, list[int]] = {}
        for i in sorted(self._joined.union(np.flatnonzero(pinned).tolist())):
            if i // 2 not in of_lines:
                members.setdefault(self.root(i), []).append(i)
        kept = [m for m in members.values() if len(m) > 1 or pinned[m].any()]
        ordered = [sorted(m, key=lambda i: (i // 2 not in leaders, i // 2 not in on)) for m in kept]
        first = np.cumsum([0, *map(len, ordered)]).astype(np.int32)
        flat = np.array([i for m in ordered for i in m], np.int32)
        return first, flat, np.array([pinned[m].any() for m in ordered], np.int32)


class Projection:
    """Projection of a drawing's points, on a device, onto those that satisfy its constraints."""

    def __init__(
        self,
        constraints: Constraints,
        parameters: Parameters,
        frozen: npt.NDArray[np.bool_] | None = None,
    ) -> None:
        """Copy constraints of the scene in ``parameters``; ``frozen``: points that stay, shape (point,)."""
        device = parameters.backend.device
        self._parameters = parameters
        self._joints, self._ties = len(constraints.joint_point), len(constraints.tie_pinned)
        self._arrays: dict[str, wp.array] = {
            f.name: wp.array(getattr(constraints, f.name), dtype=wp.int32, device=device)
            for f in fields(constraints)
        }
        self._arrays["joint_turn"] = parameters.backend.array(wp.vec2, self._joints)
        handles = constraints.line_handles
        parameters.hold("points", handles if frozen is None else handles | frozen)

    def record(self, program: Program) -> None:
        """Record the projection of the points."""
        p, group = self._parameters, self._parameters.groups["points"]
        program.launch(kernels.align, self._joints, p.arrays, self._arrays)
        program.launch(kernels.spread, self._ties, self._arrays, value=group.value)
        program.launch(kernels.lay, p.point_count, p.arrays, self._arrays)

    def record_adjoint(self, program: Program) -> None:
        """Record the adjoint of the projection, which maps gradients to those of the free coordinates."""
        p, group = self._parameters, self._parameters.groups["points"]
        program.launch(kernels.lay_backward, p.point_count, p.arrays, self._arrays)
        program.launch(kernels.spread_backward, self._ties, self._arrays, grad=group.grad)
        program.launch(kernels.align_backward, self._joints, p.arrays, self._arrays)
        if self._joints:
            program.launch(kernels.turn_backward, p.point_count, p.arrays, self._arrays)
        program.launch(kernels.share, self._ties, self._arrays, grad=group.grad)

    def project(self) -> None:
        """Project the points now."""
        program = self._parameters.backend.program()
        self.record(program)
        program.run()
