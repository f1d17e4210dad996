"""Count what a reader has to hold: ``python -m tests.counts [FOLDER]`` for this or another checkout."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
from collections import Counter, defaultdict
from collections.abc import Iterable, Iterator
from pathlib import Path

from tests import ROOT

LONG_LINES, MANY_PARAMETERS = 60, 8

PROBE = """
import sys
from warpsplat import vectorize
import numpy as np
image = np.random.default_rng(0).random((32, 32, 3))
vectorize(image, 4, subject="photo", iterations=2, device="cpu")
print(sum(name.split(".")[0] == "warpsplat" for name in sys.modules))
"""

Function = ast.FunctionDef | ast.AsyncFunctionDef


def python_files(root: Path, *folders: str) -> Iterator[Path]:
    """Yield the Python files below ``folders``; links (``warpsplat/cli`` ...) are not followed."""
    for folder in folders:
        for parent, names, files in os.walk(root / folder):
            names[:] = [
                name for name in names if name != "__pycache__" and not Path(parent, name).is_symlink()
            ]
            yield from (Path(parent, name) for name in files if name.endswith(".py"))


def line_count(paths: Iterable[Path]) -> int:
    """Return the number of lines, comments and docstrings included."""
    return sum(len(path.read_text(encoding="utf-8").splitlines()) for path in paths)


def part_of(path: Path, root: Path) -> str:
    """Return the extension that a file belongs to, or "core"; by our extensions in a checkout without any."""
    package, folder = path.relative_to(root).parts[:2]
    declared = [*root.glob("warpsplat/*/extension.py")] or ROOT.glob("warpsplat/*/extension.py")
    return folder if package == "warpsplat" and folder in {one.parent.name for one in declared} else "core"


def parameters(function: Function) -> list[str]:
    """Return the names of all parameters but ``self`` and ``cls``."""
    given = function.args
    names = [a.arg for a in (*given.posonlyargs, *given.args, *given.kwonlyargs)]
    return [name for name in names if name not in {"self", "cls"}]


def is_device_code(function: Function) -> bool:
    """Tell whether Warp compiles the function, or one that it makes."""
    inner = (node for node in ast.walk(function) if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)))
    return any("wp." in ast.unparse(decorator) for node in inner for decorator in node.decorator_list)


def is_option_list(function: Function) -> bool:
    """Tell whether the parameters are a command's options, which click hands over one by one."""
    return any("click" in ast.unparse(d) or "option" in ast.unparse(d) for d in function.decorator_list)


def modules_of_a_photograph(root: Path) -> int:
    """Return how many of our modules a small run on a photograph imports."""
    environment = {**os.environ, "PYTHONPATH": str(root)}
    done = subprocess.run(
        [sys.executable, "-c", PROBE], capture_output=True, text=True, check=True, env=environment, cwd=root
    )
    return int(done.stdout.split()[-1])


def count(root: Path) -> dict[str, object]:
    """Return all figures by their names."""
    product = list(python_files(root, "warpsplat", "kernels", "cli"))
    by_part = defaultdict(list)
    for path in product:
        by_part[part_of(path, root)].append(path)
    pages = [p for p in (root / "warpsplat").rglob("*") if p.suffix in {".js", ".css", ".j2"}]
    trees = {path: ast.parse(path.read_text(encoding="utf-8")) for path in product}
    functions = [
        (path, node)
        for path, tree in trees.items()
        for node in ast.walk(tree)
        if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef))
    ]
    host = [(path, node) for path, node in functions if not is_device_code(node)]
    device = [(path, node) for path, node in functions if is_device_code(node)]
    classes: dict[str, set[Path]] = defaultdict(set)
    docstrings: Counter[str] = Counter()
    for path, tree in trees.items():
        for node in ast.walk(tree):
            if isinstance(node, (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)):
                docstrings[(ast.get_docstring(node) or "").partition(" ")[0]] += 1
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].add(path)
            if isinstance(node, (ast.Module, ast.ClassDef)):  # docstrings of constants and fields
                texts = [
                    n.value.value
                    for n in node.body[1:]
                    if isinstance(n, ast.Expr) and isinstance(n.value, ast.Constant)
                ]
                docstrings.update(str(text).partition(" ")[0] for text in texts)
    lengths = [(node.end_lineno or 0) - node.lineno + 1 for _, node in host]
    constants = sum(
        bool(re.fullmatch(r"[A-Z][A-Z0-9_]*", target.id))
        for tree in trees.values()
        for node in tree.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, (int, float))
    )
    core = line_count(by_part.pop("core"))
    extensions = {name: line_count(paths) for name, paths in sorted(by_part.items())}
    return {
        "lines, core with kernels": core,
        "lines, extensions": f"{sum(extensions.values())} {extensions}",
        "lines, all": core + sum(extensions.values()),
        "lines, pages (JS, CSS, templates)": line_count(pages),
        "lines, tests": line_count(python_files(root, "tests")),
        "modules": len(product),
        "modules that a photograph imports": modules_of_a_photograph(root),
        "functions on the host": len(host),
        f"functions above {LONG_LINES} lines": sum(length > LONG_LINES for length in lengths),
        f"functions above {MANY_PARAMETERS} parameters, host": sum(
            len(parameters(node)) > MANY_PARAMETERS and not is_option_list(node) for _, node in host
        ),
        f"functions above {MANY_PARAMETERS} parameters, device": sum(
            len(parameters(node)) > MANY_PARAMETERS for _, node in device
        ),
        "signatures with stop": sum("stop" in parameters(node) for _, node in host),
        "signatures with report or on_progress": sum(
            bool({"report", "on_progress"} & set(parameters(node))) for _, node in host
        ),
        "class names with two homes": f"{sum(len(homes) > 1 for homes in classes.values())} "
        + " ".join(sorted(name for name, homes in classes.items() if len(homes) > 1)),
        "docstrings that begin with Of": docstrings["Of"],
        "docstrings that begin with What": docstrings["What"],
        "numeric constants of modules": constants,
    }


if __name__ == "__main__":
    for name, value in count(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT).items():
        print(f"{name:52} {value}")
