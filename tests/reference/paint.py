"""Colours of pixels: flat, or of gradients."""

from __future__ import annotations

import torch

from tests.reference.curves import Tensors
from warpsplat.scene import Paint, Scene, Spread


def pixel_paint(scene: Scene, p: Tensors, shape: int, at: torch.Tensor) -> tuple[torch.Tensor, torch.Tensor]:
    """Colour [..., 3] and opacity [...] of a shape at places [..., 2] of the canvas."""
    if scene.paint[shape] == Paint.FLAT:
        return p["colors"][shape].expand(*at.shape[:-1], 3), torch.ones(at.shape[:-1])
    frame = p["frames"][shape]
    axes = torch.stack([frame[2:4], frame[4:6]], dim=1)
    unit = torch.linalg.solve(axes, (at - frame[:2])[..., None])[..., 0]
    if scene.paint[shape] == Paint.LINEAR:
        t = unit[..., 0]
    else:
        t = circle_through(unit, torch.tensor(scene.focus[shape], dtype=torch.float64))
    own = slice(int(scene.stop_first[shape]), int(scene.stop_first[shape + 1]))
    offsets = torch.cummax(p["stop_offsets"][own], dim=0).values
    rows = torch.cat([p["stop_colors"][own], p["stop_opacities"][own][:, None]], dim=1)
    values = interpolate(within(t, Spread(int(scene.spread[shape]))), offsets, rows)
    return values[..., :3], values[..., 3]


def circle_through(p: torch.Tensor, focus: torch.Tensor) -> torch.Tensor:
    """The s at which the circle from the focus (s = 0) to the unit circle (s = 1) goes through p [..., 2]."""
    centre, radius = focus[:2], focus[2]
    # |p - (1 - s) centre|^2 = (radius + s (1 - radius))^2, as a quadratic in s.
    d, grow = p - centre, 1 - radius
    a = (centre**2).sum() - grow**2
    b = 2 * ((d * centre).sum(-1) - radius * grow)
    c = (d**2).sum(-1) - radius**2
    root = torch.sqrt((b * b - 4 * a * c).clamp(min=0))
    return torch.maximum((-b + root) / (2 * a), (-b - root) / (2 * a))


def within(t: torch.Tensor, spread: Spread) -> torch.Tensor:
    """t brought into [0, 1], but where the end stops go on."""
    if spread == Spread.PAD:
        return t
    if spread == Spread.REPEAT:
        return t - t.floor()
    return 1 - (t % 2 - 1).abs()


def interpolate(t: torch.Tensor, offsets: torch.Tensor, rows: torch.Tensor) -> torch.Tensor:
    """Rows [stop, n] at t [...], linear between ascending offsets, constant beyond them; [..., n]."""
    result = rows[0].expand(*t.shape, rows.shape[1])
    for i in range(1, len(offsets)):
        width = offsets[i] - offsets[i - 1]
        share = ((t - offsets[i - 1]) / torch.where(width > 0, width, torch.ones(()))).clamp(0, 1)[..., None]
        between = (1 - share) * rows[i - 1] + share * rows[i]
        result = torch.where((t >= offsets[i - 1])[..., None], between, result)
        result = torch.where((t >= offsets[i])[..., None], rows[i], result)
    return result
