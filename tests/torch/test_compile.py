"""``torch.compile``: one operator in the graph, with the eager call's image and gradients."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import pytest
import torch

from tests import ROOT
from tests.scenes import mixed_scene, random_scene
from warpsplat.errors import ResourceError
from warpsplat.scene import Kind
from warpsplat.torch import Module, SceneTensors, render

LAYOUT = random_scene(Kind.FILL, 3)

pytestmark = [pytest.mark.usefixtures("single_precision"), pytest.mark.slow]  # the compiler takes 3 s to load


if tuple(map(int, torch.__version__.split(".")[:2])) < (2, 13):
    pytest.skip("older compilers do not take scenes as constants", allow_module_level=True)


@pytest.fixture(autouse=True)
def fresh() -> Iterator[None]:
    yield
    torch.compiler.reset()


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """Return a function as one graph; ``aot_eager`` does all but write C++."""
    call: Callable[..., Any] = torch.compile(function, fullgraph=True, backend="aot_eager")
    return call


def train(wrap: Callable[[Callable[..., Any]], Callable[..., Any]], steps: int) -> list[dict[str, Any]]:
    """Return loss and gradients of each step of a training."""
    module = Module(mixed_scene(seed=1))
    optimizer = torch.optim.Adam(module.parameter_groups())
    target = torch.linspace(0, 1, 40)[None, :, None]
    loss_of = wrap(lambda: (module()[..., :3] - target).square().mean())
    found = []
    for _ in range(steps):
        optimizer.zero_grad()
        loss = loss_of()
        loss.backward()
        gradients = {
            name: value.grad.clone() for name, value in module.named_parameters() if value.grad is not None
        }
        found.append({"loss": loss.item(), **gradients})
        optimizer.step()
        module.project()
    return found


def test_a_training_is_the_eager_one_bit_by_bit() -> None:
    found, wanted = train(compiled, 12), train(lambda function: function, 12)
    assert found[-1]["loss"] < 0.9 * found[0]["loss"]
    for one, other in zip(found, wanted, strict=True):
        torch.testing.assert_close(one, other, rtol=0, atol=0)


def test_another_layout_is_compiled_again() -> None:
    """Also one that differs only in values that have no tensor; and all scenes of a list are rendered."""
    first = random_scene(Kind.FILL, 3)
    layouts = [first, replace(first, colors=1 - first.colors), random_scene(Kind.FILL, 5), first]
    calls = compiled(lambda layout, points: render(SceneTensors(layout, {"points": points})).sum())
    for layout in layouts:
        gradients = []
        for call in (calls, lambda layout, points: render(SceneTensors(layout, {"points": points})).sum()):
            points = torch.tensor(layout.points).requires_grad_()
            call(layout, points).backward()
            gradients.append(points.grad)
        torch.testing.assert_close(*gradients, rtol=0, atol=0)
    scenes = [SceneTensors.of(layout) for layout in layouts[:2]]
    assert torch.equal(compiled(lambda scenes: render(scenes, 20))(scenes), render(scenes, 20))


@pytest.mark.filterwarnings("ignore::DeprecationWarning:torch.jit._script")  # torch uses it itself
@pytest.mark.filterwarnings("ignore:warpsplat.torch renders in float32")
def test_the_operator_keeps_torchs_contract() -> None:
    from warpsplat.torch.function import spec_key

    scene = SceneTensors.of(random_scene(Kind.STROKE, 3), requires_grad=True)
    scene = SceneTensors(scene.layout, {**scene.values, "colors": torch.rand(3, 3, dtype=torch.float64)})
    key = spec_key(scene.layout, None, None, "exact", None, scene.device)
    arguments = list(scene.values.values()), ",".join(scene.values), key
    tests = "test_schema", "test_autograd_registration", "test_faketensor"  # passes get a new ticket each
    torch.library.opcheck(torch.ops.warpsplat.render.default, arguments, test_utils=tests)


def test_errors_come_through() -> None:
    points = torch.tensor(random_scene(Kind.FILL, 3).points)

    @compiled
    def call(points: torch.Tensor, width: int = 40) -> torch.Tensor:
        return render(SceneTensors(LAYOUT, {"points": points}), width)

    with pytest.raises(ValueError, match="points: numbers that are not finite"):
        call(points * torch.nan)
    with pytest.raises(ResourceError, match="draw it smaller"):
        call(points, 400_000)
    with pytest.raises(torch._dynamo.exc.InternalTorchDynamoError, match="width must be a whole number"):
        call(points, 0)


def test_the_compiler_is_not_imported_unasked() -> None:
    code = "import sys, warpsplat.torch; sys.exit('torch._dynamo' in sys.modules)"
    subprocess.run([sys.executable, "-c", code], cwd=ROOT, check=True)
