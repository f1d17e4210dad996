"""Changes of whole contours, kept where a render shows that they cost less than the bytes that they save."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from warpsplat.alpha import squares
from warpsplat.drawing.constraints import Constraints, Drawing, Floats, Links, summed, with_ends
from warpsplat.drawing.measure import different, pixels_around
from warpsplat.fit.problem import Run
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray
from warpsplat.scene.scene import starts_of

MOST_OFF = 0.6
"""Largest distance of an outline from the one that may take its place [px]."""

Outlines = dict[int, tuple[npt.NDArray[np.floating], npt.NDArray[np.integer]]]
"""Points, shape (point, 2), and joints, shape (point,), by contour."""


@dataclass(frozen=True)
class Alternative:
    """Other points and joints for some contours."""

    contours: Outlines
    """Contours that replace others."""
    cubics: Floats
    """The pieces before and after it, shape (piece, 4, 2)."""
    saved: float
    """Bytes."""


def contour_change(drawing: Drawing, contours: Outlines, saved: float) -> Alternative:
    """Return the change of a drawing's contours."""
    old = np.isin(drawing.contour(), list(contours))
    made = [
        with_ends(points.astype(np.float64), np.roll(np.arange(len(points) // 3), -1))
        for points, _ in contours.values()
    ]
    return Alternative(contours, np.concatenate([drawing.cubics()[old], *made]), saved)


def changed(drawing: Drawing, changes: Sequence[Alternative]) -> Drawing:
    """Return a drawing with changes."""
    scene = drawing.scene
    starts = scene.starts.tolist()
    points = [scene.points[a:b] for a, b in itertools.pairwise(starts)]
    joints = [drawing.joints[a:b] for a, b in itertools.pairwise(starts)]
    for change in changes:
        for contour, (own_points, own_joints) in change.contours.items():
            points[contour] = own_points.astype(np.float32)
            joints[contour] = own_joints.astype(np.int32)
    after = starts_of(np.array([len(own) for own in points], np.int32))
    first = after[np.searchsorted(scene.starts, scene.first)]
    made = replace(scene, points=np.concatenate(points), starts=after, first=first)
    return Drawing(made, np.concatenate(joints))


def worthwhile(
    target: FloatArray, drawing: Drawing, run: Run, changes: Sequence[Alternative], worth: float
) -> list[Alternative]:
    """Return the changes by which the error around them grows less than their bytes are worth.

    Args:
        target: The image, as for ``finish_drawing``.
        drawing: Fitted.
        run: The device.
        changes: Of different contours, all made at once.
        worth: Mean squared error that a byte is worth.
    """
    if not changes:
        return []

    def error_of(made: Drawing) -> Floats:
        points = Constraints(made).project(made.cubics()[:, :3].reshape(-1, 2))
        scene = replace(made.scene, points=points.astype(np.float32))
        away: Floats = squares(render(scene, backend=run.backend) - target).ravel().astype(np.float64)
        return away

    growth = error_of(changed(drawing, changes)) - error_of(drawing)
    height, width = target.shape[:2]
    counts = [len(change.cubics) for change in changes]
    cubic, pixel = pixels_around(np.concatenate([change.cubics for change in changes]), width, height)
    own: Links = different(np.repeat(np.arange(len(counts)), counts)[cubic] * height * width + pixel)
    grown = summed(own // (height * width), growth[own % (height * width)], len(counts))
    most = 3 * height * width * worth
    return [change for change, cost in zip(changes, grown, strict=True) if cost <= change.saved * most]
