"""Images of DiffVG's classes, and their gradients."""

from __future__ import annotations

import copy
import math
import pickle
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from tests.pydiffvg.helpers import COLOR, SIZE, blob, group, on_white, psnr, render, scene, shown, tensor
from warpsplat import pydiffvg
from warpsplat.errors import UsageError
from warpsplat.pydiffvg import device as first_device
from warpsplat.pydiffvg.diffvg import FilterType
from warpsplat.pydiffvg.shape import Shape

Tensor = torch.Tensor


def circle(opacity: float = 1.0) -> tuple[pydiffvg.Circle, pydiffvg.ShapeGroup]:
    return pydiffvg.Circle(tensor(10.0), tensor(20.5, 22.25)), group(0, tensor(0.2, 0.4, 0.8, opacity))


def test_area_of_a_circle() -> None:
    shape, fill = circle()
    image = render([shape], [fill])
    assert image.shape == (SIZE, SIZE, 4)
    assert float(image[..., 3].sum()) == pytest.approx(math.pi * 100, rel=2e-3)
    assert not render([], []).any()


def test_a_scene_of_every_kind_renders_as_its_file(tmp_path: Path) -> None:
    shapes, groups = scene()
    pydiffvg.save_svg(tmp_path / "scene.svg", SIZE, SIZE, shapes, groups)
    image = render(shapes, groups)
    assert psnr(on_white(image), shown(tmp_path / "scene.svg")) > 38
    for left_out in range(1, len(groups)):  # each of them shows
        rest = groups[:left_out] + groups[left_out + 1 :]
        assert psnr(on_white(image), on_white(render(shapes, rest))) < 35


def test_colors_are_not_premultiplied() -> None:
    shape, fill = circle(0.5)
    image = render([shape], [fill])
    assert torch.allclose(image[22, 20], tensor(0.2, 0.4, 0.8, 0.5), atol=1e-5)
    # A pixel that the shape lies on in part: its colour fades as its opacity does.
    edge = (image[..., 3] > 0.1) & (image[..., 3] < 0.4)
    assert edge.any()
    assert torch.allclose(image[edge][:, 2], 0.8 * 2 * image[edge][:, 3], atol=1e-3)


def test_seams_of_shapes_that_meet_keep_their_color() -> None:
    halves = [pydiffvg.Rect(tensor(x, 10), tensor(x + 10, 30)) for x in (10.5, 20.5)]
    image = render(halves, [group(i, tensor(0.2, 0.4, 0.8, 1.0)) for i in range(2)])
    assert torch.allclose(image[20, 20, :3], tensor(0.2, 0.4, 0.8), atol=2e-3)


@pytest.mark.parametrize("opacity", [1.0, 0.5, None])
def test_background(opacity: float | None) -> None:
    """Without opacity it is opaque."""
    below = torch.full((SIZE, SIZE, 3), 0.6)
    if opacity is not None:
        below = torch.cat([below, torch.full((SIZE, SIZE, 1), opacity)], dim=2)
    below.requires_grad_()
    shape, fill = circle(0.25)
    image = render([shape], [fill], below)
    through = 0.75 * (opacity or 1.0)
    total = 0.25 + through
    blue = (0.25 * 0.8 + 0.75 * 0.6) / total  # behind shapes the background counts as premultiplied
    assert image[22, 20, 2:].tolist() == pytest.approx([blue, total], abs=1e-5)
    assert torch.allclose(image[2, 2], tensor(0.6, 0.6, 0.6, opacity or 1.0), atol=1e-5)
    (grad,) = torch.autograd.grad(image[22, 20, 2], below)
    assert grad.shape == below.shape
    assert float(grad[22, 20, 2]) == pytest.approx(0.75 / total, abs=1e-4)


@pytest.mark.parametrize("size", [(2 * SIZE, 2 * SIZE), (2 * SIZE, SIZE)])
def test_other_size_than_the_canvas(size: tuple[int, int]) -> None:
    shapes, groups = scene()
    large = render(shapes, groups, size=size)
    shrunk = large.reshape(SIZE, size[1] // SIZE, SIZE, size[0] // SIZE, 4).mean(dim=(1, 3))
    assert psnr(on_white(shrunk), on_white(render(shapes, groups))) > 33


FIRST, FILL, STROKE = torch.tensor([0]), tensor(0.7, 0.3, 0.5, 0.8), tensor(0.2, 0.6, 0.1, 0.7)
DISC = pydiffvg.Circle(tensor(12.0), tensor(24.3, 22.1), tensor(2.0))
BOW = tensor([[8, 30], [14, 8], [30, 44], [40, 16]])
WIDTHS = tensor(3, 1.5, 2, 4)
ENDS, OFFSETS = tensor(12, 20, 36, 26), tensor(0.1, 0.8)
STOPS = tensor([[0.9, 0.1, 0.2, 0.9], [0.1, 0.8, 0.6, 0.5]])
MATRIX = tensor([[0.8, -0.5, 14.0], [0.5, 0.9, -8.0], [0, 0, 1]])
POINTS = tensor([[9, 9], [40, 10], [46, 30], [34, 40], [20, 46], [6, 30]])


def filled(shape: Shape, fill: Any = FILL, **more: Tensor) -> Tensor:
    return render([shape], [pydiffvg.ShapeGroup(FIRST, fill, **more)])


def stroked(shape: Shape, **more: Tensor) -> Tensor:
    return filled(shape, None, stroke_color=STROKE, **more)


def bow(points: Tensor = BOW, width: Tensor = WIDTHS) -> pydiffvg.Path:
    return pydiffvg.Path(torch.tensor([2]), points, False, width)


def linear(ends: Tensor = ENDS, offsets: Tensor = OFFSETS, stops: Tensor = STOPS) -> pydiffvg.LinearGradient:
    return pydiffvg.LinearGradient(ends[:2], ends[2:], offsets, stops)


VARIED: dict[str, tuple[Tensor, Callable[[Tensor], Tensor]]] = {
    "circle": (tensor(11.3, 23.1, 25.2), lambda v: filled(pydiffvg.Circle(v[0], v[1:]))),
    "ellipse": (tensor(11.3, 6.2, 23.1, 25.2), lambda v: filled(pydiffvg.Ellipse(v[:2], v[2:]))),
    "rect": (tensor(8.3, 9.2, 33.1, 35.2), lambda v: filled(pydiffvg.Rect(v[:2], v[2:]))),
    "polygon": (tensor([[8, 9], [40, 12], [22, 41]]), lambda v: filled(pydiffvg.Polygon(v, True))),
    "mixed path": (POINTS, lambda v: filled(pydiffvg.Path(torch.tensor([0, 1, 2]), v, True))),
    "stroke": (BOW, lambda v: stroked(bow(v, tensor(2.5)))),
    "width": (tensor([2.5]), lambda v: stroked(bow(width=v))),
    "widths": (WIDTHS, lambda v: stroked(bow(width=v))),
    "tapered points": (BOW, lambda v: stroked(bow(v))),
    "transform": (MATRIX, lambda v: filled(DISC, shape_to_canvas=v)),
    "transform of a stroke": (MATRIX, lambda v: stroked(DISC, shape_to_canvas=v)),
    "color": (tensor(0.3, 0.5, 0.2, 0.6), lambda v: filled(DISC, v)),
    "linear": (ENDS, lambda v: filled(DISC, linear(v))),
    "radial": (ENDS, lambda v: filled(DISC, pydiffvg.RadialGradient(v[:2], v[2:] / 2, OFFSETS, STOPS))),
    "offsets": (tensor(0.2, 0.7), lambda v: filled(DISC, linear(offsets=v))),
    "stops": (STOPS, lambda v: filled(DISC, linear(stops=v))),
}


@pytest.mark.parametrize("name", VARIED)
def test_gradients_match_finite_differences(name: str) -> None:
    """Compare along two directions, for a smooth loss of all four channels."""
    values, draw = VARIED[name]
    generator, axis = torch.Generator().manual_seed(5), torch.linspace(0, 3, SIZE)[:, None]
    phases = torch.tensor([[0, 1, 2, 4], [1, 0, 3, 2]])
    weights = (phases[0] + axis[None]).sin() * (phases[1] + axis[:, None]).cos() + 0.3

    def loss(v: Tensor) -> Tensor:
        return (weights * draw(v)).double().sum()

    at = values.clone().requires_grad_()
    (gradient,) = torch.autograd.grad(loss(at), at)
    assert gradient.abs().max() > 0
    step = 0.03 * float(values.abs().max()) / 10
    for _ in range(2):
        direction = torch.randn(values.shape, generator=generator)
        if "transform" in name:
            direction[2] = 0
            direction[:2, :2] *= 0.02
        with torch.no_grad():
            ahead, behind = (loss(values + sign * step * direction) for sign in (1, -1))
        expected = float(ahead - behind) / (2 * step)
        found = float((gradient * direction).sum())
        assert found == pytest.approx(expected, rel=0.03, abs=0.03 * float(gradient.norm()))


NO_WEIGHTS = pydiffvg.PixelFilter(FilterType.tent, tensor(0.0))
OPEN = pydiffvg.Path(torch.tensor([2, 2]), torch.zeros(6, 2), False)
NO_POINT = pydiffvg.Circle(tensor(float("nan")), tensor(9, 9))
REFUSED: dict[str, Callable[[], object]] = {
    "eval_positions are of signed distances": lambda: serialize([blob()], eval_positions=torch.zeros(3, 2)),
    "no pixel filter tent of radius 0": lambda: serialize([blob()], filter=NO_WEIGHTS),
    "group 0 names shape 0, there are 0": lambda: serialize([]),
    "shape 0 has 6 points, its num_control_points .* ask for 7": lambda: serialize([OPEN]),
    "center of shape 0 has shape": lambda: serialize([pydiffvg.Circle(tensor(1.0), torch.zeros(3))]),
    "a point of a shape is not finite": lambda: render([NO_POINT], [group()]),
    "background_image has shape": lambda: render([blob()], [group()], torch.zeros(SIZE, 9, 4)),
    "takes what RenderFunction.serialize_scene gave": lambda: pydiffvg.RenderFunction.apply(*range(9)),
}


def serialize(shapes: list[Shape], **more: Any) -> object:
    return pydiffvg.RenderFunction.serialize_scene(SIZE, SIZE, shapes, [group()], **more)


@pytest.mark.parametrize("message", REFUSED)
def test_unsupported_arguments_are_refused_in_one_line(message: str) -> None:
    with pytest.raises(UsageError, match=message) as caught:
        REFUSED[message]()
    assert "\n" not in str(caught.value)


def test_a_device_that_is_not_there() -> None:
    before = pydiffvg.get_device()
    with pytest.warns(UserWarning, match="there is no cuda:9"):
        pydiffvg.set_device(torch.device("cuda:9"))
    assert pydiffvg.get_device().type == ("cuda" if torch.cuda.is_available() else "cpu")
    pydiffvg.set_use_gpu(False)
    assert not pydiffvg.get_use_gpu()
    pydiffvg.set_device(before)


def test_opacity_beyond_its_range_has_a_gradient() -> None:
    shape, fill = circle()
    color = fill.fill_color = tensor(0.2, 0.4, 0.8, 1.2).requires_grad_()
    image = render([shape], [fill])
    assert float(image[22, 20, 3].detach()) == pytest.approx(1.0, abs=1e-5)
    image[..., 3].sum().backward()
    assert color.grad is not None and float(color.grad[3]) > 100
    assert np.isfinite(color.grad.numpy()).all()


def test_module_attributes_of_diffvg() -> None:
    assert pydiffvg.RenderFunction.serialize_scene(SIZE, 40, [blob()], [group()])[:2] == [SIZE, 40]
    assert pydiffvg.device is first_device and pydiffvg.device.type == pydiffvg.get_device().type
    assert pydiffvg.use_gpu == torch.cuda.is_available()


def test_copies_are_scenes_of_their_own() -> None:
    shapes, groups = [blob()], [group()]
    shapes[0].points.requires_grad_()
    copied = copy.deepcopy(shapes), copy.deepcopy(groups)
    stored = pickle.loads(pickle.dumps((shapes, groups)))
    copied[0][0].points.data += 3
    render(*copied).sum().backward()
    assert copied[0][0].points.grad is not None and shapes[0].points.grad is None
    assert torch.equal(render(*stored), render(shapes, groups))


def test_values_may_change_before_the_backward_pass() -> None:
    """The gradient is that of the image as it was rendered."""
    shape = blob()
    shape.points.requires_grad_()
    areas = [render([shape], [group()])[..., 3].sum() for _ in range(2)]
    (before,) = torch.autograd.grad(areas[0], shape.points)
    shape.points.data.mul_(0.5)
    (after,) = torch.autograd.grad(areas[1], shape.points)
    assert torch.equal(before, after)


def test_gradients_can_be_zeroed_in_place_and_optimised() -> None:
    """They are parts of one tensor; only tensors that require a gradient have one."""
    shapes, groups = scene()
    trained = [shapes[4].points, groups[0].fill_color, shapes[1].radius]  # type: ignore[union-attr]
    for value in trained:
        value.requires_grad_()  # type: ignore[union-attr]
    optimizer = torch.optim.Adam(trained, lr=0.1)
    losses = []
    for _ in range(4):
        optimizer.zero_grad(set_to_none=False)
        loss = (render(shapes, groups) - 0.5).square().mean()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses == sorted(losses, reverse=True)
    assert shapes[0].p_min.grad is None and shapes[3].points.grad is None  # type: ignore[union-attr]
    with torch.no_grad():
        assert not render(shapes, groups).requires_grad


def test_arguments_in_other_forms() -> None:
    """Lists for tensors of whole numbers, colours as columns, and more points than the segments need."""
    wanted = render([blob()], [group()])
    shape = blob()
    more = torch.cat([shape.points, torch.zeros(3, 2)]).requires_grad_()
    path: Any = pydiffvg.Path([2, 2], more, True)
    column: Any = pydiffvg.ShapeGroup([0], tensor(*COLOR)[:, None])
    image = render([path], [column])
    torch.testing.assert_close(image, wanted)
    image.sum().backward()
    assert more.grad is not None and more.grad[:6].any() and not more.grad[6:].any()


def test_a_rectangle_grows_to_a_target_from_whole_numbers() -> None:
    """It stays in its place if edges on borders of pixels have no gradient on one side."""
    color = group(0, tensor(0.3, 0.6, 0.2, 1.0))
    wanted = render([pydiffvg.Rect(tensor(8, 8), tensor(40, 40))], [color])
    corners = tensor(16, 16, 32, 32).requires_grad_()
    optimizer = torch.optim.Adam([corners], lr=0.5, betas=(0.5, 0.9))
    for _ in range(40):
        optimizer.zero_grad()
        (render([pydiffvg.Rect(corners[:2], corners[2:])], [color]) - wanted).square().sum().backward()
        optimizer.step()
    torch.testing.assert_close(corners.detach(), tensor(8, 8, 40, 40), rtol=0, atol=0.1)


def test_edges_shorter_than_rounding_have_finite_gradients() -> None:
    points = tensor([[8, 8], [8.000002, 8], [30, 8], [30, 30], [8, 30]]).requires_grad_()
    render([pydiffvg.Polygon(points, True)], [group()]).square().sum().backward()
    assert points.grad is not None and points.grad.isfinite().all()
