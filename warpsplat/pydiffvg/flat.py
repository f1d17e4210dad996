"""All tensors of a scene one after the other: one that torch differentiates, in place of hundreds."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch

from warpsplat.pydiffvg.arguments import Structure

Tensor = torch.Tensor
Index = npt.NDArray[np.int64]

ZERO, ONE = 0, 1
"""Where the flat tensor has these numbers: what a scene has no tensor for has an index nevertheless."""

IDENTITY = (ONE, ZERO, ZERO, ZERO, ONE, ZERO, ZERO, ZERO, ONE)
BLACK = (ZERO, ZERO, ZERO, ONE)

COORDINATES = {"circle": 3, "ellipse": 4, "rect": 4}
"""Numbers that say where a shape is; those of a path are two a point."""


class Flat(torch.autograd.Function):
    """Tensors -> their numbers one after the other, behind 0 and 1.

    One function, as an operation of torch for each of hundreds of tensors takes longer than to render them.
    The gradients are parts of one tensor.
    """

    @staticmethod
    def forward(ctx: Any, *tensors: Tensor) -> Tensor:
        """Shape (number,)."""
        ctx.shapes = [tensor.shape for tensor in tensors]
        constants = torch.tensor([0.0, 1.0], device=tensors[0].device)
        # A view takes microseconds, of hundreds of tensors; those of one dimension need none.
        return torch.cat([constants, *(each if each.dim() == 1 else each.reshape(-1) for each in tensors)])

    @staticmethod
    def backward(ctx: Any, grad: Tensor) -> tuple[Tensor | None, ...]:
        """The part of each."""
        parts = grad[2:].split([shape.numel() for shape in ctx.shapes])
        each = zip(parts, ctx.shapes, ctx.needs_input_grad, strict=True)
        return tuple(
            None if not needed else part if len(shape) == 1 else part.view(shape)
            for part, shape, needed in each
        )


class PaintPlace(NamedTuple):
    """Where the numbers of a paint begin."""

    first: int
    """Of a colour, or of the beginning or centre of a gradient; behind these the end or radius."""
    offsets: int
    colors: int


class Places(NamedTuple):
    """Where the numbers of a scene are."""

    outlines: tuple[int, ...]
    """Of each shape the first."""
    widths: tuple[int, ...]
    """Of each shape the first."""
    fills: tuple[PaintPlace | None, ...]
    """Of each group."""
    strokes: tuple[PaintPlace | None, ...]
    maps: tuple[Sequence[int], ...]
    """Of each group all nine."""


def places_of(structure: Structure) -> Places:
    """In the order of ``SceneArguments.tensors``."""
    at = ONE + 1
    outlines, widths = [], []
    for form in structure.forms:
        outlines.append(at)
        widths.append(at := at + (COORDINATES.get(form.kind, 2 * form.points)))
        at += form.points if form.tapers else 1
    paints: tuple[list[PaintPlace | None], list[PaintPlace | None]] = [], []
    maps: list[Sequence[int]] = []
    for plan in structure.plans:
        for paint, found in zip((plan.fill, plan.stroke), paints, strict=True):
            found.append(None)
            if paint is not None:
                kind, stops = paint
                found[-1] = PaintPlace(at, at + 4, at + 4 + stops)
                at += 4 if kind == "flat" else 4 + stops + 4 * max(stops, 1)
        maps.append(range(at, at + 9) if plan.is_mapped else IDENTITY)
        at += 9 * plan.is_mapped
    return Places(tuple(outlines), tuple(widths), tuple(paints[0]), tuple(paints[1]), tuple(maps))


class Sum:
    """Numbers as sums of a few others, each times a weight."""

    def __init__(self, index: Index, weight: npt.NDArray[np.float32], device: torch.device) -> None:
        """``index``, ``weight``: shape (..., term)."""
        # Terms that count nothing last: there are as few as the longest sum needs.
        order = np.argsort(weight == 0, axis=-1, kind="stable")
        index, weight = np.take_along_axis(index, order, -1), np.take_along_axis(weight, order, -1)
        terms = max(1, int((weight != 0).any(axis=tuple(range(weight.ndim - 1))).sum()))
        self._shape = weight.shape[:-1]
        self._index = on(np.moveaxis(index, -1, 0)[:terms].reshape(-1), device)
        self._weight = (
            None
            if terms == 1 and (weight[..., 0] == 1).all()
            else on(np.moveaxis(weight, -1, 0)[:terms].astype(np.float32), device)
        )

    def of(self, flat: Tensor) -> Tensor:
        """The sums, in the shape of the indices."""
        found = flat.index_select(0, self._index)
        if self._weight is None:
            return found.view(self._shape)
        return (self._weight * found.view(self._weight.shape)).sum(dim=0)


def on(array: npt.NDArray[Any], device: torch.device) -> Tensor:
    """An array as a tensor; indices of 64 bits."""
    return torch.from_numpy(np.ascontiguousarray(array)).to(device)
