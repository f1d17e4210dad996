"""The last scene of ``arguments``, used again while shapes and groups are the same with the same tensors."""

from __future__ import annotations

import operator
from collections.abc import Sequence
from itertools import chain
from typing import Any

import torch

from warpsplat.pydiffvg.arguments import SceneArguments, serialize
from warpsplat.pydiffvg.color import LinearGradient, RadialGradient
from warpsplat.pydiffvg.shape import Path, Shape, ShapeGroup

Tensor = torch.Tensor


def _fields(owners: Sequence[object]) -> list[object]:
    """Return the fields of all owners."""
    return list(chain.from_iterable(map(dict.values, map(vars, owners))))


def _joined(values: Sequence[Any]) -> Tensor | list[object]:
    """Return all numbers of tensors or lists: one operation for many tensors of a kind."""
    try:
        return torch.cat(tuple(values))
    except (RuntimeError, TypeError, ValueError):  # they are of several kinds, no tensors, or none at all
        return [each.tolist() if hasattr(each, "tolist") else list(each) for each in values]


def _equal(a: Tensor | list[object], b: Tensor | list[object]) -> bool:
    return torch.equal(a, b) if isinstance(a, Tensor) and isinstance(b, Tensor) else bool(a == b)


class _Cached:
    """A scene and what it was made of."""

    def __init__(
        self, frame: tuple[object, ...], shapes: Sequence[Shape], groups: Sequence[ShapeGroup]
    ) -> None:
        self.frame = frame
        """Size, device and number of shapes."""
        self._owners: list[object] = [*shapes, *groups]
        fields = _fields(self._owners)
        self._gradients: list[object] = [
            each for each in fields if isinstance(each, (LinearGradient, RadialGradient))
        ]
        self._parts = self._parts_of(self._owners)
        self._structural: list[list[Any]] = [
            [shape.num_control_points for shape in shapes if isinstance(shape, Path)],
            [group.shape_ids for group in groups],
            [group.shape_to_canvas for group in groups],
        ]
        """Fields whose numbers are compared, as code can write into tensors without leaving a trace."""
        self._trainable = self._structural[2] + [shape.stroke_width for shape in shapes]
        self.tensors = [each for each in self._parts if isinstance(each, Tensor)]

    def remember(self) -> None:
        """Keep what may not change."""
        self._numbers, self._traits = self._current()

    def _parts_of(self, owners: list[object]) -> list[object]:
        """Return shapes, groups and gradients with their fields, which are compared by identity."""
        return [*owners, *_fields(owners), *_fields(self._gradients)]

    @torch.no_grad()
    def _current(self) -> tuple[list[Tensor | list[object]], list[object]]:
        """Return the numbers that belong to the structure; and sizes of tensors, and which of transforms and
        widths require gradients: scenes are simpler without.
        """
        trained = map(operator.attrgetter("requires_grad"), self._trainable)
        return list(map(_joined, self._structural)), [*map(Tensor.numel, self.tensors), *trained]

    def is_of(self, frame: tuple[object, ...], owners: list[object]) -> bool:
        """Return whether this is the scene of shapes and groups, whatever the values in their tensors."""
        if frame != self.frame or len(owners) != len(self._owners):
            return False
        parts = self._parts_of(owners)
        if len(parts) != len(self._parts) or not all(map(operator.is_, parts, self._parts)):
            return False
        numbers, traits = self._current()
        return traits == self._traits and all(map(_equal, numbers, self._numbers))


_last: tuple[_Cached, SceneArguments] | None = None


def serialize_cached(
    width: int, height: int, shapes: Sequence[Shape], groups: Sequence[ShapeGroup], device: torch.device
) -> SceneArguments:
    """Return ``serialize`` of the arguments, or the last result where only values in tensors have changed."""
    global _last  # noqa: PLW0603 - one scene is kept, with its tensors, until the next
    frame = int(width), int(height), device, len(shapes)
    last = _last  # another thread may replace it meanwhile
    if last and last[0].is_of(frame, [*shapes, *groups]):
        return last[1]
    scene = serialize(width, height, shapes, groups, device)
    made = _Cached(frame, shapes, groups)
    own = set(map(id, made.tensors))
    # Copies and results of operations are made again for each scene.
    _last = None
    if all(id(tensor) in own and tensor.grad_fn is None for tensor in scene.tensors):
        made.remember()
        _last = made, scene
    return scene
