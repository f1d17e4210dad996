"""Parameters as named arrays, for files, and back, with checks."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from warpsplat.rendering.backend import Backend
from warpsplat.rendering.parameters import Moments, Parameters
from warpsplat.scene import ATTRIBUTES, Scene
from warpsplat.scene.arrays import FARTHEST, Array, between, from_arrays, to_arrays, typed

MOMENTS = ("moment1", "moment2")

LARGEST = float(np.finfo(np.float32).max)


def parameter_arrays(parameters: Parameters) -> dict[str, Array]:
    """Return the shapes with their moments and ages, and which rows are held."""
    arrays = to_arrays(parameters.scene())
    for prefix, moments in zip(MOMENTS, parameters.moments(), strict=True):
        arrays |= {f"{prefix}.{name}": values for name, values in moments.items()}
    arrays |= {f"held.{name}": group.held.numpy() for name, group in parameters.groups.items()}
    arrays["ages"] = parameters.arrays["ages"].numpy()
    if parameters.has_circles:
        # Computed at surgery only, so these may differ from what the current values would give.
        arrays["circular"] = parameters.arrays["circular"].numpy()
    return arrays


def parameters_from(arrays: Mapping[str, Array], like: Scene, backend: Backend) -> Parameters:
    """Restore parameters from ``parameter_arrays``; ``like``: see ``from_arrays``.

    Raises:
        ValueError: as ``from_arrays``.
    """
    scene = from_arrays(arrays, like)
    ages = _rows(arrays, "ages", len(scene), int(FARTHEST))
    none = np.zeros(len(scene), np.int32)
    circular = _rows(arrays, "circular", len(scene), 1) if "circular" in arrays else none
    made = Parameters(scene, backend, _moments(arrays, scene), ages)
    for attribute in ATTRIBUTES:
        held = _rows(arrays, f"held.{attribute.name}", scene.shape_of(attribute)[0], 1)
        made.hold(attribute.name, held.astype(np.bool_))
    made.tie_circles(circular)
    return made


def _rows(arrays: Mapping[str, Array], name: str, count: int, most: int) -> Array:
    """Return an array of ``count`` integers from 0 to ``most``, checked."""
    found = typed(arrays, name, np.int32)
    if found.shape != (count,):
        raise ValueError(f"{name} has shape {found.shape}, not ({count},)")
    between(name, found, 0, most)
    return found


def _moments(arrays: Mapping[str, Array], scene: Scene) -> Moments:
    """Return Adam's moments of the shapes of ``scene``."""
    found: Moments = ({}, {})
    for prefix, moments, least in zip(MOMENTS, found, (-LARGEST, 0.0), strict=True):
        for attribute in ATTRIBUTES:
            name = f"{prefix}.{attribute.name}"
            values = typed(arrays, name, np.float32)
            if values.shape != scene.shape_of(attribute):
                raise ValueError(f"{name} has shape {values.shape}, not {scene.shape_of(attribute)}")
            between(name, values, least, LARGEST)
            moments[attribute.name] = values
    return found
