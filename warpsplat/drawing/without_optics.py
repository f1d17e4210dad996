"""Pictures as they were before they were blurred or sharpened, or their colours mixed in linear light.

A trace tells the optics better than the one before, and what they leave of the picture makes a better trace.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol, TypeVar

import numpy as np

from warpsplat.drawing.constraints import DRAFT_GRID
from warpsplat.drawing.optics import Found, Seen
from warpsplat.drawing.trace.grids import Bools, Box
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


def without_optics(
    pixels: FloatArray,
    noise: float | None,
    trace: Callable[[FloatArray], Traced],
    show: Callable[[Scene], FloatArray],
    over: Callable[[], bool],
    halved: FloatArray | None = None,
) -> tuple[FloatArray, Traced]:
    """Return pixels as they were before they were blurred or sharpened, and their trace.

    Args:
        pixels: sRGB in [0, 1], shape (height, width, 3), or premultiplied with opacity, (height, width, 4).
        noise: Of them [levels].
        trace: Traces such pixels.
        show: Renders a scene, likewise.
        over: Returns whether there is no time left.
        halved: The pixels before their colours were made as sharp as their lightness, if they were.

    Returns:
        ``pixels`` itself if no optics explain it clearly better than its trace does.
    """
    seen = Seen.of(pixels if halved is None else halved, noise)
    first = pixels, trace(pixels)
    if not (seen.edges.has_rings or seen.edges.is_linear):
        box = _busiest(seen.uneven)
        part, some = seen.part(box), pixels[box.slices()]
        found = part.find(*(show(scene) for scene in part.scenes(first[1].scene, box)))
        if found.error >= LIKELY * found.without or over():
            return first
        # Of a large picture, a part tells in less time whether there is a kernel.
        is_large = pixels.size > PARTS * some.size
        if is_large and _undone(part, (some, trace(some)), trace, show, over, 1)[0] is some:
            return first
    return _undone(seen, first, trace, show, over)


def _undone(
    seen: Seen,
    first: tuple[FloatArray, Traced],
    trace: Callable[[FloatArray], Traced],
    show: Callable[[Scene], FloatArray],
    over: Callable[[], bool],
    turns: int = TURNS,
) -> tuple[FloatArray, Traced]:
    """Return pixels without the optics of a picture, and their trace; the ``first`` if that is not better."""

    def look(traced: Traced) -> tuple[Found, float]:
        """Return the optics of the trace, and what its error and its size cost with them [dB]."""
        found = seen.find(*(show(scene) for scene in seen.scenes(traced.scene)))
        return found, _cost(found.error, traced.scene)

    if over():
        return first
    best = first
    found, _ = look(first[1])
    usual = _cost(found.without, first[1].scene)
    bound = clearly = usual + 10 * float(log10(CLEARLY))
    if seen.edges.has_rings or seen.edges.is_linear:
        plain = seen.plain()
        traced = trace(plain)
        found, cost = look(traced)
        if seen.edges.is_linear:
            if cost > usual + 10 * float(log10(MOVED)):
                return first
            bound, best = cost, (plain, traced)
    for turn in range(turns):
        # Traces explain more from turn to turn, even through optics that the picture never had.
        if over() or (turn > 1 and bound > usual):
            break
        current = seen.plain(found.undone)
        traced = trace(current)
        found, cost = look(traced)
        if cost >= bound:
            break
        bound, best = cost, (current, traced)
    return best if bound <= clearly else first


def _busiest(edges: Bools) -> Box:
    """Return the part of an image of up to LOOK pixels along the sides that has most edges."""
    height, width = (min(LOOK, side) for side in edges.shape)
    sums = np.pad(np.cumsum(np.cumsum(edges, axis=0), axis=1), [(1, 0), (1, 0)])
    sums = sums[height:] - sums[:-height]
    sums = sums[:, width:] - sums[:, :-width]
    top, left = np.unravel_index(int(sums.argmax()), sums.shape)
    return Box(int(left), int(top), int(left) + width, int(top) + height)


def _cost(error: float, scene: Scene) -> float:
    """Return what an error and the bytes of a scene cost [dB]."""
    size = estimated_size(scene, DRAFT_GRID)
    return 10 * float(log10(max(error, 1))) + DB_PER_DOUBLING * float(log10(size)) / float(log10(2))
