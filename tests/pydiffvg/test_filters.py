"""Pixel filters, and derivatives of each pixel."""

from __future__ import annotations

import numpy as np
import pytest
import torch

from tests.pydiffvg.helpers import SIZE, group, tensor
from warpsplat import pydiffvg
from warpsplat.pydiffvg.diffvg import FilterType

Tensor = torch.Tensor

WEIGHTS = {
    FilterType.box: lambda u: np.where(abs(u) <= 1, 1.0, 0.0),
    FilterType.tent: lambda u: np.clip(1 - abs(u), 0, None),
    FilterType.parabolic: lambda u: np.clip(1 - u * u, 0, None),
    FilterType.hann: lambda u: np.where(abs(u) <= 1, 1 + np.cos(np.pi * u), 0.0),
}
"""By the distance over the radius, as DiffVG's ``filter.h`` has them, but for a factor."""


def render(pixel_filter: pydiffvg.PixelFilter, background: Tensor | None = None, size: int = SIZE) -> Tensor:
    shape = pydiffvg.Circle(tensor(13.3), tensor(22.1, 20.7))
    scene = pydiffvg.RenderFunction.serialize_scene(SIZE, SIZE, [shape], [group()], pixel_filter)
    return pydiffvg.RenderFunction.apply(size, size, 2, 2, 0, background, *scene)


@pytest.mark.parametrize("radius", [0.6, 1.3, 3.0])
@pytest.mark.parametrize("kind", list(FilterType))
def test_filters_are_weighted_means_of_samples(kind: FilterType, radius: float) -> None:
    parts = 10
    fine = render(pydiffvg.PixelFilter(), size=parts * SIZE).numpy().astype(np.float64)
    places, centres = (np.arange(parts * SIZE) + 0.5) / parts, np.arange(SIZE) + 0.5
    weights = WEIGHTS[kind]((places - centres[:, None]) / radius)
    weights /= weights.sum(axis=1, keepdims=True)
    wanted = np.einsum("yj,xi,jic->yxc", weights, weights, fine, optimize=True)
    found = render(pydiffvg.PixelFilter(kind, tensor(radius))).numpy()
    assert abs(found - wanted).max() < 0.02
    assert abs(found - wanted).mean() < 5e-4


@pytest.mark.parametrize("kind", list(FilterType))
def test_radius_has_a_gradient(kind: FilterType) -> None:
    weights = torch.rand(SIZE, SIZE, 4, generator=torch.Generator().manual_seed(1), dtype=torch.float64)

    def loss(radius: Tensor) -> Tensor:
        return (weights * render(pydiffvg.PixelFilter(kind, radius))).sum()

    radius = tensor(2.6).requires_grad_()
    (gradient,) = torch.autograd.grad(loss(radius), radius)
    with torch.no_grad():
        wanted = (loss(tensor(2.65)) - loss(tensor(2.55))) / 0.1
    assert float(gradient) == pytest.approx(float(wanted), rel=0.04)


def test_derivatives_of_pixels_add_up_to_those_of_shapes() -> None:
    center = tensor(22.1, 20.7).requires_grad_()
    shape = pydiffvg.Circle(tensor(13.3), center)
    scene = pydiffvg.RenderFunction.serialize_scene(SIZE // 2, SIZE // 2, [shape], [group()])
    arguments = SIZE, SIZE, 2, 2, 0, None, *scene
    weights = torch.rand(SIZE, SIZE, 4, generator=torch.Generator().manual_seed(1))
    (weights * pydiffvg.RenderFunction.apply(*arguments)).sum().backward()
    each = pydiffvg.RenderFunction.render_grad(weights, *arguments)
    assert each.shape == (SIZE, SIZE, 2)
    assert center.grad is not None
    torch.testing.assert_close(each.sum(dim=(0, 1)), center.grad, rtol=2e-3, atol=1e-2)
    assert not each[:4, :4].any()


def test_derivatives_of_distances() -> None:
    shape = pydiffvg.Circle(tensor(13.3), tensor(22.1, 20.7))
    scene = pydiffvg.RenderFunction.serialize_scene(
        SIZE, SIZE, [shape], [group()], output_type=pydiffvg.OutputType.sdf
    )
    each = pydiffvg.RenderFunction.render_grad(torch.ones(SIZE, SIZE, 1), SIZE, SIZE, 1, 1, 0, None, *scene)
    away = tensor(22.1 - 40.5, 20.7 - 30.5)
    torch.testing.assert_close(each[30, 40], away / away.norm())
