"""A scene's shapes as named arrays for files, and back, with checks."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.scene.attributes import ATTRIBUTES, CHOICES, NO_DASHES, NO_PICTURE, TRAITS, Paint, Unit
from warpsplat.scene.scene import Scene

Array = npt.NDArray[Any]

LAYOUT = ("kind", "basis", "first", "starts", "closed", "stop_first")
"""Arrays that give the rows of the others their meaning."""

FARTHEST = 1e9
"""Largest coordinate or length [canvas units]."""


def to_arrays(scene: Scene) -> dict[str, Array]:
    """Return the shapes of ``scene``, without canvas, pictures, names of layers and dash patterns."""
    names = (*LAYOUT, *(row.name for row in (*TRAITS, *ATTRIBUTES)))
    return {name: getattr(scene, name) for name in names}


def from_arrays(arrays: Mapping[str, Array], like: Scene) -> Scene:
    """Return the scene of ``to_arrays``, with what it leaves out taken from ``like``.

    Raises:
        ValueError: An array is missing, of another type or size, or has numbers that no scene has.
    """
    whole = {name: np.int32 for name in LAYOUT} | {trait.name: trait.dtype for trait in TRAITS}
    values: dict[str, Any] = {name: typed(arrays, name, dtype) for name, dtype in whole.items()}
    if any(array.ndim != 1 for array in values.values()):
        raise ValueError("an array has more dimensions than one")
    for attribute in ATTRIBUTES:
        found = values[attribute.name] = typed(arrays, attribute.name, np.float32)
        if attribute.low[1] == attribute.high[1] == Unit.ONE:  # shapes read from a file may be opaque, or 0
            between(attribute.name, found, min(attribute.low[0], 0.0), max(attribute.high[0], 1.0))
        else:
            between(attribute.name, found, 0.0 if attribute.name == "widths" else -FARTHEST, FARTHEST)
    for name in ("first", "starts", "stop_first"):
        starts = values[name]
        if len(starts) < 2 or starts[0] != 0 or (np.diff(starts) < 0).any():
            raise ValueError(f"{name} does not ascend from 0")
    if (np.diff(values["first"]) < 1).any() or values["starts"][-1] != len(values["points"]):
        raise ValueError("first and starts are not those of the points")
    if len(values["stop_first"]) != len(values["first"]):
        raise ValueError("stop_first is not that of the shapes")
    limits: dict[str, tuple[float, float]] = {
        **{choice.__name__.lower(): (min(choice), max(choice)) for choice in CHOICES},
        **{"closed": (0, 1), "twin": (0, 1)},
        "layer": (0, 1_000_000),
        "miter_limits": (0.0, math.inf),
        "dash": (NO_DASHES, len(like.dashes) - 1),
        "picture": (NO_PICTURE, len(like.pictures) - 1),
    }
    for name, (low, high) in limits.items():
        between(name, values[name], low, high)
    if ((values["paint"] == Paint.PICTURE) != (values["picture"] != NO_PICTURE)).any():
        raise ValueError("picture is not that of the paints")
    return replace(like, **values)


def typed(arrays: Mapping[str, Array], name: str, dtype: Any) -> Array:
    """Return the array ``name``; raise ``ValueError`` if it is missing or its elements are not ``dtype``."""
    array = arrays.get(name)
    if array is None or array.dtype != dtype:
        raise ValueError(f"{name} is missing" if array is None else f"{name} has elements of another type")
    return array


def between(name: str, values: Array, low: float, high: float) -> None:
    """Raise ``ValueError`` unless all ``values`` lie between two numbers."""
    if not ((values >= low) & (values <= high)).all():
        raise ValueError(f"{name} has numbers that are not from {low:g} to {high:g}")
