"""What blurred or sharpened a picture after its shapes became pixels: found from the picture, and undone.

Scanners, cameras and programs that resize convolve an image with a small symmetric kernel. A trace of the
picture tells it: the kernel with which the trace's exact render is nearest to the picture. Without it, the
picture is what it is less the convolved render, plus the render. Where the trace is right, that is the render
itself; where it is not yet, the next trace is nearer (back projection: Irani and Peleg 1991, "Improving
resolution by image registration").
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeVar

import numpy as np

from warpsplat.drawing.trace.grids import Floats
from warpsplat.portable.linear import solve
from warpsplat.scene import FloatArray

RADIUS = 2
"""Radius of the kernel [px]."""

TURNS = 6
"""Traces from which it is found, at the most."""

LIKELY, CLEARLY = 0.9, 0.75
"""Share of the squared error without a kernel that one must leave less than for a trace through it to be
tried, and for that to be kept: blurred pictures have .5 and less."""

RINGS = [
    sorted({(up * y, left * x) for y, x in ((a, b), (b, a)) for up in (1, -1) for left in (1, -1)})
    for a in range(RADIUS + 1)
    for b in range(a + 1)
]
"""Places of a kernel (row, column) that have one weight, as it is symmetric to the axes and diagonals."""

LIGHTNESS = np.array([5, 9, 2], np.float32)
"""Shares of the channels, about, in what JPEG keeps at full resolution (ITU-T T.871): whole numbers, small
enough for exact sums over an image."""

Traced = TypeVar("Traced")


@dataclass(frozen=True)
class Optics:
    """A kernel with a weight for the places of each of RINGS; those of all places add up to 1."""

    weights: tuple[float, ...]

    def __call__(self, image: Floats) -> Floats:
        """Return an image, shape (height, width, channel), convolved with the kernel."""
        total = np.zeros_like(image)
        for weight, ring in zip(self.weights, _rings(image), strict=True):
            total += np.float32(weight) * ring
        return total


@dataclass(frozen=True, eq=False)
class Found:
    """The optics that bring a sharp image nearest to a picture."""

    optics: Optics
    error: float
    """Sum of squared errors with them, in whole levels of lightness."""
    without: float
    """The same without."""
    sharp: Floats
    """The sharp image, in whole levels."""
    seen: Floats
    """The picture, likewise."""

    def undone(self) -> FloatArray:
        """Return the picture without the optics, sRGB in [0, 1]."""
        levels = np.clip(np.round(self.seen - self.optics(self.sharp) + self.sharp), 0, 255)
        if levels.shape[2] == 4:
            levels = np.minimum(levels, levels[..., 3:])
        return np.asarray(levels / np.float32(255), np.float32)


def find_optics(sharp: FloatArray, seen: FloatArray) -> Found:
    """Return the optics that bring a sharp image nearest to a picture.

    Args:
        sharp: sRGB in [0, 1], shape (height, width, 3), or premultiplied with opacity, (height, width, 4).
        seen: Likewise; only the lightness of both counts.
    """
    sharp, seen = _levels(sharp), _levels(seen)
    light = ((image[..., :3] * LIGHTNESS).sum(axis=2, keepdims=True) for image in (sharp, seen))
    return Found(*_nearest(*light), sharp, seen)


def _nearest(sharp: Floats, seen: Floats) -> tuple[Optics, float, float]:
    """Return the optics that bring an image nearest to another, and the squared errors with and without.

    Both are of one channel, in whole levels.
    """
    center, *rings = _rings(sharp)
    columns = [ring - len(places) * center for ring, places in zip(rings, RINGS[1:], strict=True)]
    inside = np.any([column != 0 for column in columns], axis=0)
    # Sums of products of whole numbers are exact, and so the same in any order.
    table = np.array([column[inside] for column in (*columns, seen - sharp)], np.float64)
    products = np.array([[(one * other).sum() for one in table] for other in table])
    normal, right, without = products[:-1, :-1], products[:-1, -1], float(products[-1, -1])
    try:
        weights = solve(normal, right)
    except np.linalg.LinAlgError:  # no edges, or all alike
        return Optics((1.0, *(0.0,) * len(columns))), without, without
    error = without - float((weights * right).sum())
    beside = sum(len(places) * weight for places, weight in zip(RINGS[1:], weights.tolist(), strict=True))
    return Optics((1 - beside, *weights.tolist())), error, without


def without_optics(
    pixels: FloatArray,
    trace: Callable[[FloatArray], Traced],
    show: Callable[[Traced], FloatArray],
    over: Callable[[], bool],
) -> tuple[FloatArray, Traced]:
    """Return pixels as they were before they were blurred or sharpened, and their trace.

    Args:
        pixels: sRGB in [0, 1], shape (height, width, 3), or premultiplied with opacity, (height, width, 4).
        trace: Traces such pixels.
        show: Renders a trace, likewise.
        over: Returns whether there is no time left.

    Returns:
        ``pixels`` itself if no optics explain it clearly better than its trace does.
    """
    first = best = pixels, trace(pixels)
    bound, (current, traced) = np.inf, first
    for turn in range(TURNS):
        found = find_optics(show(traced), pixels)
        if turn == 0:
            if found.error >= LIKELY * found.without:
                break
            bound = CLEARLY * found.without
        elif found.error >= bound:
            break
        else:
            bound, best = found.error, (current, traced)
        if over():
            break
        current = found.undone()
        traced = trace(current)
    return best


def _levels(pixels: FloatArray) -> Floats:
    """Return values in [0, 1] as whole levels of 255."""
    return np.asarray(np.round(pixels * np.float32(255)), np.float32)


def _rings(image: Floats) -> list[Floats]:
    """Return the sum of the pixels at the places of each ring around each pixel."""
    height, width = image.shape[:2]
    wide = np.pad(image, [(RADIUS, RADIUS), (RADIUS, RADIUS), (0, 0)], mode="edge")
    found = []
    for places in RINGS:
        total = np.zeros_like(image)
        for y, x in places:
            total += wide[RADIUS + y : RADIUS + y + height, RADIUS + x : RADIUS + x + width]
        found.append(total)
    return found
