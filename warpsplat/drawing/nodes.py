"""Candidates for simpler outlines: fewer or straighter pieces.

All are found at once, as arrays. How much each costs is told by what the image says of the outlines
(``drawing.tidy``).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from warpsplat.drawing import prices
from warpsplat.drawing.constraints import Drawing, Flags, Floats, Links
from warpsplat.drawing.trace.cubics import handles_through
from warpsplat.drawing.trace.curves import straight
from warpsplat.scene.attributes import Joint

WITHOUT, STRAIGHT = range(2)
"""Kinds: a piece for the two that meet in a point, and a line for a cubic."""


@dataclass(frozen=True)
class Edits:
    """Changes of a drawing, each of the piece, or of the point, where a cubic begins."""

    kind: npt.NDArray[np.intp]
    """Shape (edit,), as all."""
    at: Links
    """The cubic; ``WITHOUT`` makes it part of the one before."""
    cubics: Floats
    """The piece that an edit makes, shape (edit, 4, 2)."""
    saved: Floats
    """Bytes."""
    around: Links
    """The cubics that it may change, shape (edit, 4); fewer are repeated."""

    def take(self, chosen: npt.NDArray[np.integer] | Flags) -> Edits:
        """Return the ``chosen`` ones."""
        return Edits(**{name: values[chosen] for name, values in vars(self).items()})


def candidates(drawing: Drawing, refused: Flags) -> Edits:
    """Return all edits but the ``refused`` ones, by cubic and kind, shape (cubic, 2)."""
    before, after = drawing.neighbours()
    cubics, line = drawing.cubics(), drawing.lines()
    # Outlines of two pieces keep them.
    gone = np.flatnonzero(
        (after[after] != before) & (after[after] != np.arange(len(after))) & ~refused[:, WITHOUT]
    )
    bent = np.flatnonzero(~line & ~refused[:, STRAIGHT])
    first, second = cubics[before[gone]], cubics[gone]
    lines = line[before[gone]].astype(np.intp) + line[gone]
    joined = np.concatenate([first[:, :1], handles_through(first, second), second[:, 3:]], axis=1)
    joined = np.where((lines == 2)[:, None, None], straight(first[:, 0], second[:, 3]), joined)
    saved = np.where(lines > 0, prices.LINE, prices.CUBIC), np.full(len(bent), prices.HANDLES)
    at, kind = np.concatenate([gone, bent]), np.repeat([WITHOUT, STRAIGHT], [len(gone), len(bent)])
    far = np.where(kind == WITHOUT, before[before[at]], before[at])
    made = np.concatenate([joined, straight(cubics[bent, 0], cubics[bent, 3])])
    around = np.stack([far, before[at], at, after[at]], axis=1)
    return Edits(kind, at, made, np.concatenate(saved), around)


def applied(drawing: Drawing, edits: Edits) -> tuple[Drawing, Flags]:
    """Return the drawing after ``edits`` that have no cubics in common, and which cubics are left."""
    points = drawing.scene.points.astype(np.float64).reshape(-1, 3, 2)
    joints = drawing.joints.reshape(-1, 3).copy()
    (previous, following), line = drawing.neighbours(), drawing.lines()

    def of(kind: int) -> Edits:
        return edits.take(edits.kind == kind)

    gone = of(WITHOUT)
    before = previous[gone.at]
    points[before, 1:] = gone.cubics[:, 1:3]
    both = line[gone.at] & line[before]
    joints[before, 1:] = np.where(both, Joint.LINE_HANDLE, Joint.FREE)[:, None]
    made = of(STRAIGHT)
    points[made.at, 1:], joints[made.at, 1:] = made.cubics[:, 1:3], Joint.LINE_HANDLE
    joints[made.at[line[previous[made.at]]], 0] = Joint.CORNER
    after = following[made.at]
    joints[after[line[after]], 0] = Joint.CORNER
    keep = np.ones(len(points), np.bool_)
    keep[gone.at] = False
    scene = replace(drawing.scene, points=points.reshape(-1, 2).astype(np.float32))
    every = np.repeat(keep, 3)
    return Drawing(scene.without_points(every), joints.reshape(-1)[every]), keep


def apart(edits: Edits, cost: Floats) -> Links:
    """Choose the edits with the least ``cost`` that have no cubics in common; return their indices."""
    rank = np.empty(len(cost), np.intp)
    rank[np.argsort(cost, kind="stable")] = np.arange(len(cost))
    count = int(edits.around.max(initial=-1)) + 1
    taken, left = np.zeros(count, np.bool_), np.arange(len(cost))
    chosen = []
    while len(left):
        around = edits.around[left]
        least = np.full(count, len(cost))
        np.minimum.at(least, around.ravel(), np.repeat(rank[left], around.shape[1]))
        first = left[(least[around] == rank[left][:, None]).all(axis=1)]
        chosen.append(first)
        taken[edits.around[first]] = True
        left = left[~taken[around].any(axis=1)]
    return np.concatenate(chosen) if chosen else np.zeros(0, np.intp)
