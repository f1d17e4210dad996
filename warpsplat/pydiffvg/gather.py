"""A scene's tensors -> weighted sums of their numbers, differentiated as a whole."""

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

    def add_gradient(self, total: Tensor, grad: Tensor) -> None:
        """Add the gradient of the numbers to ``total``, shape (number,); ``grad``: that of the sums."""
        each = grad if self._weight is None else self._weight * grad
        total.index_add_(0, self._index, each.reshape(-1))


class GatherAll(torch.autograd.Function):
    """Tensors -> their numbers one after the other, behind the constants 0 and 1; and sums of these."""

    @staticmethod
    def forward(
        ctx: Any, places: Sequence[Place], gathers: Sequence[Gather], *tensors: Tensor
    ) -> tuple[Tensor, ...]:
        """Return the numbers, shape (number,), and the sums; ``places``: of the tensors among the numbers."""
        ctx.places, ctx.gathers = places, gathers
        ctx.set_materialize_grads(False)
        constants = torch.tensor([0.0, 1.0], dtype=torch.float32, device=tensors[0].device)
        numbers = _flatten_dense_tensors((constants, *tensors))
        ctx.count = len(numbers)
        return numbers, *(gather(numbers) for gather in gathers)

    @staticmethod
    def backward(ctx: Any, grad: Tensor | None, *grads: Tensor | None) -> tuple[Tensor | None, ...]:
        """Return views of the gradient in the shapes of the tensors."""
        given = [(gather, own) for gather, own in zip(ctx.gathers, grads, strict=True) if own is not None]
        if grad is None and not given:
            return (None,) * len(ctx.needs_input_grad)
        total = (
            grad.clone(memory_format=torch.contiguous_format)
            if grad is not None
            else given[0][1].new_zeros(ctx.count)
        )
        for gather, own in given:
            gather.add_gradient(total, own)
        each = zip(ctx.places, ctx.needs_input_grad[2:], strict=True)
        return None, None, *(total.as_strided(*place) if needed else None for place, needed in each)


def picked(indices: npt.ArrayLike, device: torch.device) -> Gather:
    """Return what picks single numbers, in the shape of their ``indices``."""
    found = np.asarray(indices, np.int64)[..., None]
    return Gather(Terms(found, np.ones(found.shape)), device)


def on(array: npt.NDArray[Any], device: torch.device) -> Tensor:
    """Return an array as a tensor on a device."""
    return torch.from_numpy(np.ascontiguousarray(array)).to(device)
