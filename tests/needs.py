"""Which tests need which extension: they are left out where it is not there."""

from __future__ import annotations

import ast
import functools
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests import ROOT
from warpsplat.extensions import extensions

WORDS = {
    "batch": {"batch", "several images"},
    "compare": {"compare"},
    "inkscape": {"inkscape"},
    "motion": {"animate", "preview"},
    "pages": {"serve", "report"},
    "paper": {"splat", "gaussian"},
    "pydiffvg": {"pydiffvg"},
    "tools": {"bench", "doctor", "info"},
    "torch": {"torch", "tensors"},
}
"""Extension -> words that parameters of its tests have, and commands of its."""

MISSING = WORDS.keys() - extensions().keys()
ABSENT_WORDS = {word for name in MISSING for word in WORDS[name]}

WHOLE = pytest.mark.skipif(bool(MISSING), reason="the documentation is of the whole program")


def needs_missing(path: Path) -> bool:
    """Return whether tests are for an extension that is not there, or import one, maybe through helpers."""
    tests = ROOT / "tests"
    if not MISSING or not path.is_relative_to(tests):
        return False
    return path.relative_to(tests).parts[0] in MISSING or (path.suffix == ".py" and _imports_missing(path))


@functools.cache
def _imports_missing(path: Path) -> bool:
    for name in _imported(path):
        package, _, rest = name.partition(".")
        if package in {"warpsplat", "tests"} and rest.partition(".")[0] in MISSING:
            return True
        helper = ROOT.joinpath(*name.split(".")).with_suffix(".py")
        if package == "tests" and helper.exists() and _imports_missing(helper):
            return True
    return False


def _imported(path: Path) -> Iterator[str]:
    """Yield the modules that a file imports at its top, and the names it imports from modules."""
    for node in ast.parse(path.read_text("utf-8")).body:
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.module:
            yield from (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))


def words_of(value: Any) -> Iterator[str]:
    """Yield the words in a parameter of a test."""
    if isinstance(value, str):
        yield from (word.lstrip("-") for part in value.split() for word in (part, *part.split("=")))
    elif isinstance(value, dict):
        yield from words_of([*value, *value.values()])
    elif isinstance(value, (tuple, list)):
        for one in value:
            yield from words_of(one)
