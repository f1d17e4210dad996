"""Drawings within a size: with fewer nodes on a coarser grid, or with fewer regions, whichever shows more."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from warpsplat.fit.problem import Fit

if TYPE_CHECKING:
    from warpsplat.drawing.constraints import Drawing


@dataclass(frozen=True, eq=False)
class Sketch:
    """A drawing that may be made simpler."""

    fit: Fit
    size: int
    """Bytes of its file."""
    drawing: Drawing | None
    """Its outlines, on the image before it was enlarged; None: they cannot be simplified."""


FEWER_ROUNDS = 5
"""Most numbers of regions that are tried."""

PRICE_STEP, DEAREST = 8.0, 4096.0
"""The factor from one price of a byte to the next, and the highest price that is tried."""

PRICES = 7
"""Most prices that are tried."""

FULL_FILE = 0.97
"""The share of the allowed bytes from which a file is full enough."""


def best_within(
    first: Sketch,
    most: int,
    fewer: Callable[[int], Sketch],
    simpler: Callable[[Drawing, float], Sketch],
    over: Callable[[], bool],
) -> Fit:
    """Return the best drawing within ``most`` bytes, or the smallest one if none fits.

    It removes regions, or nodes, or nodes of the drawing with the fewest regions that is still too large.

    ``first``, which has all regions, is too large; ``fewer`` draws a number of regions; ``simpler``
    finishes a drawing again at a price of a byte (``drawing.tidy``); ``over`` returns whether to take the
    best so far.
    """
    best, large = _with_fewer_regions(first, most, fewer, over)
    for sketch in [large[0], *large[1:][-1:]]:
        made = _with_fewer_nodes(sketch, most, simpler, over)
        if made and (best.size > most or made.fit.render_psnr > best.fit.render_psnr):
            best = made
    return best.fit


def _with_fewer_nodes(
    sketch: Sketch, most: int, simpler: Callable[[Drawing, float], Sketch], over: Callable[[], bool]
) -> Sketch | None:
    """Return the best drawing within ``most`` bytes with fewer nodes on a coarser grid; None if none fits."""
    best: Sketch | None = None
    low, high, price = 1.0, math.inf, PRICE_STEP
    for _ in range(PRICES):
        if sketch.drawing is None or over() or (best and best.size > FULL_FILE * most):
            break
        if best is None and price > DEAREST:
            break
        made = simpler(sketch.drawing, price)
        if made.size > most:
            low, sketch = price, made
        elif best and made.size == best.size:
            break  # there is nothing between
        else:
            high = price
            best = made if best is None or made.fit.render_psnr > best.fit.render_psnr else best
        price = math.sqrt(low * high) if best else PRICE_STEP * price
    return best


def _with_fewer_regions(
    first: Sketch, most: int, fewer: Callable[[int], Sketch], over: Callable[[], bool]
) -> tuple[Sketch, list[Sketch]]:
    """Return the drawing with the most regions within ``most`` bytes, and those that were too large."""
    low, high = 0, len(first.fit.scene)  # regions that fit into the size, and that do not
    best, size, large = first, first.size, [first]
    for _ in range(FEWER_ROUNDS):
        share = most / size if not low else 0.5
        count = min(max(low + round(share * (high - low)), low + 1), high - 1)
        if count <= low or over():
            break
        made = fewer(count)
        size = made.size
        if size <= most:
            low, best = count, made
        else:
            high = count
            best = best if low else made
            large.append(made)
    return best, large
