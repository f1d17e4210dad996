"""The kernels, found by walking the package: a new file is tested without being listed."""

from __future__ import annotations

import importlib
import inspect
import itertools
import pkgutil
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any, get_args

import warp as wp

import warpsplat
from warpsplat.kernels.tile import quad, tile_column


def kernels_of(module: ModuleType, column: Any) -> Iterator[wp.Kernel]:
    """Yield the kernels that a module names, and those for vectors of type ``column`` that its functions
    make.
    """
    for value in vars(module).values():
        if isinstance(value, wp.Kernel):
            yield value
        elif hasattr(value, "cache_info"):
            parameters = inspect.signature(value).parameters
            if "column" in parameters:
                choices = [choices_of(parameter, column) for parameter in parameters.values()]
                for chosen in itertools.product(*choices):
                    yield value(**dict(zip(parameters, chosen, strict=True)))


def choices_of(parameter: inspect.Parameter, column: Any) -> tuple[Any, ...]:
    """Return the values of a parameter of a function that makes kernels."""
    if parameter.name == "column":
        return (column,)
    return (False, True) if parameter.annotation is bool else get_args(parameter.annotation)


def takes(kernel: wp.Kernel, column: Any) -> bool:
    """Return whether a kernel has no arrays of other vectors of pixels."""
    others = {tile_column, quad} - {column}
    return not any(getattr(argument.type, "dtype", None) in others for argument in kernel.adj.args)


def kernel_folders() -> list[Path]:
    """Those of the core, of extensions, and of forms."""
    package = Path(warpsplat.__file__).parent
    return [package / "kernels", *sorted(package.glob("*/kernels")), package / "forms"]


def all_kernels(column: Any = tile_column) -> list[wp.Kernel]:
    """Return all kernels of the package and of its extensions, for vectors of pixels of type ``column``."""
    package = Path(warpsplat.__file__).parent
    names = [
        module.name
        for folder in kernel_folders()
        for module in pkgutil.walk_packages(
            [str(folder)], ".".join(("warpsplat", *folder.relative_to(package).parts, ""))
        )
    ]
    modules = map(importlib.import_module, sorted(names))
    found = itertools.chain.from_iterable(kernels_of(module, column) for module in modules)
    return list(
        {(kernel.module.name, kernel.key): kernel for kernel in found if takes(kernel, column)}.values()
    )
