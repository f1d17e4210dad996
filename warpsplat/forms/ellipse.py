"""Ellipses at any angle, with the values of ``forms.frame``."""

from __future__ import annotations

import numpy as np

from warpsplat.forms import Array, frame
from warpsplat.forms.text import element_of

VALUES = 3
TAGS = ("ellipse",)
TURNED = True


def outline(values: Array, closed: bool) -> Array:
    """Return four arcs."""
    return frame.placed(values, frame.QUARTERS)


place, gather = frame.make_frame("ellipse", frame.QUARTERS)


def start(centres: Array, areas: Array, angles: Array, count: int) -> Array:
    """Return circles."""
    return frame.start_frames(centres, np.sqrt(areas / np.pi), angles)


def numbers(values: Array) -> Array:
    """Return the centre in turned coordinates, both radii, and the angle [degrees]."""
    degrees, *radii = frame.axes(values)
    first, second = (np.maximum(np.round(radius), 1) for radius in radii)
    degrees = np.where(first == second, 0, frame.rounded_angles(degrees, np.maximum(first, second)))
    centres = np.round(frame.turned_back(values[:, 0], degrees))
    return np.column_stack([centres, first, second, degrees])


def values(numbers: Array) -> Array:
    """Return centre and axes."""
    first, second, degrees = numbers[:, 2:].T
    return frame.frames_of(numbers[:, :2], first, second, degrees)


def element(numbers: list[float], closed: bool) -> str:
    """Return an ellipse, or a circle."""
    x, y, first, second, degrees = numbers
    if first == second:
        return element_of("circle", [("cx", x), ("cy", y), ("r", first)])
    return element_of("ellipse", [("cx", x), ("cy", y), ("rx", first), ("ry", second)], degrees)


def read(points: Array, closed: bool) -> Array:
    """Return the ellipse with conjugate radii at the ends of two arcs, if these are perpendicular."""
    centre = points[::3].mean(axis=0)
    x, y = points[3] - centre
    return np.array([centre, points[0] - centre, (np.sqrt(x * x + y * y), 0)])
