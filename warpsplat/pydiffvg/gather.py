"""One tensor with all numbers of a scene, and weighted sums of them, differentiated as a whole."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
from torch._utils import _flatten_dense_tensors

Tensor = torch.Tensor
Place = tuple[tuple[int, ...], tuple[int, ...], int]
"""Shape, strides and index of the first number."""
FIRST = 2
"""Index of the first number of a scene's tensors: the constants 0 and 1 come before."""
Index = npt.NDArray[np.int64]


class Concatenate(torch.autograd.Function):
    """Tensors -> the numbers 0 and 1, then their values one after the other.

    One operation for all of them: one of torch's for each of hundreds of tensors takes longer than rendering.
    """

    @staticmethod
    def forward(ctx: Any, places: Sequence[Place], *tensors: Tensor) -> Tensor:
        """Return the numbers, shape (number,); ``places``: of the tensors among them."""
        ctx.places = places
        constants = torch.tensor([0.0, 1.0], device=tensors[0].device)
        return _flatten_dense_tensors((constants, *tensors))

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        """Return views of the gradient in the shapes of the tensors."""
        whole = grad.clone(memory_format=torch.contiguous_format)
        each = zip(ctx.places, ctx.needs_input_grad[1:], strict=True)
        return None, *(whole.as_strided(*place) if needed else None for place, needed in each)


def places_of(tensors: Sequence[Tensor]) -> tuple[Place, ...]:
    """Return where the values of tensors lie among a scene's numbers."""
    sizes = [tensor.numel() for tensor in tensors]
    starts = itertools.accumulate(sizes, initial=FIRST)
    shapes = [tuple(tensor.shape) for tensor in tensors]
    strides = [tuple(math.prod(shape[i + 1 :]) for i in range(len(shape))) for shape in shapes]
    return tuple(zip(shapes, strides, starts))  # noqa: B905 - the last start is the end


class Terms(NamedTuple):
    """Weighted sums."""

    indices: Index
    """Summands, shape (..., term)."""
    weights: npt.NDArray[np.float64]
    """Shape (..., term); 0 for terms that only fill up the array."""

    def map(self, change: Callable[[Any], Any]) -> Terms:
        """Return the sums with both arrays changed alike."""
        return Terms(change(self.indices), change(self.weights))


def combined(parts: Sequence[Terms], combine: Callable[[list[Any]], Any]) -> Terms:
    """Return several sums as one; ``combine``: ``np.stack`` or ``np.concatenate``."""
    return Terms(combine([part.indices for part in parts]), combine([part.weights for part in parts]))


class Gather:
    """Computes weighted sums of a scene's numbers."""

    def __init__(self, terms: Terms, device: torch.device) -> None:
        # Terms of weight 0 go last, and only as many terms are kept as the longest sum needs.
        order = np.argsort(terms.weights == 0, axis=-1, kind="stable")
        count = max(1, int((terms.weights != 0).sum(axis=-1).max(initial=0)))
        index, weight = terms.map(
            lambda each: np.moveaxis(np.take_along_axis(each, order, -1)[..., :count], -1, 0)
        )
        self._shape = weight.shape[1:]
        self._index = on(index.reshape(-1), device)
        self._weight = None if count == 1 and (weight == 1).all() else on(weight.astype(np.float32), device)

    def __call__(self, numbers: Tensor) -> Tensor:
        """Return the sums, in the shape of ``Terms`` without the last axis; ``numbers``: shape (number,)."""
        found = numbers.index_select(0, self._index)
        if self._weight is None:
            return found.view(self._shape)
        return (self._weight * found.view(self._weight.shape)).sum(dim=0)


def on(array: npt.NDArray[Any], device: torch.device) -> Tensor:
    """Return an array as a tensor on a device."""
    return torch.from_numpy(np.ascontiguousarray(array)).to(device)
