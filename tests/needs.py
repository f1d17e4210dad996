"""Which tests need which extension: they are left out where it is not there."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from tests import ROOT
from warpsplat.extensions import extensions

WORDS = {
    "batch": {"batch", "several images"},
    "motion": {"animate", "preview"},
    "pages": {"serve", "report"},
    "paper": {"splat", "gaussian"},
    "pydiffvg": {"pydiffvg"},
    "tools": {"bench", "compare", "doctor", "info"},
    "torch": {"torch", "tensors"},
}
"""Extension -> words that parameters of its tests have, and commands of its."""

MISSING = WORDS.keys() - extensions().keys()
ABSENT_WORDS = {word for name in MISSING for word in WORDS[name]}


def needs_missing(path: Path) -> bool:
    """Return whether a file of tests, or the folder that it is in, is for an extension that is not there."""
    if not MISSING or not path.is_relative_to(ROOT / "tests"):
        return False
    if path.relative_to(ROOT / "tests").parts[0] in MISSING:
        return True
    if path.suffix != ".py":
        return False
    modules = [
        name
        for node in ast.parse(path.read_text("utf-8")).body
        for name in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
            if isinstance(node, ast.Import)
            else []
        )
    ]
    return any(
        module == f"{package}.{name}" or module.startswith(f"{package}.{name}.")
        for module in modules
        for package in ("warpsplat", "tests")
        for name in MISSING
    )


def words_of(value: Any) -> Iterator[str]:
    """Yield the words in a parameter of a test."""
    if isinstance(value, str):
        yield from (word.lstrip("-") for part in value.split() for word in (part, *part.split("=")))
    elif isinstance(value, dict):
        yield from words_of([*value, *value.values()])
    elif isinstance(value, (tuple, list)):
        for one in value:
            yield from words_of(one)
