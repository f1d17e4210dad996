"""Versions of CUDA that Warp's runtime knows, and errors in the words of its native code."""

from __future__ import annotations

import re
from typing import Any

import warp as wp

OUT_OF_MEMORY, NO_DEVICE = 2, 100
"""CUDA's errors for a lack of memory, and where it sees no GPU, as with an empty CUDA_VISIBLE_DEVICES."""

NATIVE = re.compile(r"Warp CUDA error (\d+)(?:: (.*?))?(?: \(in function|$)", re.MULTILINE)


def runtime() -> Any:
    """Return Warp's runtime, once Warp is started."""
    from warp._src import context

    return context.runtime


def cuda_error(text: str | None = None) -> tuple[int, str]:
    """Return number and text of CUDA's error in ``text``, by default of the last one; (0, "") if none."""
    found = NATIVE.search(runtime().get_error_string() if text is None else text)
    return (int(found[1]), found[2] or f"CUDA error {found[1]}") if found else (0, "")


def toolkit() -> str:
    """Return the name of this build of Warp, which goes by the version of CUDA that it is made for."""
    return f"Warp {wp.__version__} for CUDA {words(runtime().toolkit_version)}"


def words(version: tuple[int, int] | None) -> str:
    """Return a version of CUDA as people write it."""
    return ".".join(map(str, version or ()))


def called(device: wp.Device) -> str:
    """Return how messages call a device."""
    return "the CPU" if device.is_cpu else f"{device} ({device.name})"
