"""Smooth shading that no single gradient describes, as bands along its lines of equal tone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import cv2
import numpy as np

from warpsplat.drawing import prices
from warpsplat.drawing.prices import LEAST_ERROR
from warpsplat.drawing.trace.grids import Bools, Floats, bounding_boxes, unchecked
from warpsplat.drawing.trace.palette import UNEVEN, Coloring, Parts
from warpsplat.drawing.trace.ramps import BLUR, Gradients, fit_ramp
from warpsplat.drawing.trace.seeds import ROUNDING
from warpsplat.portable import filters
from warpsplat.portable.linear import product
from warpsplat.scene.attributes import GRADIENTS

LEAST_BAND = 30  # [px] of a band; smaller pieces stay with what surrounds them
MOST_BANDS = 128  # of an image


@dataclass(frozen=True)
class _Piece:
    """A connected part of an image, in its bounding box."""

    left: int
    top: int
    mask: Bools
    """Shape (height, width)."""
    coloring: Coloring
    error: float
    """Sum of the squared errors over all pixels and channels [levels squared]."""
    halves: list[_Piece] = field(default_factory=list)
    """The pieces that it may be cut into."""

    def box(self) -> tuple[slice, slice]:
        """Return the rows and columns of the bounding box."""
        height, width = self.mask.shape
        return slice(self.top, self.top + height), slice(self.left, self.left + width)

    def bytes(self) -> float:
        """Return about the bytes in a file."""
        return prices.REGION if self.coloring.ramp is None else prices.SHADED


def split_uneven(
    image: Floats,
    parts: Parts,
    noise: float,
    check: Callable[[], None] = unchecked,
    gradients: Gradients = GRADIENTS,
) -> Parts:
    """Cut parts that neither a colour nor a gradient describes into bands, as many as are worth their bytes.

    Args:
        image: premultiplied, 0..255, shape (height, width, 4).
        parts: of the image.
        noise: of flat regions [levels].
        check: as for ``trace``.
        gradients: as for ``trace``.
    """
    roots = _uneven(image, parts, UNEVEN + noise)
    if not roots:
        return parts
    rest = image.size * (255**2 * LEAST_ERROR + noise**2)
    others = prices.REGION * (len(parts.paint) - len(roots))

    def byte(pieces: list[_Piece]) -> float:
        """Return the error that a byte is worth if the image has these pieces [levels squared]."""
        error, size = (sum(each) for each in zip(*((one.error, one.bytes()) for one in pieces), strict=True))
        return prices.worth(rest + error, others + size, negligible=0)

    leaves, whole = list(roots), list[_Piece]()
    while leaves and len(leaves) + len(whole) < MOST_BANDS:
        check()
        leaves.sort(key=lambda piece: piece.error)
        piece, price = leaves[-1], byte(leaves + whole)
        if piece.error <= prices.REGION * price:
            break
        leaves.pop()
        halves = _halves(image, piece, gradients)
        gain = piece.error - sum(half.error for half in halves)
        growth = sum(half.bytes() for half in halves) - piece.bytes()
        is_one_tone = _is_one_tone(image[piece.box()][piece.mask], noise)
        if len(halves) > 1 and (gain > growth * price or is_one_tone):
            piece.halves.extend(halves)
            leaves += halves
        else:
            whole.append(piece)
    # The first cuts of a shadow gain little without those that follow: only now those not worth it go.
    bands, count = leaves + whole, 0
    while len(bands) != count:
        count, price = len(bands), byte(bands)
        bands = [band for piece in roots for band in _worthwhile(piece, price)]
    return _with_bands(image, parts, bands)


def _is_one_tone(pixels: Floats, noise: float) -> bool:
    """Return whether colours, shape (pixel, channel), lie on a line, so that bands of one tone show them."""
    off = pixels.astype(np.float64) - pixels.mean(axis=0, dtype=np.float64)
    along = (off * _direction(off)).sum(axis=1)
    return float((off**2).sum() - (along**2).sum()) <= off.size * (ROUNDING + noise) ** 2


def _worthwhile(piece: _Piece, worth: float) -> list[_Piece]:
    """Return the bands that a piece is cut into if a byte is worth so much error [levels squared]."""
    bands = [band for half in piece.halves for band in _worthwhile(half, worth)]
    costs = [sum(one.error + worth * one.bytes() for one in made) for made in ([piece], bands)]
    return bands if bands and costs[1] < costs[0] else [piece]


def _uneven(image: Floats, parts: Parts, least: float) -> list[_Piece]:
    """Return the parts that are off their colouring by more than ``least`` in the root mean square."""
    found = []
    sizes = np.bincount(parts.labels[parts.labels >= 0], minlength=len(parts.paint))
    # Channel by channel: sums along an axis of four take ten times as long.
    off = sum(channel**2 for channel in np.moveaxis(image - parts.fills, 2, 0))
    off = np.where(parts.labels >= 0, off, 0)
    flat = np.bincount(np.maximum(parts.labels, 0).reshape(-1), off.reshape(-1), len(parts.paint))
    boxes = bounding_boxes(parts.labels, len(parts.paint))
    for part in np.flatnonzero(sizes >= 2 * LEAST_BAND).tolist():
        coloring = parts.colorings[parts.paint[part]]
        values = int(sizes[part]) * image.shape[2]
        error = float(flat[part]) if coloring.ramp is None else values * coloring.ramp.residual**2
        if error > values * least**2:
            box = boxes[part]
            mask = parts.labels[box.slices()] == part
            found.append(_Piece(box.left, box.top, mask, coloring, error))
    return found


def _halves(image: Floats, piece: _Piece, gradients: Gradients) -> list[_Piece]:
    """Return the connected parts of the lighter and the darker half of a piece."""
    own, mask = image[piece.box()], piece.mask
    if mask.sum() < 2 * LEAST_BAND or not np.ptp(own[mask], axis=0).any():
        return []
    pixels = own[mask].astype(np.float64)
    tone = np.zeros(mask.shape)
    tone[mask] = ((pixels - pixels.mean(axis=0)) * _direction(pixels)).sum(axis=1)
    soft = filters.blurred_within(tone, mask, BLUR)  # noise does not fray the bands
    light = soft > soft[mask].mean()
    for half in (light, ~light):  # what is too small goes to the other half
        inside = mask & half
        _, numbers = cv2.connectedComponents(inside.astype(np.uint8), connectivity=4)
        small = np.bincount(numbers[inside], minlength=1) < LEAST_BAND
        small[0] = False
        light ^= small[numbers]
    found = []
    for half in (light, ~light):
        _, numbers, boxes, _ = cv2.connectedComponentsWithStats(
            (mask & half).astype(np.uint8), connectivity=4
        )
        for number, (left, top, width, height, _) in enumerate(boxes[1:].tolist(), 1):
            part = numbers[top : top + height, left : left + width] == number
            found.append(_piece(image, piece.left + left, piece.top + top, part, gradients))
    return found


def _direction(pixels: Floats) -> Floats:
    """Return about the unit vector along which colours, shape (pixel, channel), vary most."""
    off = pixels - pixels.mean(axis=0)
    matrix = product(off.T, off)
    direction = matrix[:, matrix.diagonal().argmax()]
    return direction / np.sqrt((direction**2).sum())


def _piece(image: Floats, left: int, top: int, mask: Bools, gradients: Gradients) -> _Piece:
    """Return a part of the image, in its bounding box, with the better of a flat colour and a gradient."""
    box = image[top : top + mask.shape[0], left : left + mask.shape[1]]
    pixels = box[mask].astype(np.float64)
    mean = pixels.mean(axis=0)
    flat = float(((pixels - mean) ** 2).sum())
    ramp = fit_ramp(box, mask, left, top, gradients)
    if ramp and ramp.is_better_than(flat / pixels.size):
        error = pixels.size * ramp.residual**2
        return _Piece(left, top, mask, Coloring(mean, ramp, is_band=True), error)
    return _Piece(left, top, mask, Coloring(np.round(mean), is_band=True), flat)


def _with_bands(image: Floats, parts: Parts, pieces: list[_Piece]) -> Parts:
    """Return the parts with some of them replaced by ``pieces``."""
    labels, fills = parts.labels.copy(), parts.fills.copy()
    for number, piece in enumerate(pieces, len(parts.paint)):
        labels[piece.box()][piece.mask] = number
        is_flat = piece.coloring.ramp is None
        fills[piece.box()][piece.mask] = piece.coloring.color if is_flat else image[piece.box()][piece.mask]
    first = len(parts.colorings)
    paint = np.concatenate([parts.paint, np.arange(first, first + len(pieces), dtype=parts.paint.dtype)])
    return Parts(labels, fills, paint, parts.colorings + [piece.coloring for piece in pieces])
