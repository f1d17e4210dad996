"""Tensors of shapes and groups -> tensors of a scene of ours, by operations that torch differentiates."""

from __future__ import annotations

import functools
import math
import threading
from collections import OrderedDict

import torch

from warpsplat.pydiffvg.arguments import SceneArguments
from warpsplat.pydiffvg.color import Color, LinearGradient, RadialGradient
from warpsplat.pydiffvg.layout import Layout, Row, make_layout
from warpsplat.pydiffvg.tapered import ring_points
from warpsplat.torch import SceneTensors

Tensor = torch.Tensor

KEPT = 16
"""Layouts that are kept for further scenes of their structure."""

KAPPA = 4 / 3 * math.tan(math.pi / 8)
QUARTER = ((1.0, 0.0), (1.0, KAPPA), (KAPPA, 1.0))
"""Control points of a quarter of the unit circle, as cubics; off by 3e-4 at most."""

STEEP = 1e-3
"""Square of the length of a gradient's axis [canvas units] below which it counts as that long."""


FAINT = 1 / 256
"""Opacity of outlines whose coverages are added. Added, not composited: of two shapes that meet in a pixel
nothing is left over, which compositing would have for a quarter of it."""

SEEN = 0.5 / 255
"""Opacity from which on something is seen."""


class Layouts:
    """A bounded number of layouts, those used last."""

    def __init__(self) -> None:
        self._kept: OrderedDict[tuple[object, ...], Layout] = OrderedDict()
        self._lock = threading.Lock()

    def __len__(self) -> int:
        return len(self._kept)

    def get(self, scene: SceneArguments, size: tuple[int, int], device: torch.device) -> Layout:
        """The layout of ``scene`` in a picture of ``size``."""
        uniform = scene.width * size[1] == scene.height * size[0]
        key = scene.forms, scene.plans, size, uniform, device
        with self._lock:
            layout = self._kept.pop(key, None) or make_layout(*key)
            self._kept[key] = layout
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return layout


LAYOUTS = Layouts()


def assemble(
    scene: SceneArguments, layout: Layout, size: tuple[int, int], device: torch.device
) -> SceneTensors:
    """The scene in pixels of a picture of ``size``, whose layout is ``layout``."""
    scale = size[0] / scene.width, size[1] / scene.height
    values = {"points": _points(scene, layout, scale, device)}
    values |= _flat(scene, layout, device)
    if any(not row.is_ring and row.is_stroke for row in layout.rows):
        values["widths"] = _widths(scene, layout, math.sqrt(scale[0] * scale[1]), device)
    if len(layout.scene.stop_offsets):
        values |= _gradients(scene, layout, scale, device)
    return SceneTensors(layout.scene, values)


def _points(
    scene: SceneArguments, layout: Layout, scale: tuple[float, float], device: torch.device
) -> Tensor:
    base = _base(scene, device)
    first = base.index_select(0, layout.index[0])
    points = first
    if layout.weight is not None:
        points = layout.weight[0] * first + layout.weight[1] * base.index_select(0, layout.index[1])
    if layout.rings:
        widths = torch.cat(
            [o.width.expand(f.points) for o, f in zip(scene.outlines, scene.forms, strict=True)]
        )
        parts = [points]
        for index, weight, is_closed in layout.rings:
            segments = (weight[..., None] * base[index]).sum(dim=-2)
            radii = (weight * widths[index]).sum(dim=-1)
            rings = torch.cat(ring_points(segments, radii, is_closed), dim=0)
            parts.append(rings.transpose(0, 1).reshape(-1, 2))
        assert layout.order is not None
        points = torch.cat(parts).index_select(0, layout.order)
    points = _mapped(scene, layout, points, device)
    return points if scale == (1.0, 1.0) else points * torch.tensor(scale, device=device)


def _base(scene: SceneArguments, device: torch.device) -> Tensor:
    """Points of all shapes in their own units, shape (point, 2)."""
    parts = []
    for form, outline in zip(scene.forms, scene.outlines, strict=True):
        if form.kind == "path":
            parts.append(outline.values[0])
        elif form.kind == "round":
            center, radius = outline.values
            parts.append(center + radius * _circle(device))
        else:
            low, high = outline.values
            parts.append(low + (high - low) * _square(device))
    return torch.cat(parts) if parts else torch.zeros(0, 2, device=device)


@functools.lru_cache(maxsize=8)
def _circle(device: torch.device) -> Tensor:
    """Control points of the unit circle, clockwise as it is seen; shape (12, 2)."""
    points = [QUARTER]
    for _ in range(3):
        points.append(tuple((-y, x) for x, y in points[-1]))  # type: ignore[arg-type]  # three of them
    return torch.tensor(points, device=device).reshape(12, 2)


@functools.lru_cache(maxsize=8)
def _square(device: torch.device) -> Tensor:
    """Corners of the unit square, clockwise as it is seen; shape (4, 2)."""
    return torch.tensor([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]], device=device)


def _mapped(scene: SceneArguments, layout: Layout, points: Tensor, device: torch.device) -> Tensor:
    """Points on the canvas."""
    if all(paints.matrix is None for paints in scene.paints):
        return points
    eye = torch.eye(3, device=device)
    maps = torch.stack([eye if paints.matrix is None else paints.matrix for paints in scene.paints])
    own = maps.index_select(0, layout.point_group)
    return torch.einsum("pij,pj->pi", own[:, :2, :2], points) + own[:, :2, 2]


def _paint(scene: SceneArguments, row: Row) -> Color:
    paints = scene.paints[row.group]
    return paints.stroke if row.is_stroke else paints.fill


def _flat(scene: SceneArguments, layout: Layout, device: torch.device) -> dict[str, Tensor]:
    """Colours and opacities; those of gradients are black and 1."""
    opaque = torch.tensor([0.0, 0.0, 0.0, 1.0], device=device)
    found = [_paint(scene, row) for row in layout.rows]
    paints = torch.stack([color if isinstance(color, Tensor) else opaque for color in found])
    return {"colors": paints[:, :3], "opacities": within_one(paints[:, 3])}


def within_one(values: Tensor) -> Tensor:
    """In [0, 1], with the gradient of the values themselves: what has left the range comes back."""
    return values + (values.clamp(0, 1) - values).detach()


def _widths(scene: SceneArguments, layout: Layout, scale: float, device: torch.device) -> Tensor:
    """Widths of strokes, twice DiffVG's [px]; shape (row,)."""
    zero = torch.zeros((), device=device)
    widths = []
    for row in layout.rows:
        if row.is_ring or not row.is_stroke:
            widths.append(zero)
            continue
        width = scene.outlines[row.shapes[0]].width
        matrix = scene.paints[row.group].matrix
        if matrix is not None:
            width = width * (matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]).abs().sqrt()
        widths.append(width)
    return (2 * scale * torch.stack(widths)).clamp_min(0)


def _gradients(
    scene: SceneArguments, layout: Layout, scale: tuple[float, float], device: torch.device
) -> dict[str, Tensor]:
    nothing = torch.zeros(6, device=device)
    stretch = torch.tensor(scale, device=device)
    frames, offsets, stops = [], [], []
    for row in layout.rows:
        color = _paint(scene, row)
        if isinstance(color, LinearGradient):
            axis = (color.end - color.begin) * stretch
            # As DiffVG does: an axis that is too short counts as a little longer.
            axis = axis * (STEEP / axis.square().sum().clamp_min(1e-12)).clamp_min(1.0).detach()
            frames.append(torch.cat([color.begin * stretch, axis, torch.stack([-axis[1], axis[0]])]))
        elif isinstance(color, RadialGradient):
            radius = color.radius * stretch
            zero = torch.zeros_like(radius[:1])
            frames.append(torch.cat([color.center * stretch, radius[:1], zero, zero, radius[1:]]))
        else:
            frames.append(nothing)
            continue
        offsets.append(color.offsets)
        stops.append(color.stop_colors)
    colors = torch.cat(stops)
    return {
        "frames": torch.stack(frames),
        "stop_offsets": torch.cat(offsets),
        "stop_colors": colors[:, :3],
        "stop_opacities": within_one(colors[:, 3]),
    }


def outlines_only(tensors: SceneTensors, layout: Layout) -> SceneTensors:
    """The same outlines, all black and of opacity ``FAINT``: so faint that their coverages add up. Those that
    cannot be seen are left out, as no colour shows there.
    """
    rows, device = len(layout.rows), tensors.device
    values = {name: tensors.values[name] for name in ("points", "widths") if name in tensors.values}
    values["opacities"] = FAINT * (tensors.values["opacities"].detach() > SEEN).float()
    values["colors"] = torch.zeros(rows, 3, device=device)
    return SceneTensors(layout.outlines, values)
