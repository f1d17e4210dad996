"""Fitting of gradients: the linear or radial ramp of each shape that lowers the squared error most.

Let v(p) be the visibility of a shape at pixel p: coverage x opacity x transmittance of the shapes in front.
Adding d(p) to its colour changes the image by v(p) d(p): the squared error is quadratic in the coefficients
of d. Of all d along one line of colours in the span of 1, x, y and x^2 + y^2, the best one is a singular
vector of moments, sums over pixels. Without the square it is a linear ramp; with it, it gives the centre of a
radial one, whose colours are then found by sums along the radius.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from warpsplat.kernels import constants
from warpsplat.portable import elementary, linear
from warpsplat.scene import GRADIENTS, FloatArray
from warpsplat.scene.geometry import bounds

if TYPE_CHECKING:
    from warpsplat.fit.step import Step

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]

TILE = constants.TILE

HALF_LENGTH = 2.0
"""Half the length of a ramp, in standard deviations of the visible pixels along it: evenly spread ones end at
sqrt(3)."""

RIDGE = 1e-6
"""Added to variances, in the same unit: a shape of one pixel has no ramp."""


@dataclass(frozen=True)
class Ramps:
    """A ramp of two stops for each shape."""

    gain: Floats
    """Decrease of the mean squared error beyond that by the best flat colour, shape (shape,)."""
    frames: FloatArray
    """See ``Scene.frames``, shape (shape, 6)."""
    offsets: FloatArray
    """Offsets of the stops, shape (shape, 2)."""
    colors: FloatArray
    """Colours of the stops, sRGB in [0, 1], shape (shape, 2, 3)."""


@dataclass(frozen=True)
class Slots:
    """Pixels of slots, by column and row of the tile, which the sums are over."""

    shape: npt.NDArray[np.int32]
    """Shape (slot,)."""
    x: Floats
    """Positions of the columns, from the middle of the shape's box in halves of its longer side, shape
    (slot, TILE).
    """
    y: Floats
    """Positions of the rows, likewise."""
    weight: FloatArray
    """Importance x visibility^2, shape (slot, TILE, TILE)."""
    pull: FloatArray
    """Importance x visibility x residual, shape (slot, 3, TILE, TILE)."""
    color: FloatArray
    """Colours of gradients, 0 for flat shapes; shape (slot, 3, TILE, TILE)."""


class RampSolver:
    """Sums over the visible pixels of each shape of a step's scene, and the ramps that follow from them.

    Residuals are those with each gradient replaced by its mean colour, so that flat shapes and gradients
    compare.
    """

    def __init__(self, step: Step) -> None:
        """Sum up; call it right after ``forward_complete`` of the step's renderer."""
        renderer = step.renderer
        self.scene = step.state.scene()
        self._viewport = renderer.viewport
        self._visible = renderer.visible()
        self._gradient = np.isin(self.scene.paint, GRADIENTS)
        near = step.objective.quadratic()
        self._residual = near.residual()
        self._importance = near.pixel_weights()
        boxes = bounds(self.scene).astype(np.float64)
        self._middle = 0.5 * (boxes[:, :2] + boxes[:, 2:])
        self._half = np.maximum(0.5 * (boxes[:, 2:] - boxes[:, :2]).max(axis=1), 0.5)
        self._values = 3 * self._viewport.pixel_count
        self._measure()

    def _slots(self, shapes: Bools) -> Iterator[Slots]:
        """Yield the slots of ``shapes``, some at a time."""
        seen, scale = self._visible, self._viewport.scale
        at = np.arange(TILE) + 0.5
        chosen = np.flatnonzero(shapes[seen.shape])
        slots_per_chunk = 4096  # slots that are summed over at once: bounds the memory to some 40 MB
        for rows in np.split(chosen, range(slots_per_chunk, len(chosen), slots_per_chunk)):
            shape, tile = seen.shape[rows], seen.tile[rows]
            across, down = tile % self._viewport.tiles_x, tile // self._viewport.tiles_x
            x, y = (
                ((TILE * index[:, None] + at) / scale - self._middle[shape, k, None])
                / self._half[shape, None]
                for k, index in enumerate((across, down))
            )
            share, importance = seen.share[rows], self._importance[tile]
            color = np.zeros((len(rows), 3, TILE, TILE), np.float32)
            gradient = self._gradient[shape]
            color[gradient] = seen.color[np.searchsorted(seen.colored, rows[gradient])]
            weighted = importance * share
            yield Slots(shape, x, y, weighted * share, weighted[:, None] * self._residual[tile], color)

    def _measure(self) -> None:
        """Compute moments of visibility and of residuals by powers of x and y, and what follows from them."""
        count = len(self.scene)
        moments = np.zeros((count, 5, 5))
        pulls, colors = np.zeros((count, 3, 3, 3)), np.zeros((count, 3, 3, 3))
        lost, squares = np.zeros(count), np.zeros((count, 3))
        for slots in self._slots(np.ones(count, np.bool_)):
            x, y = _powers(slots.x), _powers(slots.y)
            np.add.at(moments, slots.shape, _summed(x, slots.weight, y))
            x, y = x[:, None, :3], y[:, None, :3]
            np.add.at(pulls, slots.shape, _summed(x, slots.pull, y))
            if self._gradient[slots.shape].any():
                weighted = slots.weight[:, None] * slots.color
                np.add.at(colors, slots.shape, _summed(x, weighted, y))
                np.add.at(lost, slots.shape, 2 * (slots.pull * slots.color).sum(axis=(1, 2, 3)))
                np.add.at(squares, slots.shape, (weighted * slots.color).sum(axis=(2, 3)))
        gram, pull, colored = _gram(moments), _by_basis(pulls), _by_basis(colors)
        weight = np.maximum(gram[:, 0, :1], 1e-12)
        gradient = self._gradient[:, None]
        self.mean: Floats = np.where(gradient, colored[:, 0] / weight, self.scene.colors)
        """Mean colour of each shape's visible pixels, (shape, 3)."""
        # With the mean m in place of c, the residual grows by v (c - m).
        lost += (squares - self.mean**2 * weight - 2 * self.mean * pull[:, 0]).sum(axis=1)
        lost -= (pull[:, 0] ** 2 / weight).sum(axis=1)
        self.flattening: Floats = np.where(self._gradient, lost, 0) / self._values
        """Increase of the mean squared error where a gradient becomes its best flat colour, (shape,)."""
        missing = colored - gram[:, 0, :, None] * self.mean[:, None]
        pull += np.where(gradient[..., None], missing, 0)
        self._weight, self._pull = weight[:, 0], pull[:, 0]
        self._place = gram[:, 0, 1:] / weight
        """Mean of x, y, x^2 + y^2."""
        spread = gram[:, 1:, 1:] / weight[..., None] - self._place[:, :, None] * self._place[:, None]
        self._spread = spread + RIDGE * np.eye(3)
        self._slope = pull[:, 1:] - self._place[..., None] * pull[:, :1]
        self.flat: Floats = self.mean + pull[:, 0] / weight
        """Best flat colour, (shape, 3)."""

    def _steepest(self, size: int) -> tuple[Floats, Floats, Floats]:
        """Return the best change of colour along a line, linear in the first ``size`` of x, y, x^2 + y^2.

        It is given by the coefficients of the position along the line, shape (shape, size), in units of its
        standard deviation; the colour of such a unit, shape (shape, 3); and the gain, shape (shape,).
        """
        lower = linear.cholesky(self._spread[:, :size, :size])
        left, sizes, right = linear.svd(linear.solve(lower, self._slope[:, :size]))
        along = linear.solve(np.swapaxes(lower, 1, 2), left[:, :, :1])[..., 0]
        tints = (sizes[:, 0] / self._weight)[:, None] * right[:, 0]
        return along, tints, sizes[:, 0] ** 2 / (self._weight * self._values)

    def linear(self) -> Ramps:
        """Return the best linear ramp of each shape."""
        along, tints, gain = self._steepest(2)
        # The axis goes through the mean of the visible pixels, HALF_LENGTH units to either side.
        unit = along / np.maximum((along**2).sum(axis=1), 1e-12)[:, None]
        start = self._middle + self._half[:, None] * (self._place[:, :2] - HALF_LENGTH * unit)
        axis = self._half[:, None] * 2 * HALF_LENGTH * unit
        frames = np.concatenate([start, axis, _turned(axis)], axis=1)
        return _ramps(
            gain,
            frames,
            np.zeros(len(gain)),
            self.flat - HALF_LENGTH * tints,
            self.flat + HALF_LENGTH * tints,
        )

    def radial(self, min_gain: float) -> Ramps:
        """Return the best radial ramp of each shape where its gain may exceed ``min_gain``, else gain 0."""
        along, _, bound = self._steepest(3)
        bend = np.where(np.abs(along[:, 2]) > 1e-9, along[:, 2], 1e-9)
        centre = -along[:, :2] / (2 * bend[:, None])
        # Maximum distance of a radial ramp's centre from the middle of its shape's box, in halves of the
        # longer side of the box: beyond, a linear ramp is as good.
        max_centre_distance = 4.0
        chosen = (np.linalg.norm(centre, axis=1) < max_centre_distance) & (bound > min_gain)
        count = len(chosen)
        gain, radii, slope = np.zeros(count), np.zeros((count, 2)), np.zeros((count, 3))
        for slots in self._slots(chosen):
            x, y = slots.x - centre[slots.shape, :1], slots.y - centre[slots.shape, 1:]
            r = elementary.hypot(x[:, :, None], y[:, None])
            weighted = slots.weight * r
            sums = [weighted.sum(axis=(1, 2)), (weighted * r).sum(axis=(1, 2))]
            np.add.at(radii, slots.shape, np.stack(sums, axis=1))
            away = slots.color - self.mean[slots.shape][:, :, None, None]
            away = np.where(self._gradient[slots.shape][:, None, None, None], away, 0)
            pull = slots.pull + slots.weight[:, None] * away
            np.add.at(slope, slots.shape, (pull * r[:, None]).sum(axis=(2, 3)))
        middle = radii[:, 0] / self._weight
        spread = np.maximum(radii[:, 1] / self._weight - middle**2, 0) + RIDGE
        slope -= middle[:, None] * self._pull
        gain[chosen] = ((slope**2).sum(axis=1) / (self._weight * spread * self._values))[chosen]
        slope /= (self._weight * spread)[:, None]
        reach = HALF_LENGTH * np.sqrt(spread)
        first, last = np.maximum(middle - reach, 0), middle + reach
        ends = (self.flat + (end - middle)[:, None] * slope for end in (first, last))
        axis = np.stack([self._half * last, np.zeros(count)], axis=1)
        place = self._middle + self._half[:, None] * centre
        return _ramps(gain, np.concatenate([place, axis, _turned(axis)], axis=1), first / last, *ends)


def _powers(places: Floats) -> Floats:
    """Return the powers 0 to 4 of places (slot, place), shape (slot, power, place)."""
    squares = places * places
    return np.stack([np.ones_like(places), places, squares, squares * places, squares * squares], axis=1)


def _summed(x: Floats, values: FloatArray, y: Floats) -> Floats:
    """Return sums of values (..., k, m) with weights x (..., i, k) and y (..., j, m), shape (..., i, j)."""
    return linear.product(linear.product(x, values), np.swapaxes(y, -2, -1))


def _turned(axis: Floats) -> Floats:
    """Return axes turned by a right angle, which gives frames of circles."""
    return np.stack([-axis[:, 1], axis[:, 0]], axis=1)


def _ramps(gain: Floats, frames: Floats, first: Floats, low: Floats, high: Floats) -> Ramps:
    """Return ramps with stops at ``first``, shape (shape,), and at 1, of the colours ``low`` and ``high``."""
    offsets = np.stack([first, np.ones(len(first))], axis=1)
    colors = np.clip(np.stack([low, high], axis=1), 0, 1)
    return Ramps(gain, *(np.asarray(values, np.float32) for values in (frames, offsets, colors)))


BASIS = (((0, 0),), ((1, 0),), ((0, 1),), ((2, 0), (0, 2)))
"""1, x, y, x^2 + y^2 as sums of powers of x and y."""


def _by_basis(sums: Floats) -> Floats:
    """Return sums by colour and powers, (shape, 3, power, power), by basis and colour, (shape, 4, 3)."""
    return np.stack([sum(sums[:, :, i, j] for i, j in terms) for terms in BASIS], axis=1)


def _gram(moments: Floats) -> Floats:
    """Return sums by powers, (shape, power, power), as those of products of the basis, (shape, 4, 4)."""
    products = [
        sum(moments[:, i + k, j + m] for i, j in one for k, m in other) for one in BASIS for other in BASIS
    ]
    return np.stack(products, axis=1).reshape(-1, 4, 4)
