"""The device that scenes are rendered on."""

from __future__ import annotations

import warnings

import torch

device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
"""Where scenes are rendered. As in DiffVG ``pydiffvg.device`` keeps the initial value."""
use_gpu = device.type == "cuda"
"""Whether that is a GPU. ``pydiffvg.use_gpu`` keeps the initial value."""


def set_use_gpu(use: bool) -> None:
    """Render on the GPU, if there is one, or on the CPU."""
    set_device(torch.device("cuda" if use and torch.cuda.is_available() else "cpu"))


def get_use_gpu() -> bool:
    """Return whether scenes are rendered on a GPU."""
    return use_gpu


def set_device(d: torch.device | str) -> None:
    """Render on ``d``, or on the device that ``nearest`` returns for it."""
    global device, use_gpu  # noqa: PLW0603 - DiffVG's interface is one device for the process
    device = nearest(d)
    use_gpu = device.type == "cuda"


def get_device() -> torch.device:
    """Return the device that scenes are rendered on and images are on."""
    return device


def nearest(wanted: torch.device | str) -> torch.device:
    """Return a device, or with a warning the nearest one if it is missing.

    Scripts name the second GPU of their author's machine.
    """
    wanted = torch.device(wanted)
    count = torch.cuda.device_count() if torch.cuda.is_available() else 0
    if wanted.type != "cuda" or (wanted.index or 0) < count:
        return wanted
    found = torch.device("cuda" if count else "cpu")
    warnings.warn(f"there is no {wanted}, {found} is used", stacklevel=3)
    return found
