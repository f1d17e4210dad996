"""Count what a reader has to hold: ``python -m tests.counts [FOLDER]`` for this or another checkout."""

from __future__ import annotations

import ast
import os
import sys
from collections import Counter, defaultdict
from collections.abc import Iterator
from pathlib import Path

from tests import ROOT

LONG_LINES, MANY_PARAMETERS = 60, 8


def python_files(root: Path, *folders: str) -> Iterator[Path]:
    """Yield the Python files below ``folders``; links (``warpsplat/cli`` ...) are not followed."""
    for folder in folders:
        for parent, names, files in os.walk(root / folder):
            names[:] = [
                name for name in names if name != "__pycache__" and not Path(parent, name).is_symlink()
            ]
            yield from (Path(parent, name) for name in files if name.endswith(".py"))


def part_of(path: Path, root: Path) -> str:
    """Return the extension that a file belongs to, "tests", or "core"."""
    package, folder = path.relative_to(root).parts[:2]
    is_extension = package == "warpsplat" and (root / package / folder / "extension.py").exists()
    return folder if is_extension else "tests" if package == "tests" else "core"


def count(root: Path) -> dict[str, object]:
    """Return all figures by their names; lines with comments and docstrings."""
    lines: Counter[str] = Counter()
    long = many = modules = 0
    classes: dict[str, set[Path]] = defaultdict(set)
    for path in python_files(root, "warpsplat", "kernels", "cli", "tests"):
        text, part = path.read_text(encoding="utf-8"), part_of(path, root)
        lines[part] += len(text.splitlines())
        if part == "tests":
            continue
        modules += 1
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                classes[node.name].add(path)
            if isinstance(node, (ast.FunctionDef, ast.AsyncFunctionDef)):
                long += (node.end_lineno or 0) - node.lineno >= LONG_LINES
                many += len([*node.args.args, *node.args.kwonlyargs]) > MANY_PARAMETERS
    return {
        **{f"lines, {part}": number for part, number in sorted(lines.items())},
        "lines, all but tests": lines.total() - lines["tests"],
        "modules": modules,
        f"functions above {LONG_LINES} lines": long,
        f"functions above {MANY_PARAMETERS} parameters, with kernels": many,
        "class names with two homes": " ".join(sorted(n for n, homes in classes.items() if len(homes) > 1)),
    }


if __name__ == "__main__":
    for name, value in count(Path(sys.argv[1]).resolve() if len(sys.argv) > 1 else ROOT).items():
        print(f"{name:52} {value}")
