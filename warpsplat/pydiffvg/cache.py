"""The last serialized scene, used again while shapes and groups are the same with the same tensors."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from itertools import chain
from typing import NamedTuple

import torch

from warpsplat.pydiffvg.arguments import SceneArguments, serialize
from warpsplat.pydiffvg.color import LinearGradient, RadialGradient
from warpsplat.pydiffvg.shape import Path, Shape, ShapeGroup


class Cached(NamedTuple):
    """A serialized scene with what it was made of."""

    objects: list[object]
    """Shapes, groups and gradients and their fields; compared by identity."""
    numbers: list[object]
    """Sizes of tensors, and numbers that belong to the structure; compared by value, as code can write into
    tensors without leaving a trace."""
    scene: SceneArguments


def _objects(shapes: Sequence[Shape], groups: Sequence[ShapeGroup]) -> list[object]:
    owners: list[object] = [*shapes, *groups]
    fields = list(chain.from_iterable(vars(each).values() for each in owners))
    gradients = [each for each in fields if isinstance(each, (LinearGradient, RadialGradient))]
    return owners + fields + list(chain.from_iterable(vars(each).values() for each in gradients))


def _numbers(objects: list[object]) -> list[object]:
    found: list[object] = [each.shape for each in objects if isinstance(each, torch.Tensor)]
    for each in objects:
        if isinstance(each, Path):
            found.append(each.num_control_points.tolist())
        elif isinstance(each, ShapeGroup):
            matrix = each.shape_to_canvas
            found += each.shape_ids.tolist(), matrix.tolist(), matrix.requires_grad
    return found


_last: Cached | None = None


def serialize_cached(
    width: int, height: int, shapes: Sequence[Shape], groups: Sequence[ShapeGroup], device: torch.device
) -> SceneArguments:
    """Return ``serialize`` of the arguments, or the last result where only values in tensors have changed."""
    global _last  # noqa: PLW0603 - one scene is kept, with its tensors, until the next
    last = _last  # another thread may replace it meanwhile
    objects = _objects(shapes, groups)
    numbers = [int(width), int(height), device, len(shapes), *_numbers(objects)]
    if (
        last is not None
        and len(objects) == len(last.objects)
        and all(map(operator.is_, objects, last.objects))
        and numbers == last.numbers
    ):
        return last.scene
    scene = serialize(width, height, shapes, groups, device)
    own = set(map(id, objects))
    # Copies and results of operations are made again for each scene.
    is_reusable = all(id(tensor) in own and tensor.grad_fn is None for tensor in scene.tensors)
    _last = Cached(objects, numbers, scene) if is_reusable else None
    return scene
