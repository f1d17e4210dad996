"""Closed contours of curves and lines, and shapes of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from warpsplat.drawing.trace.curves import Pieces, straight
from warpsplat.drawing.trace.grids import Floats, Ints
from warpsplat.drawing.trace.palette import Coloring
from warpsplat.portable.elementary import hypot
from warpsplat.scene.attributes import Joint

OFF_LINE = 0.05  # [px] distance of the joint of two lines up to which they are one
SMOOTH_TANGENT = 0.14054083  # of the angle between handles up to which a joint is smooth: 8 degrees
MOST_MOVED = 0.6  # [px] that a handle moves when its smooth joint is made straight, at the most
MOST_MERGED = 1500  # shapes among which those of one colour are merged, in quadratic time


def assembled(parts: Sequence[Pieces | Floats]) -> Pieces | None:
    """Join curves and corners (point, 2) with lines to a closed contour; None if there is nothing to join."""
    cubics: list[Floats] = []
    lines: list[bool] = []
    parts = [part for part in parts if isinstance(part, Pieces) or len(part)]
    for part, after in zip(parts, [*parts[1:], *parts[:1]], strict=True):
        if isinstance(part, Pieces):
            cubics.extend(part.cubics)
            lines.extend(part.lines.tolist())
            last = part.cubics[-1, 3]
        else:
            cubics.extend(straight(part[:-1], part[1:]))
            lines.extend([True] * (len(part) - 1))
            last = part[-1]
        goal = after.cubics[0, 0] if isinstance(after, Pieces) else after[0]
        if hypot(*(goal - last)) > 1e-3:
            cubics.append(straight(last, goal))
            lines.append(True)
    return _with_joined_lines(cubics, lines) if parts else None


def _with_joined_lines(cubics: list[Floats], lines: list[bool]) -> Pieces:
    """Return a contour with one line for several that go on in the same direction."""
    kept: list[Floats] = []
    is_line: list[bool] = []
    for cubic, line in zip(cubics, lines, strict=True):
        if line and kept and is_line[-1] and _is_straight_on(kept[-1], cubic):
            kept[-1] = straight(kept[-1][0], cubic[3])
        else:
            kept.append(cubic)
            is_line.append(line)
    if len(kept) > 2 and is_line[0] and is_line[-1] and _is_straight_on(kept[-1], kept[0]):
        kept[0] = straight(kept.pop()[0], kept[0][3])
        is_line.pop()
    return Pieces(np.asarray(kept), np.asarray(is_line, np.bool_))


def _is_straight_on(one: Floats, other: Floats) -> bool:
    """Return whether the joint of two lines is on the line from the first's start to the second's end."""
    chord, here = other[3] - one[0], one[3] - one[0]
    size = float(hypot(*chord))
    if size < 1e-6 or (here * chord).sum() < 0 or ((other[3] - one[3]) * chord).sum() < 0:
        return False
    return bool(abs(here[0] * chord[1] - here[1] * chord[0]) <= OFF_LINE * size)


def joints_of(contour: Pieces) -> Ints:
    """Return the joint of each point of a contour, three for each piece."""
    cubics, lines = contour.cubics, contour.lines
    before, line_before = np.roll(cubics, 1, axis=0), np.roll(lines, 1)
    arriving, leaving = before[:, 3] - before[:, 2], cubics[:, 1] - cubics[:, 0]
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
    if not 1 < len(shapes) <= MOST_MERGED:
        return shapes
    result: list[Fill] = []
    boxes: list[Floats] = []
    for shape in shapes:
        box, target = shape.box(), None
        for number in range(len(result) - 1, -1, -1):
            if result[number].coloring is shape.coloring:
                target = number
                break
            other = boxes[number]
            if (box[:2] < other[2:]).all() and (other[:2] < box[2:]).all():
                break
        if target is None:
            result.append(Fill(shape.coloring, list(shape.contours)))
            boxes.append(box)
            continue
        result[target].contours.extend(shape.contours)
        low, high = np.minimum(boxes[target], box), np.maximum(boxes[target], box)
        boxes[target] = np.concatenate([low[:2], high[2:]])
    return result
