"""Rectangles at any angle, with the values of ``forms.frame``."""

from __future__ import annotations

import numpy as np

from warpsplat.forms import Array, frame
from warpsplat.forms.polygon import outline as sides
from warpsplat.forms.text import element_of

VALUES = 3
TAGS = ("rect",)
TURNED = True

SQUARE = sides(np.array([[[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]]]), True)[0]
"""Control points of the square of half side 1."""


def outline(values: Array, closed: bool) -> Array:
    """Return four sides."""
    return frame.placed(values, SQUARE)


place, gather = frame.make_frame("rectangle", SQUARE)


def start(centres: Array, areas: Array, angles: Array, count: int) -> Array:
    """Return squares."""
    return frame.start_frames(centres, np.sqrt(areas) / 2, angles)


def numbers(values: Array) -> Array:
    """Return the first corner in turned coordinates, width, height, and the angle [degrees]."""
    degrees, *halves = frame.axes(values)
    sizes = np.maximum(np.round(2 * np.stack(halves, axis=1)), 1)
    degrees = frame.rounded_angles(degrees, sizes.max(axis=1) / 2)
    corners = np.round(frame.turned_back(values[:, 0], degrees) - sizes / 2)
    return np.column_stack([corners, sizes, degrees])


def values(numbers: Array) -> Array:
    """Return centre and axes."""
    corners, sizes, degrees = numbers[:, :2], numbers[:, 2:4], numbers[:, 4]
    return frame.frames_of(corners + sizes / 2, sizes[:, 0] / 2, sizes[:, 1] / 2, degrees)


def element(numbers: list[float], closed: bool) -> str:
    """Return a rectangle."""
    return element_of("rect", zip(("x", "y", "width", "height"), numbers[:4], strict=True), numbers[4])


def read(points: Array, closed: bool) -> Array:
    """Return the rectangle of four corners, if these are one's."""
    centre = points[::3].mean(axis=0)
    x, y = (points[6] - points[3]) / 2
    return np.array([centre, (points[3] - points[0]) / 2, (np.sqrt(x * x + y * y), 0)])
