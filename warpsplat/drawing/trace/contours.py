"""Closed contours of curves and lines, and shapes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.curves import Pieces, straight
from warpsplat.drawing.trace.grids import Bools, Floats, Ints
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.portable.elementary import hypot
from warpsplat.scene.attributes import Joint
from warpsplat.scene.scene import starts_of

OFF_LINE = 0.05  # [px] distance of the joint of two lines up to which they are one
SMOOTH_TANGENT = 0.14054083  # of the angle between handles up to which a joint is smooth: 8 degrees
MOST_MOVED = 0.6  # [px] that a handle moves when its smooth joint is made straight, at the most
NEAREST = 64  # shapes among which what lies between two is looked for first


def assembled(parts: Sequence[Pieces | Floats]) -> Pieces | None:
    """Join curves and corners (point, 2) with lines to a closed contour; None if there is nothing to join."""
    parts = [part for part in parts if isinstance(part, Pieces) or len(part)]
    if not parts:
        return None
    cubics: list[Floats] = []
    lines: list[Bools] = []
    for part, after in zip(parts, [*parts[1:], *parts[:1]], strict=True):
        if isinstance(part, Pieces):
            cubics.append(part.cubics)
            lines.append(part.lines)
            last = part.cubics[-1, 3]
        else:
            cubics.append(straight(part[:-1], part[1:]))
            lines.append(np.ones(len(part) - 1, np.bool_))
            last = part[-1]
        goal = after.cubics[0, 0] if isinstance(after, Pieces) else after[0]
        if hypot(*(goal - last)) > 1e-3:
            cubics.append(straight(last, goal)[None])
            lines.append(np.ones(1, np.bool_))
    return Pieces(np.concatenate(cubics), np.concatenate(lines))


def with_joined_lines(contours: list[Pieces]) -> list[Pieces]:
    """Return contours with one line for several that go on in the same direction."""
    cubics, lines, before, first = _around(contours)
    joined = lines & lines[before] & _are_straight_on(cubics[before], cubics)
    any_joined = np.isin(
        np.arange(len(contours)), np.searchsorted(first, np.flatnonzero(joined), "right") - 1
    )
    return [
        _with_joined_lines(contour) if joined else contour
        for contour, joined in zip(contours, any_joined.tolist(), strict=True)
    ]


def _around(contours: list[Pieces]) -> tuple[Floats, Bools, Ints, Ints]:
    """Return cubics of contours, which are lines, the cubic before each, and the first of each contour."""
    counts = np.array([len(contour.cubics) for contour in contours], np.int64)
    first = starts_of(counts)
    before = np.arange(first[-1]) - 1
    before[first[:-1]] = first[1:] - 1
    cubics = np.concatenate([*(contour.cubics for contour in contours), np.zeros((0, 4, 2))])
    lines = np.concatenate([*(contour.lines for contour in contours), np.zeros(0, np.bool_)])
    return cubics, lines, before, first


def _with_joined_lines(contour: Pieces) -> Pieces:
    """Return a contour with one line for several that go on in the same direction."""
    kept: list[Floats] = []
    is_line: list[bool] = []
    for cubic, line in zip(contour.cubics, contour.lines.tolist(), strict=True):
        if line and kept and is_line[-1] and _are_straight_on(kept[-1], cubic):
            kept[-1] = straight(kept[-1][0], cubic[3])
        else:
            kept.append(cubic)
            is_line.append(line)
    if len(kept) > 2 and is_line[0] and is_line[-1] and _are_straight_on(kept[-1], kept[0]):
        kept[0] = straight(kept.pop()[0], kept[0][3])
        is_line.pop()
    return Pieces(np.asarray(kept), np.asarray(is_line, np.bool_))


def _are_straight_on(ones: Floats, others: Floats) -> Bools:
    """Return whether joints of two lines, (..., 4, 2), are on the line from the beginning to the end."""
    chord, here = others[..., 3, :] - ones[..., 0, :], ones[..., 3, :] - ones[..., 0, :]
    size = hypot(chord[..., 0], chord[..., 1])
    forward = ((here * chord).sum(axis=-1) >= 0) & (((chord - here) * chord).sum(axis=-1) >= 0)
    off = np.abs(here[..., 0] * chord[..., 1] - here[..., 1] * chord[..., 0])
    return (size >= 1e-6) & forward & (off <= OFF_LINE * size)


def joints_of(contours: list[Pieces]) -> Ints:
    """Return the joint of each point of contours, three for each piece."""
    cubics, lines, before, _ = _around(contours)
    line_before = lines[before]
    arriving, leaving = (cubics[:, 3] - cubics[:, 2])[before], cubics[:, 1] - cubics[:, 0]
    cross = np.abs(arriving[:, 0] * leaving[:, 1] - arriving[:, 1] * leaving[:, 0])
    dot = (arriving * leaving).sum(axis=1)
    # Bending a long handle by a small angle moves a curve by pixels.
    length, length_before = hypot(*leaving.T), hypot(*arriving.T)
    sine = cross / np.maximum(length * length_before, 1e-12)
    length, length_before = np.where(lines, np.inf, length), np.where(line_before, np.inf, length_before)
    moves_little = np.minimum(length, length_before) < MOST_MOVED / np.maximum(sine, 1e-12)
    smooth = (cross <= SMOOTH_TANGENT * dot) & moves_little & ~(lines & line_before)
    joints = np.full((len(cubics), 3), Joint.FREE, np.int32)
    joints[:, 0] = np.where(smooth, Joint.SMOOTH, Joint.CORNER)
    joints[lines, 1:] = Joint.LINE_HANDLE
    return joints.reshape(-1)


@dataclass
class Fill:
    """Contours of one colouring."""

    coloring: Coloring
    contours: list[Pieces]

    def box(self) -> Floats:
        """Return the bounding box of the control points: left, top, right, bottom."""
        points = np.concatenate([contour.cubics.reshape(-1, 2) for contour in self.contours])
        return np.concatenate([points.min(axis=0), points.max(axis=0)])


def merged(shapes: list[Fill]) -> list[Fill]:
    """Make one shape of those of one colour, where nothing lies between them."""
    result: list[Fill] = []
    number_of: dict[int, int] = {}
    colors, boxes = np.zeros(len(shapes), np.intp), np.zeros((len(shapes), 4))
    for shape in shapes:
        box, count = shape.box(), len(result)
        color = number_of.setdefault(id(shape.coloring), len(number_of))
        target = None
        for low, high in ((max(0, count - NEAREST), count), (0, max(0, count - NEAREST))):
            own = boxes[low:high]
            between = ((box[:2] < own[:, 2:]) & (own[:, :2] < box[2:])).all(axis=1)
            same = colors[low:high] == color
            stops = np.flatnonzero(between | same)
            if len(stops):
                target = low + int(stops[-1]) if same[stops[-1]] else None
                break
        if target is None:
            target = count
            result.append(Fill(shape.coloring, []))
            boxes[target] = box
        result[target].contours.extend(shape.contours)
        colors[target] = color
        boxes[target, :2] = np.minimum(boxes[target, :2], box[:2])
        boxes[target, 2:] = np.maximum(boxes[target, 2:], box[2:])
    return result
