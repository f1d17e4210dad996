"""The examples and notebooks run, and what they fit gets better."""

from __future__ import annotations

import json
import runpy
import sys
from itertools import pairwise
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
import torch
from PIL import Image

import warpsplat
from tests import ROOT

pytestmark = pytest.mark.usefixtures("single_precision")

EXAMPLES = ROOT / "examples"
STEPS = 25
CURVES = 12


@pytest.fixture(scope="module")
def cat(tmp_path_factory: pytest.TempPathFactory) -> str:
    """The picture that the examples use, at 48 px."""
    path = tmp_path_factory.mktemp("examples") / "cat.png"
    image = cv2.imread(str(ROOT / "docs/images/cat.jpg"))
    assert image is not None
    height, width = image.shape[:2]
    cv2.imwrite(str(path), cv2.resize(image, (48, 48 * height // width), interpolation=cv2.INTER_AREA))
    return str(path)


def run(name: str, *arguments: Any, **named: Any) -> Any:
    """Run an example, and return what it returns."""
    return runpy.run_path(str(EXAMPLES / f"{name}.py"))["main"](*arguments, **named)


@pytest.mark.parametrize("name", ["own_loss", "painterly", "masked_strokes"])
def test_an_image_is_fitted(name: str, cat: str, tmp_path: Path) -> None:
    losses = run(name, cat, str(tmp_path / "a.svg"), STEPS, curves=CURVES)
    assert len(losses) == STEPS
    assert losses[-1] < 0.95 * losses[0], "0.86 at most over five seeds"
    assert warpsplat.load_svg(tmp_path / "a.svg").canvas.width == 48


def test_strokes_keep_to_a_mask_from_a_file(cat: str, tmp_path: Path) -> None:
    mask = tmp_path / "mask.png"
    height, width = warpsplat.load_image(cat).shape[:2]
    white = np.zeros((height, width), np.uint8)
    white[4:, 4 : width // 2 + 1] = 255
    cv2.imwrite(str(mask), white)
    run("masked_strokes", cat, str(tmp_path / "a.svg"), 40, str(mask))
    opacity = warpsplat.render(tmp_path / "a.svg")[..., 3]
    assert opacity[6:-6, 8 : width // 2 - 4].mean() > 0.5
    assert opacity[:, width // 2 + 6 :].mean() < 0.1


def test_two_pictures_are_morphed(cat: str, tmp_path: Path) -> None:
    other = tmp_path / "other.png"
    Image.open(cat).transpose(Image.Transpose.FLIP_TOP_BOTTOM).save(other)
    errors = run("morph", cat, str(other), str(tmp_path / "a.webp"), STEPS, 40)
    assert max(errors) < 0.03
    with Image.open(tmp_path / "a.webp") as moving:
        assert getattr(moving, "n_frames", 1) == 24


def test_a_network_compares(cat: str, tmp_path: Path) -> None:
    torch.manual_seed(3)
    sizes = [3, 4, 4, 6, 6, 8, 8, 8]
    state: dict[str, Any] = {}
    for i, (before, after) in enumerate(pairwise(sizes)):
        state[f"features.{2 * i}.weight"] = torch.randn(after, before, 3, 3) / before**0.5
        state[f"features.{2 * i}.bias"] = torch.zeros(after)
    torch.save(state, tmp_path / "weights.pth")
    path = str(tmp_path / "weights.pth")
    losses = run("perceptual_loss", cat, str(tmp_path / "a.svg"), path, STEPS, CURVES)
    assert losses[-1] < 0.8 * losses[0]


@pytest.mark.parametrize("name", sorted(path.name for path in EXAMPLES.glob("*.py")))
def test_a_script_without_arguments_prints_its_usage(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "argv", [name])
    with pytest.raises(SystemExit, match=rf"usage: .*{name} "):
        runpy.run_path(str(EXAMPLES / name), run_name="__main__")


def test_all_examples_are_listed() -> None:
    names = {path.name for path in EXAMPLES.iterdir() if path.suffix in {".py", ".ipynb"}}
    listed = (EXAMPLES / "README.md").read_text()
    assert all(f"`{name}`" in listed for name in names)


NOTEBOOKS = pytest.mark.parametrize("path", sorted(ROOT.glob("examples/*.ipynb")), ids=lambda path: path.stem)
MAX_BYTES = 100_000
"""Largest notebook: pictures in a repository's history stay there."""


def from_script(name: str) -> Any:
    return runpy.run_path(str(ROOT / "docs" / "notebooks.py"))[name]


def outputs(notebook: Any) -> list[tuple[str, ...]]:
    """Return the kinds of what each cell shows."""
    return [
        tuple(kind for output in cell.get("outputs", ()) for kind in output.get("data", {"text": ""}))
        for cell in notebook["cells"]
    ]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")  # of Jupyter's parts, about one another
@NOTEBOOKS
def test_notebooks_run_and_match_their_stored_outputs(
    path: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    monkeypatch.setenv("OMP_NUM_THREADS", "1")
    stored = path.read_text("utf-8")
    short = tmp_path / path.name
    short.write_text(stored.replace("range(81)", "range(21)"), "utf-8")
    found = from_script("run")(short)
    assert list(map(set, outputs(found))) == list(map(set, outputs(json.loads(stored))))


@NOTEBOOKS
def test_pages_of_notebooks_have_every_cell(path: Path) -> None:
    assert path.stat().st_size < MAX_BYTES
    cells = json.loads(path.read_text("utf-8"))["cells"]
    page = from_script("page")(path)
    assert page.startswith("# ")
    assert page.count("```python\n") == sum(cell["cell_type"] == "code" for cell in cells)
    for cell in cells:
        assert "".join(cell["source"]) in page
    pictures = [
        kind
        for kinds in outputs({"cells": cells})
        for kind in kinds
        if kind.startswith(("image", "text/html"))
    ]
    assert pictures
    assert page.count("<img ") == len(pictures)
