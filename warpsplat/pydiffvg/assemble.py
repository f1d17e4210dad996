"""Tensors of shapes and groups -> attributes of a scene of ours, by operations that torch differentiates."""

from __future__ import annotations

import math
import threading
from collections import OrderedDict
from collections.abc import Mapping

import torch

from warpsplat.kernels import constants
from warpsplat.pydiffvg.arguments import SceneArguments
from warpsplat.pydiffvg.flat import Flat
from warpsplat.pydiffvg.layout import Gradients, Layout, make_layout
from warpsplat.pydiffvg.tapered import ring_points
from warpsplat.torch import SceneTensors

Tensor = torch.Tensor

KEPT = 16
"""Layouts that are kept for further scenes of their structure."""

STEEP = 1e-3
"""Square of the length of a gradient's axis [canvas units] below which it counts as that long."""

FAINT = 1 / 256
"""Opacity of outlines whose coverages are added. Added, not composited: of two shapes that meet in a pixel
nothing is left over, which compositing would have for a quarter of it."""


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
        key = scene.structure, size, uniform, device
        with self._lock:
            layout = self._kept.pop(key, None) or make_layout(*key)
            self._kept[key] = layout
            while len(self._kept) > KEPT:
                self._kept.popitem(last=False)
        return layout


LAYOUTS = Layouts()


def assemble(
    scene: SceneArguments, layout: Layout, size: tuple[int, int], device: torch.device
) -> dict[str, Tensor]:
    """Attributes of the scene in pixels of a picture of ``size``, whose layout is ``layout``."""
    scale = size[0] / scene.width, size[1] / scene.height
    flat: Tensor = Flat.apply(*scene.tensors)
    maps = None
    if layout.maps is not None:
        maps = flat.index_select(0, layout.maps.entries).view(-1, 3, 3)
    paints = flat.index_select(0, layout.paints).view(-1, 4)
    values = layout.fixed | {
        "points": _points(flat, layout, maps, scale, device),
        "colors": paints[:, :3],
        "opacities": paints[:, 3],
    }
    if layout.widths is not None:
        values["widths"] = _widths(flat, layout, maps, math.sqrt(scale[0] * scale[1]))
    if layout.gradients is not None:
        values |= _gradients(flat, layout.gradients, torch.tensor(scale, device=device))
    return values


def _points(
    flat: Tensor, layout: Layout, maps: Tensor | None, scale: tuple[float, float], device: torch.device
) -> Tensor:
    points = layout.points.of(flat)
    if layout.order is not None:
        parts = [points]
        for ring in layout.rings:
            contours = ring_points(ring.segments.of(flat), ring.radii.of(flat), ring.is_closed)
            parts.append(torch.cat(contours, dim=0).transpose(0, 1).reshape(-1, 2))
        points = torch.cat(parts).index_select(0, layout.order)
    if maps is not None and layout.maps is not None:
        own = maps.index_select(0, layout.maps.point_group)
        points = torch.einsum("pij,pj->pi", own[:, :2, :2], points) + own[:, :2, 2]
    return points if scale == (1.0, 1.0) else points * torch.tensor(scale, device=device)


def _widths(flat: Tensor, layout: Layout, maps: Tensor | None, scale: float) -> Tensor:
    """Widths of strokes, twice DiffVG's [px]; shape (row,)."""
    assert layout.widths is not None
    widths = 2 * scale * flat.index_select(0, layout.widths)
    if maps is not None and layout.maps is not None:
        areas = maps[:, 0, 0] * maps[:, 1, 1] - maps[:, 0, 1] * maps[:, 1, 0]
        widths = widths * areas.abs().sqrt().index_select(0, layout.maps.row_group)
    return widths.clamp_min(0)


def _gradients(flat: Tensor, gradients: Gradients, stretch: Tensor) -> dict[str, Tensor]:
    """``stretch``: canvas units -> pixels, shape (2,)."""
    begin, end = flat.index_select(0, gradients.linear).view(-1, 2, 2).unbind(dim=1)
    axis = (end - begin) * stretch
    # As DiffVG does: an axis that is too short counts as a little longer.
    length = axis.square().sum(dim=1, keepdim=True).clamp_min(1e-12)
    axis = axis * (STEEP / length).clamp_min(1.0).detach()
    linear = torch.cat([begin * stretch, axis, -axis[:, 1:], axis[:, :1]], dim=1)
    center, radius = (flat.index_select(0, gradients.radial).view(-1, 2, 2) * stretch).unbind(dim=1)
    zeros = torch.zeros_like(radius)
    radial = torch.cat([center, radius[:, :1], zeros, radius[:, 1:]], dim=1)
    frames = torch.cat([torch.zeros(1, 6, device=flat.device), linear, radial])
    colors = flat.index_select(0, gradients.colors).view(-1, 4)
    return {
        "frames": frames.index_select(0, gradients.order),
        "stop_offsets": flat.index_select(0, gradients.offsets),
        "stop_colors": colors[:, :3],
        "stop_opacities": colors[:, 3],
    }


def outlines_only(values: Mapping[str, Tensor], layout: Layout) -> SceneTensors:
    """The same outlines, all black and of opacity ``FAINT``: so faint that their coverages add up. Those that
    cannot be seen are left out, as no colour shows there.
    """
    own = {name: values[name] for name in ("points", "widths") if name in values}
    own["opacities"] = FAINT * (values["opacities"].detach() > constants.SEEN).float()
    own["colors"] = torch.zeros_like(values["colors"])
    return SceneTensors(layout.outlines, own)
