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
    """Those that the module defines."""
    return [
        value
        for value in vars(module).values()
        if isinstance(value, wp.Kernel) and value.module.name == module.__name__
    ]


def kernel_modules() -> list[ModuleType]:
    """Modules that define a kernel."""
    names = [m.name for m in pkgutil.walk_packages(kernels.__path__, "warpsplat.kernels.")]
    for folder in sorted(Path(warpsplat.__file__).parent.glob("*/kernels")):  # of extensions
        prefix = f"warpsplat.{folder.parent.name}.kernels."
        names += [m.name for m in pkgutil.walk_packages([str(folder)], prefix)]
    names.sort()
    return [module for module in map(importlib.import_module, names) if kernels_of(module)]
