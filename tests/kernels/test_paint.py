"""What a further paint takes: compositing knows a paint by few questions, asked by name."""

from __future__ import annotations

import ast

from tests import ROOT

QUESTIONS = {"paint_times", "paint_against"}
OPACITY = 3
"""Of a list's entry."""


def parsed(name: str) -> ast.Module:
    return ast.parse((ROOT / "kernels" / name).read_text("utf-8"))


def asked_of_paints(tree: ast.Module) -> set[str]:
    """Names imported from ``kernels.paint``."""
    return {
        alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("warpsplat.kernels.paint")
        for alias in node.names
    }


def uses(tree: ast.Module, name: str) -> list[str]:
    """How a variable is used: the function that it is given to, or the expression around it."""
    found = []
    for node in ast.walk(tree):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.Name) and child.id == name and isinstance(child.ctx, ast.Load):
                found.append(ast.unparse(node.func if isinstance(node, ast.Call) else node))
    return found


def test_compositing_asks_two_questions_and_the_opacity() -> None:
    tree = parsed("composite.py")
    assert asked_of_paints(tree) == QUESTIONS
    assert set(uses(tree, "paint")) == QUESTIONS | {f"paint[{OPACITY}]"}
    assert set(uses(tree, "list_paint")) == {"list_paint[k]"}
    taken = [
        ast.unparse(node.targets[0])
        for node in ast.walk(tree)
        if isinstance(node, ast.Assign) and ast.unparse(node.value) == "list_paint[k]"
    ]
    assert taken == len(uses(tree, "list_paint")) * ["paint"]


def test_lists_ask_for_an_entry_and_the_opacity() -> None:
    """What is hidden depends on the opacity alone."""
    tree = parsed("bins.py")
    assert asked_of_paints(tree) == {"shape_paint"}
    assert uses(tree, "colors") == ["shape_paint"]
    assert set(uses(tree, "opacities")) == {"shape_paint", "opacities[shape]"}


def test_no_other_kernel_knows_a_paint() -> None:
    asking = {
        path.relative_to(ROOT / "kernels").as_posix()
        for path in (ROOT / "kernels").rglob("*.py")
        if path.parent.name != "paint" and asked_of_paints(ast.parse(path.read_text("utf-8")))
    }
    compositing = {"composite.py", "composite_paint.py", "composite_opaque.py", "composite_straight.py"}
    assert asking == compositing | {"bins.py"}
