"""Gradients through torch against float64 autograd, and of edges on borders of pixels."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import warpsplat
from tests.helpers import relative_error
from tests.scenes import (
    contours_scene,
    mixed_scene,
    random_scene,
    styled_scene,
    with_gradients,
    with_stops,
)
from tests.torch.helpers import compare, compare_straight
from warpsplat.scene import Cap, Join, Kind, Rule, Scene
from warpsplat.torch import SceneTensors, render


def clear(scene: Scene) -> Scene:
    return replace(scene, canvas=replace(scene.canvas, background=None))


def mixed() -> Scene:
    return mixed_scene(seed=1).take(np.arange(6))


SCENES: dict[str, Callable[[], Scene]] = {
    "fills": lambda: random_scene(Kind.FILL),
    "strokes": lambda: random_scene(Kind.STROKE),
    "mixed": mixed,
    "transparent": lambda: clear(mixed()),
    "holes": lambda: contours_scene(Kind.FILL, Rule.EVENODD),
    "styled": lambda: styled_scene(Cap.SQUARE, Join.MITER),
    "dashed": lambda: styled_scene(Cap.BUTT, Join.BEVEL, 1),
    "gradients": lambda: with_gradients(mixed_scene(seed=2).take(np.arange(6))),
    "ramps": lambda: with_stops(random_scene(Kind.FILL, 5, seed=3)),
}


@pytest.mark.parametrize("name", SCENES)
def test_exact(name: str) -> None:
    tolerance = 3e-3 if name in ("styled", "dashed") else 1e-3
    compare(SCENES[name](), scale=1.2 if name == "transparent" else 1.0, tolerance=tolerance)


@pytest.mark.parametrize(("name", "transparent"), [("mixed", False), ("holes", False), ("gradients", True)])
def test_opacities_of_one(name: str, transparent: bool) -> None:
    """Shapes behind an opaque one have no gradient, but determine that of its opacity."""
    scene = SCENES[name]()
    opacities = np.where(np.arange(len(scene)) % 3 == 1, scene.opacities, 1).astype(np.float32)
    scene = replace(scene, opacities=opacities)
    compare(clear(scene) if transparent else scene)


@pytest.mark.parametrize("name", ["mixed", "opaque", "gradients"])
@pytest.mark.parametrize("threads", [1, 2])
def test_straight_colors(name: str, threads: int) -> None:
    """Opaque shapes hide others, some of which are faint or invisible."""
    opacities = np.array([0.7, 1, 0.001, 1, 0.3, 0.02], np.float32)
    opaque = replace(random_scene(Kind.FILL, 6, seed=4), opacities=opacities)
    compare_straight(clear(opaque if name == "opaque" else SCENES[name]()), threads)


@pytest.mark.parametrize("opaque", [False, True])
def test_splats(opaque: bool) -> None:
    scene = mixed_scene(seed=0, splines=False)
    compare(replace(scene, opacities=np.ones_like(scene.opacities)) if opaque else scene, "splat")


@pytest.mark.parametrize("kind", list(Kind))
def test_opaque_shapes_behind_one_another(kind: Kind) -> None:
    """The front one of three in one place is seen; the next one determines its opacity's gradient."""
    one = random_scene(kind, 1, seed=2)
    scene = replace(one.append(one).append(one), opacities=np.ones(3, np.float32))
    scene = replace(scene, widths=np.full(3, 30 if kind == Kind.STROKE else 0, np.float32))
    scene.colors[:] = np.eye(3)
    found = compare(scene)
    opacities, colors = found.values["opacities"].grad, found.values["colors"].grad
    assert opacities is not None and colors is not None
    assert opacities[2] != 0
    assert abs(colors[2]).max() > 0


@pytest.mark.parametrize("kind", list(Kind))
def test_soft_gaussians(kind: Kind) -> None:
    scene = random_scene(kind, 3, seed=7)
    fades = np.random.default_rng(0).uniform(-0.35, 0.04, (3, 3)) * (kind == Kind.STROKE)
    compare(replace(scene, fades=fades.astype(np.float32)), "gaussian", tolerance=2e-3)


def whole(scene: Scene) -> dict[str, torch.Tensor | None]:
    """Return the gradients of all attributes."""
    tensors = SceneTensors.of(scene, requires_grad=True)
    render(tensors).square().sum().backward()
    return {name: value.grad for name, value in tensors.values.items()}


def test_gradients_of_one_tensor_equal_those_of_all() -> None:
    scene = with_gradients(mixed_scene(seed=2))
    wanted = whole(scene)
    for name in ("points", "frames", "stop_colors"):
        some = SceneTensors.of(scene)
        some.values[name].requires_grad_()
        render(some).square().sum().backward()
        assert [key for key, value in some.values.items() if value.grad is not None] == [name]
        torch.testing.assert_close(some.values[name].grad, wanted[name], rtol=0, atol=0)


def test_gradients_flow_on_to_the_leaves() -> None:
    """Through a computed tensor, and a view that is not contiguous."""
    scene = random_scene(Kind.FILL, 4)
    shift = torch.zeros(2, dtype=torch.float32, requires_grad=True)
    colors = torch.tensor(scene.colors.T.copy(), requires_grad=True)
    values = {"points": torch.tensor(scene.points) + shift, "colors": colors.T}
    render(SceneTensors(scene, values)).square().sum().backward()
    points = whole(scene)["points"]
    assert points is not None and colors.grad is not None
    torch.testing.assert_close(shift.grad, points.sum(dim=0), rtol=1e-4, atol=1e-3)
    torch.testing.assert_close(colors.grad.T, whole(scene)["colors"], rtol=0, atol=0)


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


def weighted(image: torch.Tensor) -> torch.Tensor:
    """Return a sum over an image with weights that hardly change from pixel to pixel."""
    y, x = torch.meshgrid(torch.arange(SIZE), torch.arange(SIZE), indexing="ij")
    weights = (1 + 0.0005 * x + 0.0003 * y)[..., None] * torch.tensor([0.5, -0.8, 0.3, 1.0])
    return (image.double() * weights).sum()


def differences(loss: Callable[[torch.Tensor], torch.Tensor], at: torch.Tensor) -> torch.Tensor:
    """Return the central differences of a function of a tensor."""
    found = torch.zeros(at.numel())
    with torch.no_grad():
        for i, step in enumerate((STEP * torch.eye(at.numel())).to(at).view(-1, *at.shape)):
            found[i] = (loss(at + step) - loss(at - step)) / (2 * STEP)
    return found.view(at.shape)


@pytest.mark.parametrize("offset", OFFSETS)
@pytest.mark.parametrize("name", SHAPES)
def test_gradients_on_pixel_borders_match_finite_differences(
    tmp_path: Path, name: str, offset: float
) -> None:
    shape = f'<g transform="translate({offset} {offset})">{SHAPES[name].format(**PAINTS)}</g>'
    svg = f'<svg xmlns="http://www.w3.org/2000/svg" width="{SIZE}" height="{SIZE}">{shape}</svg>'
    path = tmp_path / "shape.svg"
    path.write_text(svg, encoding="utf-8")
    tensors = SceneTensors.of(warpsplat.load_svg(path))

    def loss(values: torch.Tensor, name: str) -> torch.Tensor:
        changed = SceneTensors(tensors.layout, {**tensors.values, name: values})
        return weighted(render(changed))

    for attribute in ("points", "widths") if "stroke" in shape else ("points",):
        value = tensors.values[attribute].clone().requires_grad_()
        (gradient,) = torch.autograd.grad(loss(value, attribute), value)
        wanted = differences(lambda x, name=attribute: loss(x, name), value.detach())  # type: ignore[misc]
        assert relative_error(gradient.numpy(), wanted.numpy()) < 1e-3, attribute
