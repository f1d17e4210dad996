"""Drawings within a size: with fewer nodes on a coarser grid, or with fewer regions, whichever shows more."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from warpsplat.fit.constraints import Drawing
from warpsplat.fit.loop import Fit
from warpsplat.fit.work import Meter, Report
from warpsplat.scene import Scene
from warpsplat.svg.write import write_svg

Stop = Callable[[], bool]


FEWER_ROUNDS = 5
"""Numbers of regions at the most that are tried for ``max_bytes``."""


class Tries:
    """Progress of the search for a drawing that fits: with fewer and fewer regions or nodes."""

    def __init__(self, report: Report | None, most: int) -> None:
        """``most``: bytes of the file."""
        self._meter, self._most = Meter(report), most
        self._regions = 0
        self.left = float(FEWER_ROUNDS)
        """Attempts with fewer regions still to come."""
        self.priced = 2.0 * USUAL_PRICES
        """Attempts with fewer nodes still to come."""

    def begun(self, traced: Scene) -> Report | None:
        """Return the callback for the next drawing's progress."""
        if not self._regions:
            self._regions = max(len(traced), 1)
            fits = FINISHED * len(write_svg(traced)) <= self._most
            self.left = 0.0 if fits else min(self.left, math.log2(self._regions + 1))
            self.priced = 0.0 if fits else self.priced
        left = self.left + self.priced
        return self._meter.stage(math.sqrt(len(traced) / self._regions), left * SMALLER)


FINISHED, SMALLER = 0.8, 0.7
"""Bytes of a drawing over those as it was traced; work on one of the right size over that on the first. For
progress: in the mean."""


@dataclass(frozen=True, eq=False)
class Sketch:
    """A drawing that may be made simpler."""

    fit: Fit
    size: int
    """Bytes of its file."""
    drawing: Drawing | None
    """Its outlines, of the picture before it was enlarged (``enlargement``); None: it stays as it is."""


PRICE_STEP, DEAREST = 8.0, 4096.0
"""The factor from one price of a byte to the next, and the highest price that is tried."""

PRICES, USUAL_PRICES = 7, 3
"""Most prices that are tried, and how many it takes on average."""

FULL = 0.97
"""The share of the allowed bytes from which a file is full enough."""


def _simpler(
    sketch: Sketch, most: int, finished_again: Callable[[Drawing, float], Sketch], over: Stop
) -> Sketch | None:
    """Return the best drawing within ``most`` bytes with fewer nodes on a coarser grid; None if none fits."""
    best: Sketch | None = None
    low, high, price = 1.0, math.inf, PRICE_STEP
    for _ in range(PRICES):
        if sketch.drawing is None or over() or (best and best.size > FULL * most):
            break
        if best is None and price > DEAREST:
            break
        made = finished_again(sketch.drawing, price)
        if made.size > most:
            low, sketch = price, made
        elif best and made.size == best.size:
            break  # there is nothing between
        else:
            high = price
            best = made if best is None or made.fit.render_psnr > best.fit.render_psnr else best
        price = math.sqrt(low * high) if best else PRICE_STEP * price
    return best


def best_within(
    first: Sketch,
    most: int,
    drawn: Callable[[int], Sketch],
    finished_again: Callable[[Drawing, float], Sketch],
    over: Stop,
    tries: Tries | None,
) -> Fit:
    """Return the best drawing within ``most`` bytes, or the smallest one if none fits.

    Regions go, or nodes; or, from the fewest regions that are still too large, both.

    Args:
        first: a drawing of all regions, which is too large.
        most: bytes of the file.
        drawn: makes one of so many regions.
        finished_again: finishes one anew at a price of a byte (``drawing.tidy``).
        over: whether to take what there is.
        tries: of the progress.
    """
    best, large = _with_fewer_regions(first, most, drawn, over, tries)
    for sketch in [large[0], *large[1:][-1:]]:

        def dearer(drawing: Drawing, price: float) -> Sketch:
            if tries:
                tries.priced = max(tries.priced - 1, 0.0)
            return finished_again(drawing, price)

        made = _simpler(sketch, most, dearer, over)
        if made and (best.size > most or made.fit.render_psnr > best.fit.render_psnr):
            best = made
    return best.fit


def _with_fewer_regions(
    first: Sketch, most: int, drawn: Callable[[int], Sketch], over: Stop, tries: Tries | None
) -> tuple[Sketch, list[Sketch]]:
    """Return the drawing with the most regions within ``most`` bytes, and those that were too large."""
    low, high = 0, len(first.fit.scene)  # regions that fit into the size, and that do not
    best, size, large = first, first.size, [first]
    for _ in range(FEWER_ROUNDS):
        share = most / size if not low else 0.5
        count = min(max(low + round(share * (high - low)), low + 1), high - 1)
        if count <= low or over():
            break
        if tries:
            tries.left = max(min(tries.left, math.log2(high - low)) - 1, 0.0)
        made = drawn(count)
        size = made.size
        if size <= most:
            low, best = count, made
        else:
            high = count
            best = best if low else made
            large.append(made)
    return best, large
