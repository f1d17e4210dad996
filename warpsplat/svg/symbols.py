"""Equal outlines of fills: found, and written once."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np

from warpsplat.scene import Basis, Floats, IndexArray, Kind, Paint, Scene
from warpsplat.scene.simple import area
from warpsplat.svg.data import path_data, units
from warpsplat.svg.paints import unused
from warpsplat.svg.parts import rows_of, with_parts
from warpsplat.svg.sizes import USE


def parts_of(scene: Scene) -> list[IndexArray]:
    """Return the contours of each part of the flat fills of cubics: an outer one, and the holes in it.

    Holes run anticlockwise. Fills that are stroked as well are left out.
    """
    is_plain = (scene.kind == Kind.FILL) & (scene.paint == Paint.FLAT) & (scene.basis == Basis.CUBIC)
    is_plain &= scene.are_alone()
    bounds = scene.first_contours()
    found = []
    for shape in np.flatnonzero(is_plain).tolist():
        contours = np.arange(*bounds[shape : shape + 2])
        rings = [scene.points[scene.starts[c] : scene.starts[c + 1]] for c in contours.tolist()]
        areas = np.array([area(ring.astype(np.float64)) for ring in rings])
        low, high = np.array([r.min(axis=0) for r in rings]), np.array([r.max(axis=0) for r in rings])
        outer = np.flatnonzero(areas > 0)
        parts = {int(i): [int(i)] for i in outer}
        for hole in np.flatnonzero(areas <= 0).tolist():
            around = ((low[outer] <= low[hole]) & (high[hole] <= high[outer])).all(axis=1)
            if around.any():
                parts[int(outer[around][areas[outer[around]].argmin()])].append(hole)
            else:
                parts[hole] = [hole]
        found += [contours[part] for part in parts.values()]
    return found


def with_symbols(scene: Scene, per_pixel: float) -> tuple[Scene, str, dict[int, str]]:
    """Return a scene in which repeated outlines are shapes of their own, and how these are written.

    Returns:
        The scene, the definitions of outlines, and the element, without style, of each shape that has one.
    """
    grid = np.round(scene.points.astype(np.float64) * units(scene, per_pixel)).astype(np.int64)
    alike: dict[tuple[bytes, bytes], list[IndexArray]] = {}
    for part in parts_of(scene):
        points = grid[rows_of(scene, part)]
        counts = np.diff(scene.starts)[part]
        alike.setdefault(((points - points[0]).tobytes(), counts.tobytes()), []).append(part)
    owner = scene.contour_shapes()
    split = [[np.arange(a, b)] for a, b in pairwise(scene.first_contours().tolist())]
    prefix = unused("s", "".join(picture.markup for picture in scene.pictures))
    definitions: list[str] = []
    names: dict[int, tuple[str, int, int]] = {}
    definition_bytes = 21  # bytes around the path data of a definition
    for parts in alike.values():
        if len(parts) < 2:
            continue
        first = rows_of(scene, parts[0])
        data = _data_of(scene, parts[0], grid[first[0]] / units(scene, per_pixel)[first[0]], per_pixel)
        if len(parts) * (len(data) - USE) <= len(data) + definition_bytes:
            continue
        name = f"{prefix}{len(definitions)}"
        definitions.append(f'<path id="{name}" d="{data}"/>')
        for part in parts:
            own = split[owner[part[0]]]
            own[0] = own[0][~np.isin(own[0], part)]
            own.append(part)
            x, y = grid[scene.starts[part[0]]].tolist()
            names[int(part[0])] = name, x, y
    if not definitions:
        return scene, "", {}
    split = [[part for part in own if len(part)] for own in split]
    order = [part for own in split for part in own]
    elements = {}
    for shape, part in enumerate(order):
        if int(part[0]) in names:
            name, x, y = names[int(part[0])]
            elements[shape] = f'use href="#{name}" x="{x}" y="{y}"'
    return with_parts(scene, split), "".join(definitions), elements


def _data_of(scene: Scene, part: IndexArray, origin: Floats, per_pixel: float) -> str:
    """Return the path data of a part with its first point at 0."""
    shape = int(scene.contour_shapes()[part[0]])
    own = part - np.searchsorted(scene.starts, scene.first[shape])
    alone = with_parts(scene.take(np.array([shape])), [[own]])
    moved = replace(alone, points=(alone.points - origin).astype(np.float32))
    return next(path_data(moved, per_pixel))
