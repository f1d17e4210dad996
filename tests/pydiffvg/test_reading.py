"""Scenes that stay the same are read once; whatever changes is seen."""

from __future__ import annotations

from collections.abc import Callable

import pytest
import torch

from tests.pydiffvg.helpers import SIZE, scene, tensor
from warpsplat import pydiffvg
from warpsplat.pydiffvg import reading
from warpsplat.pydiffvg.arguments import SceneArguments, take_down
from warpsplat.pydiffvg.shape import Shape, ShapeGroup

CPU = torch.device("cpu")
Scene = tuple[list[Shape], list[ShapeGroup]]


def read(shapes: list[Shape], groups: list[ShapeGroup]) -> SceneArguments:
    return reading.read(SIZE, SIZE, shapes, groups, CPU)


def are_alike(one: SceneArguments, other: SceneArguments) -> bool:
    """Whether structures are equal, and tensors one and the same."""
    return one.structure == other.structure and list(map(id, one.tensors)) == list(map(id, other.tensors))


def test_a_scene_that_stays_is_read_once(monkeypatch: pytest.MonkeyPatch) -> None:
    shapes, groups = scene()
    first = read(shapes, groups)
    monkeypatch.setattr(reading, "take_down", None)
    with torch.no_grad():
        shapes[4].points += 1  # type: ignore[union-attr]  # a path
    assert read(list(shapes), list(groups)) is first


def _set(of: Callable[[Scene], object], name: str, value: object) -> Callable[[Scene], None]:
    return lambda made: setattr(of(made), name, value)


def _write(of: Callable[[Scene], torch.Tensor], value: object) -> Callable[[Scene], None]:
    """As programs do, past the versions that torch counts."""

    def change(made: Scene) -> None:
        of(made).data.copy_(torch.as_tensor(value))

    return change


CHANGES: dict[str, Callable[[Scene], None]] = {
    "points": _set(lambda s: s[0][4], "points", torch.zeros(6, 2, dtype=torch.float32)),
    "closed": _set(lambda s: s[0][3], "is_closed", False),
    "width": _set(lambda s: s[0][1], "stroke_width", tensor(2.0)),
    "fill": _set(lambda s: s[1][0], "fill_color", tensor(1, 0, 0, 1)),
    "no fill": _set(lambda s: s[1][0], "fill_color", None),
    "rule": _set(lambda s: s[1][3], "use_even_odd_rule", False),
    "end of a gradient": _set(lambda s: s[1][2].fill_color, "end", tensor(9, 9)),
    "segments": _write(lambda s: s[0][4].num_control_points, [2, 1, 0]),  # type: ignore[union-attr]
    "which shape": _write(lambda s: s[1][3].shape_ids, [4]),
    "map": _write(lambda s: s[1][3].shape_to_canvas, [[1.0, 0, 3], [0, 1, 0], [0, 0, 1]]),
    "stretch": _write(lambda s: s[1][5].shape_to_canvas, [[1.0, 0, 3], [0, 2, 0], [0, 0, 1]]),
    "trained map": lambda s: setattr(s[1][3].shape_to_canvas, "requires_grad", True),
    "sizes": lambda s: setattr(s[0][3].points, "data", torch.ones(7, 2)),  # type: ignore[union-attr]
    "more": lambda s: s[1].append(s[1][3]),
    "order": lambda s: s[1].reverse(),
    "another shape": lambda s: s[0].__setitem__(1, pydiffvg.Ellipse(tensor(2, 3), tensor(4, 5))),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_is_seen(name: str) -> None:
    made = scene()
    before = read(*made)
    CHANGES[name](made)
    after = read(*made)
    assert not are_alike(after, before)
    assert are_alike(after, take_down(SIZE, SIZE, *made, CPU))


def test_other_arguments_are_seen() -> None:
    shapes, groups = scene()
    read(shapes, groups)
    assert reading.read(SIZE, 2 * SIZE, shapes, groups, CPU).height == 2 * SIZE


@pytest.mark.parametrize("points", ["double", "computed"])
def test_what_is_computed_is_computed_anew(points: str) -> None:
    """Of tensors of another type there are copies, of computed ones a graph that is used up."""
    values = tensor([[4, 4], [40, 5], [22, 40]])
    values = values.double() if points == "double" else values.requires_grad_() * 1.0
    shape = pydiffvg.Polygon(values, True)
    group = pydiffvg.ShapeGroup(torch.tensor([0]), tensor(1, 0, 0, 1))
    first = read([shape], [group])
    with torch.no_grad():
        values += 3
    second = read([shape], [group])
    assert second is not first
    assert torch.equal(second.tensors[0].detach(), values.detach().float())


def test_gradients_can_be_zeroed_in_place_and_optimised() -> None:
    """They are parts of one tensor."""
    shapes, groups = scene()
    trained = [shapes[4].points, groups[0].fill_color, shapes[1].radius]  # type: ignore[union-attr]
    for value in trained:
        value.requires_grad_()  # type: ignore[union-attr]
    optimizer = torch.optim.Adam(trained, lr=0.1)
    losses = []
    for _ in range(4):
        optimizer.zero_grad(set_to_none=False)
        arguments = pydiffvg.RenderFunction.serialize_scene(SIZE, SIZE, shapes, groups)
        loss = (pydiffvg.RenderFunction.apply(SIZE, SIZE, 2, 2, 0, None, *arguments) - 0.5).square().mean()
        loss.backward()
        optimizer.step()
        losses.append(loss.item())
    assert losses == sorted(losses, reverse=True)
    assert shapes[0].p_min.grad is None  # type: ignore[union-attr]
