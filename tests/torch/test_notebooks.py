"""The notebooks run, and the site shows what they showed when they were last stored."""

from __future__ import annotations

import json
import runpy
from pathlib import Path
from typing import Any

import pytest

from tests import ROOT

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
def test_it_runs_and_shows_what_is_stored(
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
def test_its_page_has_every_cell(path: Path) -> None:
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
