"""The kernels, found by walking the package: a new file is tested without being listed."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path
from types import ModuleType

import warp as wp

import warpsplat


def kernels_of(module: ModuleType) -> list[wp.Kernel]:
    """Those that the module defines."""
    return [
        value
        for value in vars(module).values()
        if isinstance(value, wp.Kernel) and value.module.name == module.__name__
    ]


def kernel_folders() -> list[Path]:
    """Those of the core and of extensions."""
    package = Path(warpsplat.__file__).parent
    return [package / "kernels", *sorted(package.glob("*/kernels"))]


def kernel_modules() -> list[ModuleType]:
    """Modules that define a kernel."""
    package = Path(warpsplat.__file__).parent
    names = [
        module.name
        for folder in kernel_folders()
        for module in pkgutil.walk_packages(
            [str(folder)], ".".join(("warpsplat", *folder.relative_to(package).parts, ""))
        )
    ]
    return [module for module in map(importlib.import_module, sorted(names)) if kernels_of(module)]
