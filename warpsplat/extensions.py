"""Find the extensions: folders of this package that have an ``extension.py``, which declares what they add.

The core imports no extension. What a declaration names ("module:attribute") is imported when it is used.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from warpsplat.errors import UsageError, shown


class Command(NamedTuple):
    """A command of the command line."""

    help: str
    """One line."""
    target: str
    """The click command, as "module:attribute"."""


class Extension(NamedTuple):
    """Everything that a folder adds to the core, by name."""

    commands: Mapping[str, Command] = {}
    renderers: Mapping[str, str] = {}
    """Instances of ``fit.renderers.FitRenderer``, by the name that ``--renderer`` has for them."""
    run_hooks: tuple[str, ...] = ()
    """Classes of ``cli.hooks.RunHook``, which add options to ``vectorize``, ``refine`` and ``eval``."""
    provides: Mapping[str, str] = {}
    """Functions that the core asks for by name."""
    api: Mapping[str, str] = {}
    """Names that ``warpsplat`` offers -> the modules they are in."""
    requires: tuple[str, ...] = ()
    """Extensions without which this one is left out."""
    uses: tuple[str, ...] = ()
    """Extensions that this one imports where it can do without them."""


@functools.cache
def folders() -> dict[str, Extension]:
    """Return the declarations of all folders that have one, in alphabetical order."""
    found: dict[str, Extension] = {}
    for path in sorted(Path(__file__).parent.glob("*/extension.py")):
        # By its path, because the package around it may need what is not installed.
        spec = importlib.util.spec_from_file_location(f"warpsplat.{path.parent.name}.extension", path)
        assert spec
        assert spec.loader
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        found[path.parent.name] = module.EXTENSION
    return found


@functools.cache
def extensions() -> dict[str, Extension]:
    """Return the extensions that can be used: those of ``folders`` whose requirements are there."""
    found = dict(folders())
    while incomplete := [name for name, one in found.items() if not found.keys() >= set(one.requires)]:
        for name in incomplete:
            del found[name]
    return found


def declared(kind: str) -> dict[str, Any]:
    """Return a mapping of ``Extension``, such as "commands", joined over all extensions."""
    return {name: value for one in extensions().values() for name, value in getattr(one, kind).items()}


def load(target: str) -> Any:
    """Import "module:attribute"."""
    module, _, name = target.partition(":")
    return getattr(importlib.import_module(module), name)


def renderer_names() -> tuple[str, ...]:
    """Return the names of all renderers, the core's first."""
    return ("exact", *declared("renderers"))


def load_renderer(name: str) -> Any:
    """Return the ``fit.renderers.FitRenderer`` of a name; raise ``UsageError`` if there is none."""
    if name not in renderer_names():
        raise UsageError(f"renderer must be one of {', '.join(renderer_names())}, not {shown(name)}")
    return load({"exact": "warpsplat.fit.renderers:EXACT", **declared("renderers")}[name])
