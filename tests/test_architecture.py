"""What holds the house up, read from the source: who may import whom, how a kernel is written, how it is
launched.
"""

from __future__ import annotations

import ast
import functools
import os
import re
from collections.abc import Iterator
from graphlib import CycleError, TopologicalSorter
from pathlib import Path

import pytest

from tests import ROOT
from tests.needs import needs_missing
from tests.smoke import NAMES
from warpsplat import extensions

CORE = ("errors", "native", "portable", "scene", "forms", "kernels")

ALLOWED: dict[str, tuple[str, ...]] = {
    "extensions": ("errors",),
    "field_docs": (),
    "errors": (),
    "native": (),
    "alpha": (),
    "portable": (),
    "kernels": (),
    "forms": ("kernels", "portable"),
    "scene": ("kernels.constants", "errors", "forms", "portable"),
    "files": ("errors", "native", "portable", "scene", "_version"),
    "svg": ("errors", "forms", "native", "portable", "scene", "files.inputs"),
    "metrics": ("errors", "native", "portable", "svg", "ssimulacra2"),
    "ssimulacra2": (),
    "rendering": CORE,
    "fit": ("alpha", "metrics", "rendering", "svg", *CORE),
    "drawing.trace": ("alpha", "errors", "portable", "scene", "drawing.prices", "svg.primitives"),
    "drawing.strokes": ("errors", "portable", "scene", "drawing.trace"),
    "drawing": ("alpha", "fit", "metrics", "rendering", "svg", *CORE),
    "search": ("alpha", "fit", "metrics", "rendering", "svg", *CORE),
    "run": ("alpha", "drawing", "files", "fit", "metrics", "rendering", "search", "svg", *CORE),
}
"""What each folder or module of the core may import; a name stands for all that is in it."""

ANYTHING = {"", "__main__", "_version", "cli", "configs"}
"""Modules of the core that may import all of it."""

ANYWHERE = {"", "_version", "extensions", "field_docs"}
"""Modules that all others may import."""

EXTENSIONS = extensions.folders()


@functools.cache
def modules() -> dict[str, ast.Module]:
    """The package's modules by name without ``warpsplat.``; the package itself is ``""``."""
    found = {}
    for folder, _, files in os.walk(ROOT / "warpsplat", followlinks=True):
        for path in (Path(folder, file) for file in files if file.endswith(".py")):
            parts = path.relative_to(ROOT / "warpsplat").with_suffix("").parts
            name = ".".join(parts[:-1] if parts[-1] == "__init__" else parts)
            found[name] = ast.parse(path.read_text(encoding="utf-8"))
    return found


def imported(nodes: Iterator[ast.AST]) -> set[str]:
    """Full names of the modules, or of what is in them, that import statements among ``nodes`` name."""
    names: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, "relative imports"
            names |= {f"{node.module}.{alias.name}" for alias in node.names}
    return names


def own(names: set[str]) -> set[str]:
    """The package's modules among ``names``, as in ``modules``."""
    found = set()
    for name in names:
        if name == "warpsplat" or name.startswith("warpsplat."):
            inner = name.removeprefix("warpsplat").removeprefix(".")
            found.add(inner if inner in modules() else inner.rpartition(".")[0])
    return found


def at_import(tree: ast.Module) -> Iterator[ast.AST]:
    """Nodes that run when the module is imported: no functions, and nothing for type checkers only."""
    waiting: list[ast.AST] = list(tree.body)
    while waiting:
        node = waiting.pop()
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef, ast.Lambda)):
            continue
        if isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test):
            continue
        yield node
        waiting += ast.iter_child_nodes(node)


def within(module: str, name: str) -> bool:
    return module == name or module.startswith(f"{name}.")


def extension_of(module: str) -> str | None:
    name = module.partition(".")[0]
    return name if name in EXTENSIONS else None


def test_the_core_imports_no_extension() -> None:
    """The package's ``__init__`` names some for type checkers, and loads them through the registry."""
    for module, tree in modules().items():
        others = own(imported(ast.walk(tree)))
        assert extension_of(module) or not (module and any(map(extension_of, others))), module


def test_only_extensions_that_need_torch_import_it() -> None:
    """It takes seconds."""
    for module, tree in modules().items():
        imports_it = any(within(name, "torch") for name in imported(at_import(tree)))
        assert not imports_it or extension_of(module) in {"torch", "pydiffvg"}, module


def test_extensions_import_only_those_they_declare() -> None:
    for module, tree in modules().items():
        if name := extension_of(module):
            allowed = {name, None, *EXTENSIONS[name].requires, *EXTENSIONS[name].uses}
            assert {*map(extension_of, own(imported(ast.walk(tree))))} <= allowed, module


def test_imports_in_the_core_point_one_way() -> None:
    wrong = []
    for module, tree in modules().items():
        homes = (".".join(module.split(".")[:2]), module.partition(".")[0])
        if extension_of(module) or homes[-1] in ANYTHING:
            continue
        home = next(name for name in homes if name in ALLOWED)
        for other in own(imported(ast.walk(tree))) - ANYWHERE:
            if not any(within(other, name) for name in (home, *ALLOWED[home])):
                wrong.append(f"{module} imports {other}")
    assert not wrong


def test_all_modules_of_the_table_exist() -> None:
    for name, others in ALLOWED.items():
        for module in (name, *others):
            assert module in modules(), module


def test_no_import_circles() -> None:
    """Not even by imports inside functions."""
    graph = {module: own(imported(ast.walk(tree))) - {module} for module, tree in modules().items()}
    try:
        TopologicalSorter(graph).prepare()
    except CycleError as error:
        pytest.fail(" -> ".join(error.args[1]))


# Kernels.

KERNEL_FILES = sorted(
    path
    for folder in (ROOT / "kernels", *(ROOT / "warpsplat").glob("*/kernels"))
    for path in folder.rglob("*.py")
)
IN, OUT = "# In:", "# Out:"
SHAPE = re.compile(r"\[[^\[\]]+\]")


def decorated(decorator: str) -> Iterator[tuple[str, ast.FunctionDef, list[str]]]:
    """Yield kernels or functions: their name, the function, and the lines of its file."""
    for path in KERNEL_FILES:
        text = path.read_text(encoding="utf-8")
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.FunctionDef) and any(
                ast.unparse(each).startswith(decorator) for each in node.decorator_list
            ):
                yield f"{path.relative_to(ROOT).with_suffix('')}.{node.name}", node, text.splitlines()


KERNELS = {name: (node, lines) for name, node, lines in decorated("wp.kernel")}
by_kernel = pytest.mark.parametrize(("kernel", "lines"), KERNELS.values(), ids=KERNELS.keys())


def output_names(kernel: ast.FunctionDef, lines: list[str]) -> set[str]:
    """Return the parameters under Out."""
    (out,) = [row for row in range(kernel.lineno, kernel.body[0].lineno) if lines[row - 1].strip() == OUT]
    return {argument.arg for argument in kernel.args.args if argument.lineno > out}


@by_kernel
def test_signatures(kernel: ast.FunctionDef, lines: list[str]) -> None:
    """``offset`` first, inputs before outputs, the shape at each array."""
    outputs = output_names(kernel, lines)
    assert kernel.args.args[0].arg == "offset"
    assert lines[kernel.args.args[0].lineno - 2].strip() == IN
    assert outputs
    for argument in kernel.args.args:
        assert argument.annotation is not None
        kind = ast.unparse(argument.annotation)
        if "array" in kind:
            end = lines[(argument.end_lineno or 0) - 1]
            assert SHAPE.search(end.partition("#")[2]), f"{argument.arg}: no shape"
        else:
            assert argument.arg not in outputs, f"{argument.arg}: a number cannot be written to"
    assert ast.get_docstring(kernel)


def test_kernels_are_launched_by_name_only() -> None:
    """``Program.launch`` binds parameters by their names; Warp's own launch goes by position."""
    homes = [
        module
        for module, tree in modules().items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and ast.unparse(node.func) in {"wp.launch", "wp.launch_tiled", "warp.launch"}
    ]
    assert homes == ["rendering.program"]


def test_all_smoke_tests_exist() -> None:
    for name in NAMES:
        path, _, test = name.partition("::")
        place = ROOT / path
        if not needs_missing(place):
            assert place.exists(), name
            assert not test or f"\ndef {test.partition('[')[0]}" in place.read_text(encoding="utf-8"), name
