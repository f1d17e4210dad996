"""Gradients of a scene as elements of ``defs`` (SVG 1.1, 13.2), in units of the view box."""

from __future__ import annotations

import math
import re

import numpy as np

from warpsplat.scene import GRADIENTS, Floats, Paint, Scene, Spread
from warpsplat.svg.forms import gradient_frames
from warpsplat.svg.numbers import hex_colors, number

SHARE_DECIMALS = 3
"""Decimals of offsets and of positions in a gradient's unit space: a thousandth of its extent."""

ROUND = 1e-3
"""Largest relative difference of a circle's axes in length, and from a right angle."""

SPREADS = {Spread.PAD: "", Spread.REFLECT: ' spreadMethod="reflect"', Spread.REPEAT: ' spreadMethod="repeat"'}


def gradients(scene: Scene, per_pixel: float) -> tuple[list[str], dict[int, str]]:
    """Return gradient elements, each once, and the identifier of each shape's gradient."""
    painted = np.flatnonzero(np.isin(scene.paint, GRADIENTS)).tolist()
    if not painted:
        return [], {}
    elements: dict[str, str] = {}
    owners, frames = {}, gradient_frames(scene, per_pixel)
    prefix = unused("g", "".join(picture.markup for picture in scene.pictures))
    for shape in painted:
        body = _gradient(scene, shape, frames[shape], per_pixel)
        owners[shape] = elements.setdefault(body, f"{prefix}{len(elements)}")
    texts = [body.replace(" ", f' id="{name}" ', 1) for body, name in elements.items()]
    return texts, owners


def unused(prefix: str, text: str) -> str:
    """Return ``prefix``, its last letter repeated until no name in ``text`` begins with it and a digit."""
    taken = set(re.findall(rf"\b({prefix}{prefix[-1]}*)\d", text))
    while prefix in taken:
        prefix += prefix[-1]
    return prefix


def _gradient(scene: Scene, shape: int, frame: Floats, per_pixel: float) -> str:
    """Return a shape's gradient element, without its identifier."""
    origin, axes = frame[0], frame[1:]
    # Ramps lie on whole units, as outlines do.
    # Decimals of positions where units of the view box are coarser than pixels, or the gradient repeats.
    place_decimals = 2
    decimals = 0 if per_pixel >= 1 and scene.spread[shape] == Spread.PAD else place_decimals
    if scene.paint[shape] == Paint.LINEAR:
        tag, place = "linearGradient", _line(origin, axes, decimals)
    else:
        tag, place = "radialGradient", _circle(origin, axes, scene.focus[shape].astype(np.float64), decimals)
    spread = SPREADS[Spread(int(scene.spread[shape]))]
    return f'<{tag} gradientUnits="userSpaceOnUse"{place}{spread}>{_stops(scene, shape)}</{tag}>'


def _attributes(values: dict[str, float], decimals: int) -> str:
    return "".join(f' {name}="{number(value, decimals)}"' for name, value in values.items())


def _line(origin: Floats, axes: Floats, decimals: int) -> str:
    """Return the ends of a linear gradient, perpendicular to its lines of equal colour."""
    along, across = axes
    normal = np.array([across[1], -across[0]])
    reach = float((along * normal).sum())
    square = float((normal * normal).sum())
    axis = normal * reach / square if square > 0 else along
    (x1, y1), (x2, y2) = origin, origin + axis
    return _attributes({"x1": x1, "y1": y1, "x2": x2, "y2": y2}, decimals)


def _circle(origin: Floats, axes: Floats, focus: Floats, decimals: int) -> str:
    """Return a circle if the frame is one's, else the unit circle under the frame's map."""
    along, across = axes
    length = math.sqrt(float((along * along).sum()))
    upright = np.array([-along[1], along[0]])
    is_circle = min(np.abs(across - upright).max(), np.abs(across + upright).max()) <= ROUND * length
    fx, fy, fr = focus.tolist()
    place = {"cx": 0.0, "cy": 0.0, "r": 1.0, "fx": fx, "fy": fy, "fr": fr}
    if is_circle:
        fx_on, fy_on = origin + fx * along + fy * across
        place = {"cx": origin[0], "cy": origin[1], "r": length, "fx": fx_on, "fy": fy_on, "fr": fr * length}
    left_out = (() if fx or fy else ("fx", "fy")) + (() if fr else ("fr",))
    place = {name: value for name, value in place.items() if name not in left_out}
    if is_circle:
        return _attributes(place, decimals)
    matrix = " ".join(number(float(value), SHARE_DECIMALS) for value in (*along, *across, *origin))
    return f'{_attributes(place, SHARE_DECIMALS)} gradientTransform="matrix({matrix})"'


def _stops(scene: Scene, shape: int) -> str:
    rows = slice(int(scene.stop_first[shape]), int(scene.stop_first[shape + 1]))
    offsets = np.maximum.accumulate(scene.stop_offsets[rows].astype(np.float64))
    texts = []
    for offset, color, opacity in zip(
        offsets, hex_colors(scene.stop_colors[rows]), scene.stop_opacities[rows], strict=True
    ):
        shown = number(float(opacity), SHARE_DECIMALS)
        alpha = "" if shown == "1" else f' stop-opacity="{shown}"'
        texts.append(f'<stop offset="{number(offset, SHARE_DECIMALS)}" stop-color="{color}"{alpha}/>')
    return "".join(texts)
