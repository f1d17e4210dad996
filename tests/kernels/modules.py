"""The kernels, found by walking the package: a new file is tested without being listed."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType

import warp as wp

from warpsplat import kernels


def kernels_of(module: ModuleType) -> list[wp.Kernel]:
    """Return those that the module defines, by factories too."""
    return [
        value
        for value in vars(module).values()
        if isinstance(value, wp.Kernel) and value.func.__module__ == module.__name__
    ]


def all_kernels() -> list[wp.Kernel]:
    """Return all kernels of the package."""
    names = sorted(m.name for m in pkgutil.walk_packages(kernels.__path__, "warpsplat.kernels."))
    return [kernel for module in map(importlib.import_module, names) for kernel in kernels_of(module)]
