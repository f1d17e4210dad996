"""Gradients of edges that lie on borders of pixels, where the derivative of a coverage jumps."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
import torch

import warpsplat
from tests.helpers import relative_error
from warpsplat.torch import SceneTensors, render

Tensor = torch.Tensor

SIZE = 48
OFFSETS = [0.0, 1e-4, -1e-4, 0.3, 0.5]  # of coordinates that are whole numbers [px]
STEP = 0.02
"""Of central differences [px]."""

SHAPES = {
    "rectangle at borders of tiles": '<rect x="16" y="16" width="16" height="20" {fill}/>',
    "polygon": '<path d="M8 8H40V32H17V21H8Z" {fill}/>',
    "other direction": '<path d="M8 8V32H32V8Z" {fill}/>',
    "hole": '<path fill-rule="evenodd" d="M8 8H40V40H8Z M16 16H24V32H16Z" {fill}/>',
    "circle": '<circle cx="24" cy="20" r="12" {fill}/>',
    "upright line": '<path d="M16 10V38" {stroke} stroke-width="8"/>',
    "level line": '<path d="M10 16H38" {stroke} stroke-width="8"/>',
    "butt caps": '<path d="M10.5 10V40" {stroke} stroke-width="3" stroke-linecap="butt"/>',
    "slanted line": '<path d="M10 10L38 38" {stroke} stroke-width="8"/>',
}
PAINTS = {"fill": 'fill="#4a8"', "stroke": 'fill="none" stroke="#4a8"'}


def weighted(image: Tensor) -> Tensor:
    """Return a sum over an image with weights that hardly change from pixel to pixel."""
    y, x = torch.meshgrid(torch.arange(SIZE), torch.arange(SIZE), indexing="ij")
    weights = (1 + 0.0005 * x + 0.0003 * y)[..., None] * torch.tensor([0.5, -0.8, 0.3, 1.0])
    return (image.double() * weights).sum()


def differences(loss: Callable[[Tensor], Tensor], at: Tensor) -> Tensor:
    """Return the central differences of a function of a tensor."""
    found = torch.zeros(at.numel())
    with torch.no_grad():
        for i, step in enumerate((STEP * torch.eye(at.numel())).to(at).view(-1, *at.shape)):
            found[i] = (loss(at + step) - loss(at - step)) / (2 * STEP)
    return found.view(at.shape)


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("name", SHAPES)
def test_gradients_on_borders_are_those_of_differences(tmp_path: Path, name: str, offset: float) -> None:
    shape = f'<g transform="translate({offset} {offset})">{SHAPES[name].format(**PAINTS)}</g>'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" width="{SIZE}" height="{SIZE}">{shape}</svg>'
    path = tmp_path / "shape.svg"
    path.write_text(svg, encoding="utf-8")
    tensors = SceneTensors.of(warpsplat.load_svg(path))

    def loss(values: Tensor, name: str) -> Tensor:
        changed = SceneTensors(tensors.layout, {**tensors.values, name: values})
        return weighted(render(changed))

    for attribute in ("points", "widths") if "stroke" in shape else ("points",):
        value = tensors.values[attribute].clone().requires_grad_()
        (gradient,) = torch.autograd.grad(loss(value, attribute), value)
        wanted = differences(lambda x, name=attribute: loss(x, name), value.detach())  # type: ignore[misc]
        assert relative_error(gradient.numpy(), wanted.numpy()) < 1e-3, attribute
