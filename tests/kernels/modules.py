"""The kernels, found by walking the package: a new file is tested without being listed."""

from __future__ import annotations

import importlib
import pkgutil
from pathlib import Path
from types import ModuleType

import warp as wp

import warpsplat
from warpsplat.kernels import composite, composite_backward


def kernels_of(module: ModuleType) -> list[wp.Kernel]:
    """Return those that the module names, alone or in a list."""
    values = [
        value for found in vars(module).values() for value in (found if isinstance(found, list) else [found])
    ]
    return [value for value in values if isinstance(value, wp.Kernel)]


def kernel_folders() -> list[Path]:
    """Those of the core and of extensions."""
    package = Path(warpsplat.__file__).parent
    return [package / "kernels", *sorted(package.glob("*/kernels"))]


def all_kernels() -> list[wp.Kernel]:
    """Return all kernels of the package and of its extensions."""
    package = Path(warpsplat.__file__).parent
    names = [
        module.name
        for folder in kernel_folders()
        for module in pkgutil.walk_packages(
            [str(folder)], ".".join(("warpsplat", *folder.relative_to(package).parts, ""))
        )
    ]
    modules = map(importlib.import_module, sorted(names))
    made = [
        composite.make_forward(painted=p, straight=s)
        for p, s in ((False, False), (True, False), (True, True))
    ]
    made += [composite_backward.make_backward(painted=painted) for painted in (False, True)]
    return list(dict.fromkeys([kernel for module in modules for kernel in kernels_of(module)] + made))
