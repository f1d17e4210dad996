"""Scenes in the form that a renderer can draw; gradients flow to the points that they have."""

from __future__ import annotations

import functools
from dataclasses import dataclass, field, replace

import numpy as np
import torch

from warpsplat.errors import UsageError
from warpsplat.fit.renderers import renderer_of
from warpsplat.rendering.models import Model
from warpsplat.run.render import cannot_draw
from warpsplat.scene import Scene
from warpsplat.torch.engine import layout_key
from warpsplat.torch.tensors import TABLE, SceneTensors

STRUCTURE = ("basis", "first", "starts", "closed", "twin")
"""Fields that another form changes, besides the points."""


@dataclass(frozen=True)
class _Form:
    """A layout, equal to others of its structure, and a renderer's name."""

    key: tuple[object, ...]
    renderer: str
    layout: Scene = field(compare=False)


def drawable(scene: SceneTensors, renderer: str | Model) -> SceneTensors:
    """Return a scene with its outlines as the renderer draws them; itself if it can draw it as it is.

    Raises:
        UsageError: the renderer cannot draw it.
    """
    made = conversion_of(scene.layout, renderer)
    if made is None:
        return scene
    changed, indices, weights = made
    points = scene.value(TABLE["points"])
    moved = (points[indices.to(points.device)] * weights.to(points.device)[..., None]).sum(dim=1)
    layout = replace(scene.layout, **{name: getattr(changed, name) for name in (*STRUCTURE, "points")})
    return SceneTensors(layout, {**scene.values, "points": moved})


Conversion = tuple[Scene, torch.Tensor, torch.Tensor]
"""The new layout, and of which points, by what weights, each of its points is a sum; shape (point, term)."""


def conversion_of(layout: Scene, renderer: str | Model) -> Conversion | None:
    """Return how to convert a layout, if it must be. ``torch.compile`` takes the result as a constant."""
    if not isinstance(renderer, str) or renderer_of(renderer).exact:
        return None
    return _conversion(_Form(layout_key(layout), renderer, layout))


# As torch.compiler.assume_constant_result does, which imports the compiler, for seconds.
conversion_of._dynamo_marked_constant = True  # type: ignore[attr-defined]


@functools.lru_cache(maxsize=32)
def _conversion(form: _Form) -> Conversion | None:
    """Return what ``conversion_of`` does."""
    own = renderer_of(form.renderer)
    try:
        by_shape = own.weights(form.layout)
        changed = own.drawable(form.layout)
    except ValueError as error:
        raise UsageError(cannot_draw(error, form.renderer)) from None
    if not by_shape:
        return None
    terms = max(int((rows != 0).sum(axis=1).max()) for rows in by_shape)
    indices, weights = [], []
    for first, rows in zip(form.layout.first[:-1].tolist(), by_shape, strict=True):
        order = np.argsort(rows == 0, axis=1, kind="stable")[:, :terms]
        found = np.take_along_axis(rows, order, axis=1)
        lacking = ((0, 0), (0, terms - order.shape[1]))
        indices.append(np.pad(order + first, lacking, mode="edge"))
        weights.append(np.pad(found, lacking))
    return changed, torch.from_numpy(np.concatenate(indices)), torch.from_numpy(np.concatenate(weights))
