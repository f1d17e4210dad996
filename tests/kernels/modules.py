"""The kernels, found by walking the package: a new file is tested without being listed."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path
from types import ModuleType

import warp as wp

import warpsplat
from warpsplat import kernels


def kernels_of(module: ModuleType) -> list[wp.Kernel]:
    """Return those that the module defines, by factories too."""
    return [
        value
        for value in vars(module).values()
        if isinstance(value, wp.Kernel) and value.func.__module__ == module.__name__
    ]


def all_kernels() -> list[wp.Kernel]:
    """Return all kernels of the package and of its extensions."""
    names = [m.name for m in pkgutil.walk_packages(kernels.__path__, "warpsplat.kernels.")]
    for folder in sorted(Path(warpsplat.__file__).parent.glob("*/kernels")):
        prefix = f"warpsplat.{folder.parent.name}.kernels."
        names += [m.name for m in pkgutil.walk_packages([str(folder)], prefix)]
    modules = map(importlib.import_module, sorted(names))
    return [kernel for module in modules for kernel in kernels_of(module)]
