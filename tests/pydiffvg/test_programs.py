"""What programs written on top of DiffVG do besides the plain loop."""

from __future__ import annotations

import copy
import pickle

import torch

from tests.pydiffvg.helpers import SIZE, blob, group, render, scene, tensor
from warpsplat import pydiffvg
from warpsplat.pydiffvg import device as first_device


def test_what_programs_read_of_the_interface() -> None:
    assert pydiffvg.RenderFunction.serialize_scene(SIZE, 40, [blob()], [group()])[:2] == [SIZE, 40]
    assert pydiffvg.device is first_device and isinstance(pydiffvg.device, torch.device)
    assert pydiffvg.device.type == pydiffvg.get_device().type
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


def test_shapes_are_added_between_steps() -> None:
    """As programs do that add layers: a new optimiser for each, values clamped in place."""
    target = render([blob()], [group(color=tensor(0.1, 0.3, 0.9, 1.0))])
    shapes: list[pydiffvg.Path] = []
    groups: list[pydiffvg.ShapeGroup] = []
    losses = []
    for number in range(3):
        shapes.append(blob())
        shapes[-1].points = (shapes[-1].points * 0.5 + 6 * number).requires_grad_()
        groups.append(group(number, torch.tensor([0.5, 1.2, -0.1, 1.0], requires_grad=True)))
        colors = [one.fill_color for one in groups]
        optimizer = torch.optim.Adam([one.points for one in shapes], lr=0.5)
        optimizer.add_param_group({"params": colors, "lr": 0.05})
        for _ in range(4):
            optimizer.zero_grad()
            loss = (render(shapes, groups) - target).square().mean()
            loss.backward()
            optimizer.step()
            with torch.no_grad():
                for color in colors:
                    assert isinstance(color, torch.Tensor)
                    color.clamp_(0.0, 1.0)
            losses.append(loss.item())
    assert losses[-1] < 0.6 * losses[0]


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
