"""Where scenes are rendered."""

from __future__ import annotations

import warnings

import torch

_device = torch.device("cuda" if torch.cuda.is_available() else "cpu")


def set_use_gpu(use: bool) -> None:
    """Render on the GPU, where there is one, or on the CPU."""
    set_device(torch.device("cuda" if use and torch.cuda.is_available() else "cpu"))


def get_use_gpu() -> bool:
    """Whether scenes are rendered on a GPU."""
    return _device.type == "cuda"


def set_device(device: torch.device | str) -> None:
    """Render on ``device``; on the nearest that there is, with a warning, where that is missing: scripts name
    the second GPU of their author's machine.
    """
    global _device  # noqa: PLW0603 - DiffVG's interface is one device for the process
    wanted = torch.device(device)
    _device = _present(wanted)
    if _device != wanted:
        warnings.warn(f"there is no {wanted}, {_device} is used", stacklevel=2)


def _present(device: torch.device) -> torch.device:
    if device.type != "cuda":
        return device
    if not torch.cuda.is_available():
        return torch.device("cpu")
    return device if (device.index or 0) < torch.cuda.device_count() else torch.device("cuda")


def get_device() -> torch.device:
    """Where scenes are rendered, and pictures lie."""
    return _device
