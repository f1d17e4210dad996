"""Whether a device has the memory for a picture, said before anything is allocated for it."""

from __future__ import annotations

import warp as wp

from warpsplat.errors import ResourceError
from warpsplat.native import machine_memory
from warpsplat.rendering.backend import Viewport

SHARE = 0.9
"""Share of a machine's memory that may be taken, as other programs need some."""

MOST_SIDE = (1 << 31) - 1
"""Largest side of a picture [px]: kernels count in 32 bits."""

PIXEL = 48
"""Bytes for each pixel, as measured: the film and its gradient, a slot of each tile, the picture itself."""

SMALL = 1 << 28
"""Bytes that are not asked for: asking how many there are takes longer than many a picture."""


def check_room(viewport: Viewport, device: wp.Device, count: int = 1) -> None:
    """Whether there is memory for ``count`` pictures, of which one is drawn at a time.

    Raises:
        ResourceError: there is not.
    """
    wanted = (PIXEL + PICTURE * (count - 1)) * viewport.pixel_count
    if wanted <= SMALL:
        return
    there = machine_memory() if device.is_cpu else device.total_memory
    limit = None if there is None else round(SHARE * there)
    if limit is not None and wanted > limit:
        several = f"{count} pictures" if count > 1 else "a picture"
        size = f"{several} of {viewport.width}x{viewport.height} px"
        raise ResourceError(
            f"{size} would take about {in_words(wanted)}, memory for it is {in_words(limit)}; draw it smaller"
        )


PICTURE = 16
"""Bytes for each pixel of a finished picture: four channels."""


def in_words(size: int) -> str:
    """Bytes, for people."""
    size = min(size, 10**300)  # what floats hold
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
