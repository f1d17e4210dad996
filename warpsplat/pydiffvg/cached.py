"""The last scene of ``arguments``, used again while shapes and groups are the same with the same tensors."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple

import torch

from warpsplat.pydiffvg.arguments import SceneArguments, serialize
from warpsplat.pydiffvg.color import LinearGradient, RadialGradient
from warpsplat.pydiffvg.shape import Path, Shape, ShapeGroup

Tensor = torch.Tensor


def _fields(owners: Sequence[object]) -> list[object]:
    """Return the fields of all owners, which are compared by identity."""
    return list(chain.from_iterable(map(dict.values, map(vars, owners))))


def _same(some: Sequence[object], others: Sequence[object]) -> bool:
    """Return whether objects are the same ones."""
    return len(some) == len(others) and all(map(operator.is_, some, others))


def _numbers(structural: Sequence[Sequence[Any]]) -> list[Tensor | list[object]]:
    """Return the numbers of each field that belongs to the structure.

    They are compared by value, as code can write into tensors without leaving a trace.
    """
    with torch.no_grad():
        return [_joined(values) for values in structural]


def _joined(values: Sequence[Any]) -> Tensor | list[object]:
    """Return all numbers of tensors or lists: one operation for many tensors of a kind."""
    try:
        return torch.cat(tuple(values))
    except (RuntimeError, TypeError, ValueError):  # they are of several kinds, no tensors, or none at all
        return [each.tolist() if hasattr(each, "tolist") else list(each) for each in values]


def _equal(a: Tensor | list[object], b: Tensor | list[object]) -> bool:
    return torch.equal(a, b) if isinstance(a, Tensor) and isinstance(b, Tensor) else bool(a == b)


class _Cached(NamedTuple):
    """A scene and what it was made of."""

    frame: tuple[object, ...]
    """Size, device and number of shapes."""
    owners: list[object]
    """Shapes and groups."""
    fields: list[object]
    gradients: list[object]
    gradient_fields: list[object]
    tensors: list[Tensor]
    """Those of the fields."""
    sizes: list[int]
    """How many numbers each has."""
    trainable: list[Tensor]
    """Transforms and widths, without which scenes are simpler where they do not require gradients."""
    trained: list[bool]
    """Which of them do."""
    structural: list[list[Any]]
    """Fields that belong to the structure."""
    numbers: list[Tensor | list[object]]
    """Theirs."""
    scene: SceneArguments

    def is_of(self, frame: tuple[object, ...], owners: list[object]) -> bool:
        """Return whether this is the scene of shapes and groups, whatever the values in their tensors."""
        return (
            frame == self.frame
            and _same(owners, self.owners)
            and _same(_fields(owners), self.fields)
            and _same(_fields(self.gradients), self.gradient_fields)
            and list(map(Tensor.numel, self.tensors)) == self.sizes
            and list(map(_is_trained, self.trainable)) == self.trained
            and all(map(_equal, _numbers(self.structural), self.numbers))
        )


_is_trained = operator.attrgetter("requires_grad")

_last: _Cached | None = None


def serialize_cached(
    width: int, height: int, shapes: Sequence[Shape], groups: Sequence[ShapeGroup], device: torch.device
) -> SceneArguments:
    """Return ``serialize`` of the arguments, or the last result where only values in tensors have changed."""
    global _last  # noqa: PLW0603 - one scene is kept, with its tensors, until the next
    frame: tuple[object, ...] = (int(width), int(height), device, len(shapes))
    owners: list[object] = [*shapes, *groups]
    last = _last  # another thread may replace it meanwhile
    if last and last.is_of(frame, owners):
        return last.scene
    scene = serialize(width, height, shapes, groups, device)
    fields = _fields(owners)
    gradients: list[object] = [each for each in fields if isinstance(each, (LinearGradient, RadialGradient))]
    gradient_fields = _fields(gradients)
    tensors = [each for each in chain(fields, gradient_fields) if isinstance(each, Tensor)]
    own = set(map(id, tensors))
    structural: list[list[Any]] = [
        [shape.num_control_points for shape in shapes if isinstance(shape, Path)],
        [group.shape_ids for group in groups],
        [group.shape_to_canvas for group in groups],
    ]
    # Copies and results of operations are made again for each scene.
    if all(id(tensor) in own and tensor.grad_fn is None for tensor in scene.tensors):
        trainable = structural[2] + [shape.stroke_width for shape in shapes]
        _last = _Cached(
            frame,
            owners,
            fields,
            gradients,
            gradient_fields,
            tensors,
            list(map(Tensor.numel, tensors)),
            trainable,
            list(map(_is_trained, trainable)),
            structural,
            _numbers(structural),
            scene,
        )
    else:
        _last = None
    return scene
