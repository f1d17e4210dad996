"""The notebooks of examples/: run them and store what they show, and make pages of them for the site.

``python docs/notebooks.py [NAME ...]`` runs them, by default all (the extra ``test`` has what it takes).
"""

from __future__ import annotations

import base64
import json
import os
import shutil
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

EXAMPLES = Path(__file__).parents[1] / "examples"

SHOWN = ("text/html", "image/svg+xml", "image/png", "text/plain")
"""Kinds of output, the one first that is shown."""


def paths() -> list[Path]:
    """Return the notebooks' files."""
    return sorted(EXAMPLES.glob("*.ipynb"))


def page(path: Path) -> str:
    """Return a notebook as Markdown."""
    cells = json.loads(path.read_text("utf-8"))["cells"]
    return "\n\n".join(part for cell in cells for part in _parts(cell)) + "\n"


def _parts(cell: dict[str, Any]) -> Iterator[str]:
    source = "".join(cell["source"])
    if cell["cell_type"] != "code":
        yield source
        return
    yield f"```python\n{source}\n```"
    printed = "".join("".join(output["text"]) for output in cell["outputs"] if "text" in output)
    if printed:
        yield f"```text\n{printed.rstrip()}\n```"
    for output in cell["outputs"]:
        data = {kind: "".join(value) for kind, value in output.get("data", {}).items()}
        kind = next((kind for kind in SHOWN if kind in data), "")
        if kind == "text/html":
            yield f"<div>{data[kind]}</div>"
        elif kind == "text/plain":
            yield f"```text\n{data[kind]}\n```"
        elif kind:
            is_text = kind == "image/svg+xml"
            code = base64.b64encode(data[kind].encode()).decode() if is_text else data[kind].replace("\n", "")
            yield f'<div><img src="data:{kind};base64,{code}" alt=""></div>'


def run(path: Path) -> Any:
    """Return a notebook as it is after a run, with one kind of each output; files that it writes are lost."""
    import nbclient
    import nbformat

    notebook = nbformat.read(path, 4)
    os.environ.setdefault("OMP_NUM_THREADS", "1")  # small pictures: torch's threads would wait for each other
    with tempfile.TemporaryDirectory() as root:
        picture, folder = Path(root, "docs/images/cat.jpg"), Path(root, "examples")
        picture.parent.mkdir(parents=True)
        folder.mkdir()
        shutil.copy(EXAMPLES.parent / "docs/images/cat.jpg", picture)
        nbclient.NotebookClient(notebook, timeout=300, resources={"metadata": {"path": folder}}).execute()
    for cell in notebook.cells:
        cell.metadata.clear()
        for output in cell.get("outputs", ()):
            if data := output.get("data"):
                kept = next(kind for kind in SHOWN if kind in data)
                output["data"] = {kept: data[kept]}
    return notebook


def main() -> None:
    """Run the notebooks, and store them with what they show."""
    import nbformat

    for path in paths():
        if path.stem in sys.argv[1:] or not sys.argv[1:]:
            nbformat.write(run(path), path)


if __name__ == "__main__":
    main()
