"""The shapes of a file as a report lists them, with their contributions."""

from __future__ import annotations

import itertools
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from warpsplat.errors import CapacityError
from warpsplat.fit.losses import LossTarget
from warpsplat.rendering.backend import Backend, Viewport
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import Renderer
from warpsplat.scene import OPACITY_RANGE, FloatArray, Kind, Paint, Scene
from warpsplat.svg.document import Document, Element
from warpsplat.svg.numbers import hex_colors
from warpsplat.svg.read import KeptScene

ROUNDING = 1 / (12 * 255**2)
"""Mean squared error of rounding to 8 bits: an exact file has a finite PSNR by it."""

LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


def listing(base: KeptScene, contributions: list[float | None] | None) -> dict[str, Any]:
    """Return the shapes of a file for the page's script, as lists with an entry for each, back to front.

    Args:
        base: the file.
        contributions: see ``contributions``; None: unknown.

    Returns:
        ``elements`` (the number of the element in the document, the root being 0; None: no single one),
        ``kinds``, ``colors`` (for style sheets: one, the first and last of a gradient, or none),
        ``opacities``, ``contributions`` and ``layers``; also ``names`` of the layers, back to front, and
        ``background``, the number of its element or None.
    """
    scene = base.scene
    layers, names = _layers(base)
    return {
        "elements": list(base.elements),
        "kinds": [_kind(scene, i) for i in range(len(scene))],
        "colors": _colors(scene),
        "opacities": [round(float(value), 2) for value in scene.opacities],
        "layers": layers,
        "contributions": contributions or [None] * len(scene),
        "names": names,
        "background": base.background_element,
    }


def contributions(scene: Scene, target: FloatArray, backend: Backend) -> list[float | None] | None:
    """Return by how much the PSNR falls without each shape, the others staying as they are.

    Args:
        scene: shapes on a canvas of the target's size.
        target: sRGB in [0, 1], shape (height, width, 3), or premultiplied, shape (height, width, 4).
        backend: where to compute.

    Returns:
        decibels, None for pictures that are kept; None if there is not enough memory.
    """
    height, width = target.shape[:2]
    viewport = Viewport(width, height, 1.0)
    # What lies behind a shape is computed from the light that it transmits, which must not be zero.
    scene = replace(
        scene,
        opacities=np.minimum(scene.opacities, OPACITY_RANGE[1]),
        stop_opacities=np.minimum(scene.stop_opacities, OPACITY_RANGE[1]),
    )
    try:
        renderer = Renderer(Parameters(scene, backend), viewport)
        renderer.forward_complete()
        costs = renderer.removal_costs(LossTarget(target, backend, viewport).target)
        error = _squared_error(renderer.read_image() - target) + ROUNDING
    except CapacityError:
        return None
    found = 10 * np.log10(np.maximum((error + costs.astype(np.float64)) / error, 1e-6))
    return [
        None if paint == Paint.PICTURE else round(float(value), 4)
        for paint, value in zip(scene.paint, found, strict=True)
    ]


def _squared_error(difference: FloatArray) -> float:
    """Return the mean over pixels and colours; with opacity, the mean of the errors on black and on white."""
    color = difference[..., :3].astype(np.float64)
    if difference.shape[2] == 3:
        return float(np.mean(color**2))
    return float(np.mean(color**2) + np.mean((color - difference[..., 3:]) ** 2)) / 2


def matched(base: KeptScene, target: FloatArray) -> tuple[KeptScene, FloatArray]:
    """Return a file and an image on one canvas: the background of the file lies behind the image as well."""
    canvas = base.scene.canvas
    if target.shape[2] == 4 and base.has_background:
        assert canvas.background is not None
        target = np.asarray(target[..., :3] + (1 - target[..., 3:]) * canvas.background, np.float32)
    elif target.shape[2] == 4:
        scene = replace(base.scene, canvas=replace(canvas, background=None))
        base = replace(base, scene=scene)
    return base, target


def _kind(scene: Scene, shape: int) -> str:
    if scene.paint[shape] == Paint.PICTURE:
        return "kept"
    return "fill" if scene.kind[shape] == Kind.FILL else "stroke"


def _colors(scene: Scene) -> list[list[str]]:
    flat, stops = hex_colors(scene.colors), hex_colors(scene.stop_colors)
    ends = itertools.pairwise(scene.stop_first.tolist())
    return [
        [] if paint == Paint.PICTURE else [stops[first], stops[last - 1]] if last > first else [color]
        for paint, color, (first, last) in zip(scene.paint, flat, ends, strict=True)
    ]


def _layers(base: KeptScene) -> tuple[list[int], list[str]]:
    """Return the layer of each shape, and the names: those of groups, or parts in painter's order."""
    count = len(base.scene)
    named = _named_groups(base.document, base.elements)
    names = list(dict.fromkeys(named))
    if 1 < len(names) <= 24:
        return [names.index(name) for name in named], names
    parts = min(4, count)
    layers: npt.NDArray[np.intp] = np.arange(count) * parts // max(count, 1)
    ends = np.searchsorted(layers, np.arange(parts), "right")
    words = {0: " (back)", parts - 1: " (front)"} if parts > 1 else {}
    starts = [0, *ends[:-1].tolist()]
    names = [
        f"{first + 1}\N{EN DASH}{last}{words.get(part, '')}"
        for part, (first, last) in enumerate(zip(starts, ends.tolist(), strict=True))
    ]
    return layers.tolist(), names


def _named_groups(document: Document, numbers: tuple[int | None, ...]) -> list[str]:
    """Return the name of the outermost named group around each shape."""
    elements = list(document.root.iter())

    def name_of_layer(element: Element) -> str:
        found = ""
        while element in document.parents:
            element = document.parents[element]
            found = (
                element.get(LABEL) or element.get("id") or found if element is not document.root else found
            )
        return found or "unnamed"

    return ["kept" if number is None else name_of_layer(elements[number]) for number in numbers]
