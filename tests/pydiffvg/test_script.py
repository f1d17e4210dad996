"""Scripts that say ``import pydiffvg``, and scenes that stay the same between their calls."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import torch

from tests.pydiffvg.helpers import SIZE, group, scene, tensor
from warpsplat import pydiffvg
from warpsplat.pydiffvg.__main__ import main
from warpsplat.pydiffvg.arguments import SceneArguments, serialize
from warpsplat.pydiffvg.cached import serialize_cached
from warpsplat.pydiffvg.shape import Shape, ShapeGroup

FIT = """
import sys
import diffvg
import pydiffvg
import torch
from optimize_svg import OptimizableSvg
from pydiffvg.shape import Circle

pydiffvg.set_use_gpu(False)
pydiffvg.set_print_timing(True)
circle = pydiffvg.Circle(radius=torch.tensor(12.0), center=torch.tensor([16.0, 16.0]))
assert isinstance(circle, Circle)
group = pydiffvg.ShapeGroup(shape_ids=torch.tensor([0]), fill_color=torch.tensor([0.3, 0.6, 0.3, 1.0]))
box = pydiffvg.PixelFilter(type=diffvg.FilterType.box, radius=torch.tensor(0.5))

def render(seed):
    arguments = pydiffvg.RenderFunction.serialize_scene(32, 32, [circle], [group], filter=box)
    return pydiffvg.RenderFunction.apply(32, 32, 2, 2, seed, None, *arguments)

target = render(0)
radius = torch.tensor(6.0 / 32, requires_grad=True)
optimizer = torch.optim.Adam([radius], lr=2e-2)
for t in range(int(sys.argv[1])):
    optimizer.zero_grad()
    circle.radius = radius * 32
    image = render(t)
    loss = (image - target).pow(2).sum()
    loss.backward()
    optimizer.step()
    print('loss:', loss.item())
pydiffvg.imwrite(image.cpu(), 'results/fit/final.png', gamma=1.0)
"""

UNKNOWN_SHAPE = """\
import pydiffvg
import torch
pydiffvg.RenderFunction.serialize_scene(9, 9, [], [pydiffvg.ShapeGroup(torch.tensor([3]), None)])
"""


def is_ours(name: str) -> bool:
    """Return whether scripts get a module from this package."""
    return name.partition(".")[0] in ("pydiffvg", "diffvg", "optimize_svg")


@pytest.fixture(autouse=True)
def _own_modules(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """Restore what a script changes in the interpreter."""
    before = {name: module for name, module in sys.modules.items() if is_ours(name)}
    monkeypatch.setattr(sys, "argv", sys.argv)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.chdir(tmp_path)
    yield
    for name in filter(is_ours, [*sys.modules]):
        del sys.modules[name]
    sys.modules.update(before)


def test_a_fit(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    script = tmp_path / "fit.py"
    script.write_text(FIT, encoding="utf-8")
    assert main([str(script), "30"]) == 0
    output = capsys.readouterr().out
    losses = [float(line.split()[1]) for line in output.splitlines() if line.startswith("loss:")]
    assert len(losses) == 30 and losses[-1] < 0.1 * losses[0]
    assert "Forward pass, time:" in output
    assert (tmp_path / "results/fit/final.png").exists()


def test_unsupported_arguments_are_one_line_with_their_place(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    script = tmp_path / "unknown.py"
    script.write_text(UNKNOWN_SHAPE, encoding="utf-8")
    assert main([str(script)]) == 2
    error = capsys.readouterr().err
    assert error.startswith(f"error: {script}:3: group 0 names shape 3") and error.count("\n") == 1


def test_no_script(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 2
    assert main(["missing.py"]) == 2
    assert "missing.py: no such script" in capsys.readouterr().err
    assert main(["--help"]) == 0


CPU = torch.device("cpu")
Scene = tuple[list[Shape], list[ShapeGroup]]


def cached(shapes: list[Shape], groups: list[ShapeGroup], height: int = SIZE) -> SceneArguments:
    return serialize_cached(SIZE, height, shapes, groups, CPU)


def are_alike(one: SceneArguments, other: SceneArguments) -> bool:
    """Return whether structures are equal, and tensors the same objects."""
    return one.structure == other.structure and list(map(id, one.tensors)) == list(map(id, other.tensors))


def test_a_scene_that_stays_is_serialized_once() -> None:
    shapes, groups = scene()
    first = cached(shapes, groups)
    with torch.no_grad():
        shapes[4].points += 1  # type: ignore[union-attr]  # a path
    assert cached(list(shapes), list(groups)) is first
    assert cached(shapes, groups, 2 * SIZE).height == 2 * SIZE


def _set(owner: Callable[[Scene], object], name: str, value: object) -> Callable[[Scene], None]:
    return lambda made: setattr(owner(made), name, value)


def _write(tensor: Callable[[Scene], torch.Tensor], value: object) -> Callable[[Scene], None]:
    """Change values past the versions that torch counts, as programs do."""

    def change(made: Scene) -> None:
        tensor(made).data.copy_(torch.as_tensor(value))

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
    "transform": _write(lambda s: s[1][3].shape_to_canvas, [[1.0, 0, 3], [0, 1, 0], [0, 0, 1]]),
    "stretch": _write(lambda s: s[1][5].shape_to_canvas, [[1.0, 0, 3], [0, 2, 0], [0, 0, 1]]),
    "trained transform": lambda s: setattr(s[1][3].shape_to_canvas, "requires_grad", True),
    "trained width": lambda s: setattr(s[0][0].stroke_width, "requires_grad", True),
    "sizes": lambda s: setattr(s[0][3].points, "data", torch.ones(7, 2)),  # type: ignore[union-attr]
    "more": lambda s: s[1].append(s[1][3]),
    "order": lambda s: s[1].reverse(),
    "another shape": lambda s: s[0].__setitem__(1, pydiffvg.Ellipse(tensor(2, 3), tensor(4, 5))),
}


@pytest.mark.parametrize("name", CHANGES)
def test_a_change_is_noticed(name: str) -> None:
    made = scene()
    before = cached(*made)
    CHANGES[name](made)
    after = cached(*made)
    assert not are_alike(after, before)
    assert are_alike(after, serialize(SIZE, SIZE, *made, CPU))


@pytest.mark.parametrize("kind", ["double", "computed"])
def test_copies_and_results_are_made_again(kind: str) -> None:
    """Tensors of another type are copied; the graph of a computed one can be used only once."""
    values = tensor([[4, 4], [40, 5], [22, 40]])
    values = values.double() if kind == "double" else values.requires_grad_() * 1.0
    made: Scene = [pydiffvg.Polygon(values, True)], [group()]
    first = cached(*made)
    with torch.no_grad():
        values += 3
    second = cached(*made)
    assert second is not first
    assert torch.equal(second.tensors[0].detach(), values.detach().float())


def test_an_invisible_width_has_a_zero_gradient() -> None:
    shapes, groups = scene()
    assert all(shapes[0].stroke_width is not each for each in cached(shapes, groups).tensors)
    width = shapes[0].stroke_width.requires_grad_()
    arguments = pydiffvg.RenderFunction.serialize_scene(SIZE, SIZE, shapes, groups)
    image = pydiffvg.RenderFunction.apply(SIZE, SIZE, 2, 2, 0, None, *arguments)
    assert torch.autograd.grad(image.sum(), width)[0] == 0
