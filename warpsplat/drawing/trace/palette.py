"""The colours and gradients that the parts of an image are painted with."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from warpsplat.drawing import prices
from warpsplat.drawing.trace.grids import NO_REGION, Floats, Ints, bounding_boxes, channel_max
from warpsplat.drawing.trace.ramps import Gradients, Ramp, fit_ramp
from warpsplat.scene.attributes import GRADIENTS

CLEAR = 2.5  # [levels] opacity below which nothing is painted
LEAST_RAMP, LEAST_NOISY_RAMP = 30, 400  # [px] of a part with a ramp, without and with noise
UNEVEN = 1.6  # [levels] residual of a flat colour from which on a ramp is tried, besides noise
UNEVEN_NOISE = 3.0  # what a level of noise adds to that
SAME = 1.5  # [levels] colours that differ by less are one


@dataclass(frozen=True)
class Coloring:
    """Paint of a region: premultiplied, 0..255."""

    color: Floats
    """Mean colour, shape (4,)."""
    ramp: Ramp | None = None
    is_band: bool = False
    """Whether it is a step of smooth shading, whose border with the next step is nowhere exactly."""

    @property
    def is_clear(self) -> bool:
        """Whether nothing is painted."""
        opacity = self.color[3] if self.ramp is None else self.ramp.colors[:, 3].max()
        return float(opacity) < CLEAR


@dataclass(frozen=True)
class Parts:
    """Labelled pixels of an image, and what they are painted with."""

    labels: Ints
    """The part of each pixel, NO_REGION where it is not known; shape (height, width)."""
    fills: Floats
    """The colour of each labelled pixel if its part covered it, shape (height, width, 4)."""
    paint: Ints
    """The colouring of each part, shape (part,)."""
    colorings: list[Coloring]


def least_worth(count: int, pixels: int, noise: float, **options: float) -> float:
    """Return the sum of squared errors (one channel) that a region must save [levels squared].

    Args:
        count: Regions of an image.
        pixels: Of the image.
        noise: Of flat regions [levels].
        options: Of ``prices.worth``.
    """
    byte = prices.worth((noise / 255) ** 2, prices.REGION * count, **options)
    return pixels * 255**2 * prices.REGION * byte


def paint_parts(image: Floats, labels: Ints, noise: float, gradients: Gradients = GRADIENTS) -> Parts:
    """Find the colour or the ramp of each part; parts of nearly one colour share it."""
    count = int(labels.max()) + 1
    if count <= 0:
        count, labels = 1, np.zeros(labels.shape, np.int32)
    inside = labels >= 0
    owners, pixels = labels[inside], image[inside]
    sizes = np.maximum(np.bincount(owners, minlength=count), 1)
    sums = np.stack([np.bincount(owners, channel, count) for channel in pixels.T], axis=1)
    means = sums.astype(np.float64) / sizes[:, None]
    modes = _modes(pixels, owners, count)
    off = channel_max(np.abs(pixels - modes.astype(np.float32)[owners]))
    residual = np.sqrt(np.bincount(owners, off.astype(np.float64) ** 2, count) / sizes)
    is_large = sizes >= (LEAST_RAMP if noise == 0 else LEAST_NOISY_RAMP)
    paint = np.full(count, NO_REGION, np.int32)
    colorings: list[Coloring] = []
    boxes = bounding_boxes(labels, count)
    for part in np.flatnonzero((residual > UNEVEN + UNEVEN_NOISE * noise) & is_large).tolist():
        box = boxes[part].slices()
        left, top = boxes[part].left, boxes[part].top
        ramp = fit_ramp(image[box], labels[box] == part, left, top, gradients)
        if ramp and ramp.is_better_than(float(residual[part] * residual[part])):
            paint[part] = len(colorings)
            colorings.append(Coloring(means[part], ramp))
    is_flat = paint == NO_REGION
    least = least_worth(count, labels.size, noise)
    shared, flat_colorings = _shared_colors((modes if noise == 0 else means)[is_flat], sizes[is_flat], least)
    paint[is_flat] = len(colorings) + shared
    colorings += flat_colorings
    colors = np.array([coloring.color for coloring in colorings], np.float32)[paint]
    fills = np.where((inside & is_flat[labels])[..., None], colors[labels], image)
    return Parts(labels, fills, paint, colorings)


def _modes(pixels: Floats, owners: Ints, count: int) -> Floats:
    """Return the most frequent colour of each part, shape (count, channel), from its ``pixels``."""
    levels = np.round(pixels).astype(np.int64)
    packed = owners.astype(np.int64)
    for channel in levels.T:
        packed = packed * 256 + channel
    keys, times = np.unique(packed, return_counts=True)
    owner = keys >> 8 * levels.shape[1]
    order = np.lexsort((times, owner))
    last = order[np.flatnonzero(np.diff(np.append(owner[order], count)) != 0)]
    shifts = 8 * np.arange(levels.shape[1])[::-1]
    colors = np.zeros((count, levels.shape[1]))
    colors[owner[last]] = (keys[last][:, None] >> shifts) & 255
    return colors


def _shared_colors(colors: Floats, sizes: Ints, least: float) -> tuple[Ints, list[Coloring]]:
    """Return the number of the colour that each flat part has, and these: those of the largest parts.

    ``least``: as ``least_worth``: what a colour of its own must save.
    """
    known = np.zeros((0, colors.shape[1]))
    numbers = np.zeros(len(colors), np.intp)
    for part in np.argsort(-sizes, kind="stable").tolist():
        color = colors[part]
        if color[3] < CLEAR:
            color = np.zeros_like(color)
        elif color[3] > 255 - CLEAR:
            color = np.append(color[:3], 255.0)
        off = np.square(known - color).sum(axis=1) if len(known) else np.array([np.inf])
        nearest = int(off.argmin())
        if off[nearest] > SAME * SAME and off[nearest] * sizes[part] > least:
            nearest = len(known)
            known = np.concatenate([known, color[None]])
        numbers[part] = nearest
    return numbers, [Coloring(np.round(color)) for color in known]
