"""Where scenes are rendered."""

from __future__ import annotations

import warnings

import torch

device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
"""Where scenes are rendered. ``pydiffvg.device`` is what it was at first, as in DiffVG."""
use_gpu = device.type == "cuda"
"""Whether that is a GPU. ``pydiffvg.use_gpu`` is what it was at first."""


def set_use_gpu(use: bool) -> None:
    """Render on the GPU, where there is one, or on the CPU."""
    set_device(torch.device("cuda" if use and torch.cuda.is_available() else "cpu"))


def get_use_gpu() -> bool:
    """Whether scenes are rendered on a GPU."""
    return use_gpu


def set_device(d: torch.device | str) -> None:
    """Render on ``d``, see ``nearest``."""
    global device, use_gpu  # noqa: PLW0603 - DiffVG's interface is one device for the process
    device = nearest(d)
    use_gpu = device.type == "cuda"


def nearest(wanted: torch.device | str) -> torch.device:
    """A device or, with a warning, the one nearest to it where it is missing: scripts name the second GPU of
    their author's machine.
    """
    wanted = torch.device(wanted)
    found = _present(wanted)
    if found != wanted:
        warnings.warn(f"there is no {wanted}, {found} is used", stacklevel=3)
    return found


def _present(wanted: torch.device) -> torch.device:
    if wanted.type != "cuda":
        return wanted
    if not torch.cuda.is_available():
        return torch.device("cpu")
    return wanted if (wanted.index or 0) < torch.cuda.device_count() else torch.device("cuda")


def get_device() -> torch.device:
    """Where scenes are rendered, and pictures lie."""
    return device
