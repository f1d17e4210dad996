"""The kernels, found by walking the package: a new file is tested without being listed."""

from __future__ import annotations

import importlib
import pkgutil
from types import ModuleType

import warp as wp

from warpsplat import kernels


def kernels_of(module: ModuleType) -> list[wp.Kernel]:
    """Those that the module defines."""
    return [
        value
        for value in vars(module).values()
        if isinstance(value, wp.Kernel) and value.module.name == module.__name__
    ]


def kernel_modules() -> list[ModuleType]:
    """Modules that define a kernel."""
    names = sorted(m.name for m in pkgutil.walk_packages(kernels.__path__, "warpsplat.kernels."))
    return [module for module in map(importlib.import_module, names) if kernels_of(module)]
