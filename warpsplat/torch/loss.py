"""Losses written in torch, for the fit."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from warpsplat.errors import UsageError, shown
from warpsplat.scene import FloatArray
from warpsplat.torch.cuda import can_use


def with_gradient(function: Callable[..., Any], device: str) -> Callable[..., tuple[FloatArray, FloatArray]]:
    """Return a function of arrays that returns what ``function`` makes of the tensors, and the gradient by
    the first of them.

    The tensors are on a device of Warp's, or on the CPU where this torch cannot use that. It raises
    ``UsageError`` if there is no gradient.
    """
    place = device if can_use(device) else "cpu"

    def evaluate(image: FloatArray, *target: FloatArray) -> tuple[FloatArray, FloatArray]:
        with torch.enable_grad():
            render = torch.tensor(image, device=place, requires_grad=True)
            value = function(render, *(torch.tensor(each, device=place) for each in target))
            if not isinstance(value, torch.Tensor):
                raise UsageError(f"the loss returned {shown(value)}, which is not a tensor with a gradient")
            found = (
                torch.autograd.grad(value.mean(), render, allow_unused=True) if value.requires_grad else ()
            )
        if not found or found[0] is None:
            raise UsageError("the loss has no gradient: torch sees no path from the render to its value")
        return _on_host(value), _on_host(found[0])

    return evaluate


def _on_host(values: torch.Tensor) -> FloatArray:
    return np.asarray(values.detach().float().cpu())
