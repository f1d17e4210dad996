"""Scripts that say ``import pydiffvg``, run unchanged."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from warpsplat.pydiffvg.__main__ import main

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


def test_what_is_not_supported_is_one_line_with_its_place(
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
