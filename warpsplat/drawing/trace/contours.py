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

SMOOTH_TANGENT = 0.14054083  # of the angle between handles up to which a joint is smooth: 8 degrees
MOST_MOVED = 0.6  # [px] that a handle moves when its smooth joint is made straight, at the most


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


def joints_of(contours: list[Pieces]) -> Ints:
    """Return the joint of each point of contours, three for each piece."""
    cubics = np.concatenate([*(contour.cubics for contour in contours), np.zeros((0, 4, 2))])
    lines = np.concatenate([*(contour.lines for contour in contours), np.zeros(0, np.bool_)])
    first = starts_of(np.array([len(contour.cubics) for contour in contours], np.int64))
    before = np.arange(len(cubics)) - 1
    before[first[:-1]] = first[1:] - 1
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
        between = ((box[:2] < boxes[:count, 2:]) & (boxes[:count, :2] < box[2:])).all(axis=1)
        stops = np.flatnonzero(between | (colors[:count] == color))
        target = int(stops[-1]) if len(stops) and colors[stops[-1]] == color else count
        if target == count:
            result.append(Fill(shape.coloring, []))
            boxes[target] = box
        result[target].contours.extend(shape.contours)
        colors[target] = color
        boxes[target, :2] = np.minimum(boxes[target, :2], box[:2])
        boxes[target, 2:] = np.maximum(boxes[target, 2:], box[2:])
    return result
