"""Rendering of large SVGs strip by strip: less memory, several cores, and a chance to stop in between."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import numpy.typing as npt

from warpsplat.errors import ImageError, Stopped
from warpsplat.native import available_cores
from warpsplat.svg.viewer import render_own, render_svg
from warpsplat.svg.write import OUR_HEAD, resized

Bytes = npt.NDArray[np.uint8]
Stop = Callable[[], bool]

STRIP_PIXELS = 1 << 20
"""Pixels of a strip."""

WHOLE_PIXELS = 1 << 22
"""Largest SVG that is drawn in one piece [pixels]. In strips, edges move by thousandths of a pixel, because a
viewer clips curves at the border of its canvas; the PSNR changes by less than 0.0001 dB."""

DRAWERS = 4
"""Most strips that are drawn at once."""


def check_stop(stop: Stop | None) -> None:
    """Raise ``Stopped`` if ``stop`` returns true."""
    if stop and stop():
        raise Stopped


def rows_of(width: int, height: int, overlap: int = 0) -> Iterator[slice]:
    """Yield the rows of strips of ``STRIP_PIXELS`` from top to bottom, each up to ``overlap`` rows longer."""
    step = max(1, STRIP_PIXELS // width)
    for top in range(0, height - overlap, step):
        yield slice(top, min(top + step + overlap, height))


def draw(text: str, width: int, height: int, stop: Stop | None = None, *, own: bool = False) -> Bytes:
    """Render an SVG with resvg at ``width`` x ``height`` px: sRGB and opacity, shape (height, width, 4).

    Large files written here are drawn in strips, others in one piece. ``own``: this program wrote the text
    just now, so that it needs no precautions.

    Raises:
        ImageError: Not an SVG, or one of other proportions.
        Stopped: ``stop`` returned true.
    """
    check_stop(stop)
    head = OUR_HEAD.match(text)
    cuttable = head is not None and (int(head[1]), int(head[2])) == (width, height)

    def drawn(text: str, height: int) -> Bytes:
        image = render_own(text) if own else render_svg(text, width=width, height=height)
        if image.size != (width, height):
            size = f"{image.width}x{image.height}"
            raise ImageError(f"renders as {size}, the image has {width}x{height} pixels")
        return np.asarray(image.convert("RGBA"))

    if not cuttable or width * height <= WHOLE_PIXELS:
        return drawn(text, height)

    def strip(rows: slice) -> Bytes:
        check_stop(stop)
        tall = rows.stop - rows.start
        return drawn(resized(text, width, tall, 1.0, rows.start), tall)

    out = np.empty((height, width, 4), np.uint8)
    strips = list(rows_of(width, height))
    with ThreadPoolExecutor(min(DRAWERS, available_cores())) as drawers:
        try:
            for rows, part in zip(strips, drawers.map(strip, strips), strict=True):
                out[rows] = part
        except BaseException:
            drawers.shutdown(wait=False, cancel_futures=True)
            raise
    return out
