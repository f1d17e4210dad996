"""Adding a paint: few kernels know paints, and only by the functions of ``kernels.paint.flat``."""

from __future__ import annotations

import ast

from tests import ROOT

ASKED = {
    "bins.py": {"shape_paint"},
    "composite.py": {"paint_times"},
    "composite_backward.py": {"paint_against"},
    "composite_opaque.py": {"paint_against"},
}


def asked_of_paints(source: str) -> set[str]:
    """Return the names imported from ``kernels.paint``."""
    return {
        alias.name
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("warpsplat.kernels.paint")
        for alias in node.names
    }


def test_compositing_and_lists_ask_paints_few_questions() -> None:
    folder = ROOT / "kernels"
    asking = {
        path.relative_to(folder).as_posix(): asked_of_paints(path.read_text("utf-8"))
        for path in folder.rglob("*.py")
        if path.parent.name != "paint"
    }
    assert {name: asked for name, asked in asking.items() if asked} == ASKED
