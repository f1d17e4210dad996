"""Pictures as they were before they were blurred or sharpened, or their colours mixed in linear light.

A trace tells the optics better than the one before, and what they leave of the picture makes a better trace.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, Protocol, TypeVar

import numpy as np

from warpsplat.drawing.constraints import DRAFT_GRID
from warpsplat.drawing.optics import Found, Seen
from warpsplat.drawing.trace.grids import Bools, Box
from warpsplat.fit.optics import Optics
from warpsplat.fit.rounding import DB_PER_DOUBLING
from warpsplat.portable.elementary import log10
from warpsplat.scene import FloatArray, Scene
from warpsplat.svg.sizes import estimated_size

TURNS = 6
"""Traces of a picture without its optics, at the most."""

LOOK = 128
"""Side of the part of a picture that is looked at first [px]."""

PARTS = 16
"""Such parts in a picture that is so large that one of them decides whether there is a kernel."""

LIKELY, CLEARLY = 0.9, 0.75
"""Share of the squared error without a kernel that one must leave less than for a trace through it to be
tried, and for that to be kept, of files of one size: blurred pictures have .5 and less."""

MOVED = 2.5
"""Squared error that the first trace in linear light may leave, over that of one in sRGB, whose edges moved
to where they explain the picture: the fit moves those of the right light, too."""


class HasScene(Protocol):
    """A trace."""

    @property
    def scene(self) -> Scene:
        """The scene that it shows."""


Traced = TypeVar("Traced", bound=HasScene)


@dataclass(frozen=True, eq=False)
class Undone(Generic[Traced]):
    """A picture as it was before optics."""

    pixels: FloatArray
    """As the picture's."""
    traced: Traced
    """Their trace."""
    optics: Optics | None = None
    """What is known of the optics; None: there are none, the pixels are the picture's."""
    cost: float = math.inf
    """What the error and the size of the trace cost with them [dB]."""


def without_optics(
    pixels: FloatArray,
    noise: float | None,
    trace: Callable[[FloatArray], Traced],
    show: Callable[[Scene], FloatArray],
    over: Callable[[], bool],
    halved: FloatArray | None = None,
    known: Optics | None = None,
) -> Undone[Traced]:
    """Return pixels as they were before they were blurred or sharpened, and their trace.

    Args:
        pixels: sRGB in [0, 1], shape (height, width, 3), or premultiplied with opacity, (height, width, 4).
        noise: Of them [levels].
        trace: Traces such pixels.
        show: Renders a scene, likewise.
        over: Returns whether there is no time left.
        halved: The pixels before their colours were made as sharp as their lightness, if they were.
        known: Of how they were made.

    Returns:
        ``pixels`` itself if no optics explain it clearly better than its trace does.
    """
    known = known or Optics()
    image = pixels if halved is None else halved
    seen = Seen.of(image, noise, known)
    first = linear = Undone(pixels, trace(pixels))
    if known.kernel is not None or (known.light and seen.edges.is_linear):
        return _undone(seen, first, trace, show, over, is_certain=True)
    if seen.edges.is_linear:
        # That edges look so is not enough: in the right light, a trace explains the picture far better.
        linear = _undone(seen, first, trace, show, over)
        seen = Seen.of(image, noise, Optics("sRGB"))
    if not seen.edges.has_rings:
        box = _busiest(seen.uneven)
        part, some = seen.part(box), pixels[box.slices()]
        found = part.find(*(show(scene) for scene in part.scenes(first.traced.scene, box)))
        if found.error >= LIKELY * found.without or over():
            return linear
        # Of a large picture, a part tells in less time whether there is a kernel.
        is_large = pixels.size > PARTS * some.size
        if is_large and not _undone(part, Undone(some, trace(some)), trace, show, over, turns=1).optics:
            return linear
    return min(linear, _undone(seen, first, trace, show, over), key=lambda each: each.cost)


def _undone(
    seen: Seen,
    first: Undone[Traced],
    trace: Callable[[FloatArray], Traced],
    show: Callable[[Scene], FloatArray],
    over: Callable[[], bool],
    *,
    turns: int = TURNS,
    is_certain: bool = False,
) -> Undone[Traced]:
    """Return a picture without its optics; the ``first``, without any, if that is not clearly better.

    ``is_certain``: better or not.
    """

    def look(traced: Traced) -> tuple[Found, float]:
        """Return the optics of the trace, and what its error and its size cost with them [dB]."""
        found = seen.find(*(show(scene) for scene in seen.scenes(traced.scene)))
        return found, cost_of(found.error, traced.scene)

    if over():
        return first
    best = first
    found, _ = look(first.traced)
    usual = math.inf if is_certain else cost_of(found.without, first.traced.scene)
    bound = clearly = usual + 10 * float(log10(CLEARLY))
    if seen.edges.has_rings or seen.edges.is_linear:
        plain = seen.plain()
        traced = trace(plain)
        found, cost = look(traced)
        if seen.edges.is_linear:
            if cost > usual + 10 * float(log10(MOVED)):
                return first
            bound, best = cost, Undone(plain, traced, seen.known, cost)
    for turn in range(turns):
        # Traces explain more from turn to turn, even through optics that the picture never had.
        if over() or (turn > 1 and bound > usual):
            break
        current = seen.plain(found.undone)
        traced = trace(current)
        found, cost = look(traced)
        if cost >= bound:
            break
        bound, best = cost, Undone(current, traced, seen.known, cost)
    return best if bound <= clearly else first


def _busiest(edges: Bools) -> Box:
    """Return the part of an image of up to LOOK pixels along the sides that has most edges."""
    height, width = (min(LOOK, side) for side in edges.shape)
    sums = np.pad(np.cumsum(np.cumsum(edges, axis=0), axis=1), [(1, 0), (1, 0)])
    sums = sums[height:] - sums[:-height]
    sums = sums[:, width:] - sums[:, :-width]
    top, left = np.unravel_index(int(sums.argmax()), sums.shape)
    return Box(int(left), int(top), int(left) + width, int(top) + height)


def cost_of(error: float, scene: Scene, more: int = 0) -> float:
    """Return what a squared error [levels squared] and the bytes of a scene, and ``more``, cost [dB]."""
    size = estimated_size(scene, DRAFT_GRID) + more
    return 10 * float(log10(max(error, 1))) + DB_PER_DOUBLING * float(log10(size)) / float(log10(2))
