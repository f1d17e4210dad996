"""Gradients of edges that lie on borders of pixels, where the derivative of a coverage jumps."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import pytest
import torch

from tests.helpers import relative_error
from tests.pydiffvg.helpers import SIZE, render, tensor
from tests.torch.test_borders import OFFSETS, differences, weighted
from warpsplat import pydiffvg
from warpsplat.pydiffvg.shape import Shape

Tensor = torch.Tensor


class Case(NamedTuple):
    """A shape of a list of numbers, the first of which are coordinates."""

    make: Callable[[Tensor], Shape]
    numbers: list[float]
    coordinates: int
    stroked: bool = False


def line(p: Tensor) -> Shape:
    return pydiffvg.Path(torch.tensor([0]), p[:4].view(2, 2), False, stroke_width=p[4])


CASES = {
    "rectangle": Case(lambda p: pydiffvg.Rect(p[:2], p[2:]), [8, 16, 24, 32], 4),
    "circle": Case(lambda p: pydiffvg.Circle(p[2], p[:2]), [24, 20, 8], 2),
    "ellipse": Case(lambda p: pydiffvg.Ellipse(p[2:], p[:2]), [24, 20, 8, 12], 2),
    "polygon": Case(lambda p: pydiffvg.Polygon(p.view(-1, 2), True), [8, 8, 32, 8, 32, 32, 8, 20], 8),
    "upright line": Case(line, [16, 10, 16, 38, 4], 4, True),
    "level line": Case(line, [10, 16, 38, 16, 4], 4, True),
    "slanted line": Case(line, [10, 10, 38, 38, 4], 4, True),
}  # fmt: skip
WHITE = torch.ones(SIZE, SIZE, 3)


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("name", CASES)
def test_gradients_on_borders_are_those_of_differences(name: str, offset: float) -> None:
    case = CASES[name]
    numbers = tensor(*case.numbers)
    numbers[: case.coordinates] += offset
    for opacity, background in ((1.0, None), (0.6, None), (0.6, WHITE)):
        color = tensor(0.3, 0.6, 0.2, opacity)
        paints = (None, color) if case.stroked else (color, None)
        group = pydiffvg.ShapeGroup(torch.tensor([0]), paints[0], stroke_color=paints[1])

        def loss(p: Tensor, group: pydiffvg.ShapeGroup = group, under: Tensor | None = background) -> Tensor:
            return weighted(render([case.make(p)], [group], under))

        at = numbers.clone().requires_grad_()
        (gradient,) = torch.autograd.grad(loss(at), at)
        assert relative_error(gradient.numpy(), differences(loss, numbers).numpy()) < 1e-3


def test_a_rectangle_grows_to_a_target_from_whole_numbers() -> None:
    """It stays in its place if edges on borders have no gradient on one side."""
    wanted = render([pydiffvg.Rect(tensor(8, 8), tensor(40, 40))], [group_of()])
    corners = tensor(16, 16, 32, 32).requires_grad_()
    optimizer = torch.optim.Adam([corners], lr=0.5, betas=(0.5, 0.9))
    for _ in range(40):
        optimizer.zero_grad()
        image = render([pydiffvg.Rect(corners[:2], corners[2:])], [group_of()])
        (image - wanted).square().sum().backward()
        optimizer.step()
    torch.testing.assert_close(corners.detach(), tensor(8, 8, 40, 40), rtol=0, atol=0.1)


def group_of() -> pydiffvg.ShapeGroup:
    return pydiffvg.ShapeGroup(torch.tensor([0]), tensor(0.3, 0.6, 0.2, 1.0))
