"""Small scenes in DiffVG's classes."""

from __future__ import annotations

import io
from collections.abc import Sequence
from pathlib import Path

import numpy as np
import torch
from PIL import Image

from warpsplat import pydiffvg
from warpsplat.pydiffvg.shape import Shape, ShapeGroup
from warpsplat.svg.viewer import render_own

Tensor = torch.Tensor
SIZE = 48


def tensor(*values: object) -> Tensor:
    return torch.tensor(values if len(values) > 1 else values[0], dtype=torch.float32)


def render(
    shapes: Sequence[Shape],
    groups: Sequence[ShapeGroup],
    background: Tensor | None = None,
    size: tuple[int, int] = (SIZE, SIZE),
) -> Tensor:
    arguments = pydiffvg.RenderFunction.serialize_scene(SIZE, SIZE, shapes, groups)
    return pydiffvg.RenderFunction.apply(*size, 2, 2, 0, background, *arguments)


def on_white(image: Tensor) -> np.ndarray:
    """Composite an image that is not premultiplied on white, shape (height, width, 3)."""
    values = image.detach().numpy().astype(np.float64)
    return values[..., :3] * values[..., 3:] + 1 - values[..., 3:]


def shown(path: Path) -> np.ndarray:
    """Return an SVG as resvg draws it, on white, shape (height, width, 3)."""
    picture = render_own(path.read_text(encoding="utf-8")).convert("RGBA")
    return on_white(torch.tensor(np.asarray(picture) / 255))


def psnr(a: np.ndarray, b: np.ndarray) -> float:
    return float(-10 * np.log10(((a - b) ** 2).mean()))


def png(path: Path) -> np.ndarray:
    return np.asarray(Image.open(io.BytesIO(path.read_bytes())))


def blob() -> pydiffvg.Path:
    """Return a closed path of two cubics."""
    points = tensor([[8, 20], [10, 4], [36, 6], [40, 22], [42, 40], [12, 44]])
    return pydiffvg.Path(torch.tensor([2, 2]), points, True, tensor(0.0))


COLOR = 0.8, 0.4, 0.2, 0.9


def group(number: int = 0, color: Tensor | None = None) -> pydiffvg.ShapeGroup:
    return pydiffvg.ShapeGroup(torch.tensor([number]), tensor(*COLOR) if color is None else color)


def scene() -> tuple[list[Shape], list[ShapeGroup]]:
    """Return every kind of shape and paint on an opaque ground, 48 px."""
    rotated = tensor([[0.8, -0.6, 14.0], [0.6, 0.8, -8.0], [0.0, 0.0, 1.0]])
    stretched = tensor([[1.0, 0.0, 0.0], [0.0, 0.5, 20.0], [0.0, 0.0, 1.0]])
    mixed = tensor([[28, 26], [44, 24], [46, 34], [40, 38], [36, 46], [30, 40]])
    bow = tensor([[6, 40], [10, 26], [18, 44], [24, 32]])
    shapes: list[Shape] = [
        pydiffvg.Rect(tensor(-2, -2), tensor(50, 50)),
        pydiffvg.Circle(tensor(7.0), tensor(11, 12), stroke_width=tensor(1.5)),
        pydiffvg.Ellipse(tensor(9.0, 4.0), tensor(34, 10)),
        pydiffvg.Polygon(tensor([[24, 6], [12, 43], [42, 19], [6, 19], [36, 43]]), True),
        pydiffvg.Path(torch.tensor([0, 1, 2]), mixed, True),
        pydiffvg.Rect(tensor(20, 22), tensor(30, 30), stroke_width=tensor(1.0)),
        pydiffvg.Path(torch.tensor([2]), bow, False, tensor(4, 1, 1, 3)),
        pydiffvg.Circle(tensor(6.0), tensor(40, 32), stroke_width=tensor(1.2)),
        pydiffvg.Circle(tensor(5.0), tensor(11, 36)),
        pydiffvg.Circle(tensor(2.5), tensor(11, 36)),
        pydiffvg.Polygon(tensor([[4, 4], [20, 3], [22, 20]]), False, tensor(1.0)),
    ]
    stops = tensor([0.0, 0.4, 1.0]), tensor([[0.9, 0.1, 0.2, 1], [0.1, 0.6, 0.9, 0.8], [0.9, 0.9, 0.1, 1]])
    linear = pydiffvg.LinearGradient(tensor(26, 8), tensor(42, 12), *stops)
    radial = pydiffvg.RadialGradient(tensor(38, 34), tensor(9, 12), *stops)

    def stroked(number: int, stroke: Tensor, fill: Tensor | None = None, **more: Tensor) -> ShapeGroup:
        return pydiffvg.ShapeGroup(torch.tensor([number]), fill, stroke_color=stroke, **more)

    groups = [
        group(0, tensor(0.9, 0.95, 0.85, 1.0)),
        stroked(1, tensor(0.1, 0.2, 0.6, 0.7), tensor(0.8, 0.2, 0.1, 0.9)),
        pydiffvg.ShapeGroup(torch.tensor([2]), linear),
        group(3, tensor(0.3, 0.6, 0.3, 0.6)),
        pydiffvg.ShapeGroup(torch.tensor([4]), radial),
        stroked(5, tensor(0.0, 0.0, 0.0, 1.0), tensor(0.2, 0.2, 0.7, 0.8), shape_to_canvas=rotated),
        stroked(6, tensor(0.5, 0.1, 0.5, 0.8)),
        stroked(7, tensor(0.1, 0.5, 0.1, 1.0), shape_to_canvas=stretched),
        pydiffvg.ShapeGroup(torch.tensor([8, 9]), tensor(0.1, 0.1, 0.1, 0.9)),
        stroked(10, tensor(0.9, 0.5, 0.0, 1.0)),
    ]
    return shapes, groups
