"""Forward and backward passes by the engines, on tensors without history."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import torch

from warpsplat.scene.attributes import OPACITY_RANGE
from warpsplat.torch.cuda import is_capturing
from warpsplat.torch.engine import RenderSpec, engine_of, known
from warpsplat.torch.tensors import check_extremes, extremes

Tensor = torch.Tensor

tickets = itertools.count(1)
"""Numbers of forward passes, by which a backward pass recognises its own in an engine."""


class Pass(NamedTuple):
    """A forward pass."""

    image: Tensor
    """Shape (height, width, 4)."""
    spec: RenderSpec
    """As examined."""
    ticket: int

    def state(self) -> Tensor:
        """Return what ``restored`` needs, for those that can only keep tensors; int64, shape (2,)."""
        return torch.tensor([self.ticket, self.spec.opaque], dtype=torch.int64)


def restored(spec: RenderSpec, state: Tensor) -> tuple[RenderSpec, int]:
    """Return the examined specification and the ticket of a pass with ``spec`` that had this ``state``."""
    ticket, opaque = state.tolist()
    return replace(spec, opaque=bool(opaque)), ticket


def examined(spec: RenderSpec, values: Mapping[str, Tensor]) -> RenderSpec:
    """Return ``spec`` with ``opaque``; unless that is known already, check that all values are finite.

    While a CUDA graph is captured nothing can be read back, and nothing is checked; see ``known``.
    """
    if spec.opaque is not None:
        return spec
    if is_capturing(spec.device):
        return known(spec)
    found = dict(zip(values, extremes(values.values()), strict=True))
    check_extremes(found)
    opaque = "opacities" in found and bool(found["opacities"][1] > np.float32(OPACITY_RANGE[1]))
    return replace(spec, opaque=opaque)


def forward(spec: RenderSpec, values: Mapping[str, Tensor]) -> Pass:
    """Render all attributes that the shapes have, by name, in float32; see ``examined``."""
    spec = examined(spec, values)
    shape = spec.viewport.height, spec.viewport.width, 4
    image = torch.empty(shape, dtype=torch.float32, device=spec.device)
    ticket = next(tickets)
    with engine_of(spec) as engine:
        engine.forward(values)
        engine.show(image)
        engine.ticket = ticket
    return Pass(image, spec, ticket)


def backward(
    spec: RenderSpec, ticket: int, values: Mapping[str, Tensor], image_grad: Tensor, wanted: Sequence[str]
) -> dict[str, Tensor]:
    """Return the gradients of the attributes ``wanted`` for that of an image, in the shapes of ``values``."""
    image_grad = image_grad.contiguous()
    found = {
        name: torch.empty(values[name].shape, dtype=torch.float32, device=spec.device) for name in wanted
    }
    with engine_of(spec) as engine:
        if engine.ticket != ticket:  # another call has used the buffers since
            engine.forward(values)
        engine.backward(image_grad, found)
    return found
