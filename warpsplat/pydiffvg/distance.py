"""Signed distances from outlines, exact, with gradients.

A kernel finds the nearest curve and point for each position. That point, a sum of the curve's control points
with constant weights, and its distance are computed by torch, which differentiates them.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import torch
import warp as wp

from warpsplat.kernels import constants
from warpsplat.pydiffvg.arguments import ZERO, SceneArguments, ShapeStructure, Structure
from warpsplat.pydiffvg.gather import Gather, GatherAll, Terms, combined, on
from warpsplat.pydiffvg.kernels import distance as kernels
from warpsplat.pydiffvg.layout import IDENTITY, KEPT, coordinates, indices, segments
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.device import start_warp
from warpsplat.rendering.device_lock import device_lock
from warpsplat.torch.cuda import shared_stream

Tensor = torch.Tensor


class Curves(NamedTuple):
    """The outlines of a structure's groups, as curves of ``kernels.distance``."""

    controls: Gather
    """[shape units], shape (curve, 4, 2)."""
    kind: Tensor
    is_drawn: Tensor
    group_first: Tensor
    rule: Tensor
    """Arrays of ``nearest_points``, int32."""
    is_ellipse: Tensor
    """Shape (curve,)."""
    transforms: Tensor | None
    """Indices of the entries of each curve's transform, shape (9 x curve,); None: all are the identity."""


def distances(scene: SceneArguments, positions: Tensor, threads: int) -> Tensor:
    """Return the signed distance of each position from the nearest outline [canvas units].

    It is negative inside of the fill of the group whose outline is nearest, and 0 in an empty scene.
    Strokes have no width. Gradients flow to shapes, transforms and positions; on an outline they are 0.

    Args:
        scene: the scene.
        positions: [canvas units], shape (position, 2).
        threads: of the CPU.
    """
    curves = curves_of(scene.structure, positions.device)
    if not len(curves.kind):
        return torch.zeros(len(positions), device=positions.device)
    numbers: Tensor = GatherAll.apply(scene.places, (), *scene.joined())[0]
    controls = curves.controls(numbers)
    if curves.transforms is not None:
        matrices = numbers.index_select(0, curves.transforms).view(-1, 1, 3, 3)
        controls = (matrices[..., :2, :2] @ controls[..., None]).squeeze(-1)
        moved = matrices[..., :2, 2].expand_as(controls)
        is_direction = curves.is_ellipse[:, None] & torch.tensor([False, True, True, True]).to(moved.device)
        controls = controls + moved.masked_fill(is_direction[..., None], 0)
    nearest, t, sign = _nearest(curves, controls.detach(), positions.detach(), threads)
    r, turn = 1 - t, 2 * math.pi * t
    bezier = torch.stack([r**3, 3 * r * r * t, 3 * r * t * t, t**3], dim=1)
    ellipse = torch.stack([torch.ones_like(t), turn.cos(), turn.sin(), torch.zeros_like(t)], dim=1)
    weights = torch.where(curves.is_ellipse[nearest, None], ellipse, bezier)
    points = (weights[..., None] * controls.index_select(0, nearest)).sum(dim=1)
    return sign * torch.linalg.vector_norm(points - positions, dim=1)


def _nearest(curves: Curves, controls: Tensor, positions: Tensor, threads: int) -> tuple[Tensor, ...]:
    """Return what ``nearest_points`` writes."""
    start_warp()
    count, device = len(positions), positions.device
    found = torch.empty(count, dtype=torch.int32, device=device)
    numbers = torch.empty(2, count, dtype=torch.float32, device=device)
    arrays = {
        name: wp.from_torch(getattr(curves, name)) for name in ("kind", "is_drawn", "group_first", "rule")
    }
    vectors = {"positions": positions.contiguous(), "controls": controls.contiguous()}
    arrays |= {name: wp.from_torch(value, dtype=wp.vec2) for name, value in vectors.items()}
    arrays |= {"nearest": wp.from_torch(found)}
    arrays |= {name: wp.from_torch(numbers[i]) for i, name in enumerate(("parameter", "sign"))}
    backend = Backend.on(wp.device_from_torch(device), threads)
    with device_lock(backend.device), shared_stream(device):
        program = backend.program()
        program.launch(kernels.nearest_points, count, arrays, split=True)
        program.run()
    return found.long(), numbers[0], numbers[1]


@functools.lru_cache(maxsize=KEPT)
def curves_of(structure: Structure, device: torch.device) -> Curves:
    """Return the curves of the scenes of a structure."""
    parts, entries = [NOTHING], list[Sequence[int]]()
    kinds, drawn, counts = list[int](), list[int](), list[int]()
    for group in structure.groups:
        before = len(kinds)
        for shape in group.shapes:
            terms, kind, is_drawn = _curves(shape)
            parts.append(terms)
            kinds += kind
            drawn += is_drawn
        counts.append(len(kinds) - before)
        own = IDENTITY if group.transform is None else range(group.transform, group.transform + 9)
        entries += counts[-1] * [own]
    rules = [
        (constants.EVENODD if group.even_odd else constants.NONZERO) if group.fill else kernels.NOT_FILLED
        for group in structure.groups
    ]
    arrays = [np.array(each, np.int32) for each in (kinds, drawn, np.cumsum([0, *counts]), rules)]
    return Curves(
        Gather(combined(parts, np.concatenate), device),
        on(arrays[0], device),
        on(arrays[1], device),
        on(arrays[2], device),
        on(arrays[3], device),
        on(arrays[0] == kernels.ELLIPSE, device),
        indices(entries, device) if any(group.transform is not None for group in structure.groups) else None,
    )


NOTHING = Terms(np.zeros((0, 4, 2, 4), np.int64), np.zeros((0, 4, 2, 4)))


def _curves(shape: ShapeStructure) -> tuple[Terms, list[int], list[int]]:
    """Return the controls of a shape's curves as sums of the scene's numbers, their kinds, and which are
    drawn.
    """
    if shape.kind in ("circle", "ellipse"):
        radius = shape.first + 2 + np.array([0, 0 if shape.kind == "circle" else 1])
        index = np.full((1, 4, 2, 4), ZERO, np.int64)
        index[0, 0, :, 0] = shape.first, shape.first + 1
        index[0, 1, 0, 0], index[0, 2, 1, 0] = radius
        weight = np.zeros((1, 4, 2, 4))
        weight[..., 0] = 1
        return Terms(index, weight), [kernels.ELLIPSE], [1]
    counts = shape.counts + (0,) * (not shape.closed)
    kinds = [kernels.CUBIC if count else kernels.LINE for count in counts]
    return (
        coordinates(shape, segments(counts, shape.points)),
        kinds,
        [1] * len(shape.counts) + [0] * (not shape.closed),
    )
