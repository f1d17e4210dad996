"""Whether a device has the memory for an image, checked before anything is allocated for it."""

from __future__ import annotations

from typing import TYPE_CHECKING

from warpsplat.errors import ResourceError
from warpsplat.native import machine_memory

if TYPE_CHECKING:
    import warp as wp

    from warpsplat.rendering.backend import Viewport

SHARE = 0.9
"""Share of a machine's memory that may be taken, as other programs need some."""

MOST_SIDE = (1 << 31) - 1
"""Largest side of an image [px]: kernels count in 32 bits."""

UNCHECKED = 1 << 28
"""Bytes that are always allowed: asking how many there are takes longer than drawing many an image."""


def check_memory(viewport: Viewport, device: wp.Device, count: int = 1) -> None:
    """Check that there is memory for ``count`` images, of which one is drawn at a time.

    Raises:
        ResourceError: there is not.
    """
    # Memory for each pixel of an image that is drawn, as measured: the film and its gradient, a slot of each
    # tile, the finished image.
    drawn_bytes = 48
    finished_bytes = 16  # memory for each pixel of a finished image: four channels
    wanted = (drawn_bytes + finished_bytes * (count - 1)) * viewport.pixel_count
    if wanted <= UNCHECKED:
        return
    there = machine_memory() if device.is_cpu else device.free_memory
    limit = None if there is None else round(SHARE * there)
    if limit is not None and wanted > limit:
        several = f"{count} pictures" if count > 1 else "a picture"
        size = f"{several} of {viewport.width}x{viewport.height} px"
        raise ResourceError(
            f"{size} would take about {in_words(wanted)}, memory for it is {in_words(limit)}; draw it smaller"
        )


def in_words(size: int) -> str:
    """Return a number of bytes as text for people."""
    size = min(size, 10**300)  # what floats hold
    return f"{size / 1e9:.1f} GB" if size >= 1e9 else f"{size / 1e6:.0f} MB"
