"""Warp's native library, with the test device's functions in place of CUDA's."""

from __future__ import annotations

import atexit
import ctypes
import importlib.abc
import importlib.machinery
import sys
from typing import Any

from tests.fake_cuda.driver import REAL, Driver, Touched
from tests.fake_cuda.rules import lock, report
from tests.fake_cuda.streams import CudaError

CONTEXT_MODULE = "warp._src.context"

_started: list[Driver] = []


def driver() -> Driver:
    """Return the driver of this process, in which Warp has been started."""
    return _started[0]


class Function:
    """A native function, called as ctypes would."""

    def __init__(self, name: str, driver: Driver) -> None:
        self.name, self.driver = name, driver
        self.function = driver.functions.get(name)

    def __call__(self, *arguments: Any) -> Any:
        if self.function is None:
            report(f"{self.name} is unknown to the test device")
            raise NotImplementedError(self.name)
        plain = (each.value if isinstance(each, ctypes._SimpleCData) else each for each in arguments)
        with lock:
            try:
                return self.function(*plain)
            except CudaError as error:
                return self.driver.fail(error, self.name)


class Library:
    """Warp's native library; what has to do with CUDA goes to the driver."""

    def __init__(self, real: Any) -> None:
        self._real, self._driver = real, Driver(real)

    def __getattr__(self, name: str) -> Any:
        cuda = name in self._driver.functions or name.startswith("wp_cuda_") or name.endswith("_device")
        cuda = cuda and name not in REAL
        found = Function(name, self._driver) if cuda else getattr(self._real, name)
        setattr(self, name, found)
        return found


class Kernel:
    """A kernel of the CPU, and how a launch on a GPU passes its arguments."""

    def __init__(self, kernel: Any, hooks: Any) -> None:
        from warp._src import types
        from warp._src.codegen import Struct

        self.key, self.function, self._keep = kernel.key, hooks.forward, hooks
        self.bounds = types._launch_bounds_classes[max(1, kernel.adj.kernel_dim)]
        fields = []
        for argument in kernel.adj.args:
            kind = argument.type
            if types.is_array(kind):
                kind = types.array_t
            elif isinstance(kind, Struct):
                kind = kind.ctype
            elif not issubclass(kind, (ctypes.Array, ctypes.Structure)):
                kind = kind._type_
            fields.append((argument.label, kind))
        self.fields = fields
        self.structure = type("Arguments", (ctypes.Structure,), {"_fields_": fields})

    def arguments(self, parameters: Any) -> tuple[Any, Any, list[Touched]]:
        """Return copies of the bounds and arguments of a launch, and the memory of its arrays."""
        bounds = self.bounds.from_buffer_copy(ctypes.string_at(parameters[0], ctypes.sizeof(self.bounds)))
        arguments = self.structure()
        touched = []
        for index, (name, kind) in enumerate(self.fields, 1):
            to = ctypes.addressof(arguments) + getattr(self.structure, name).offset
            ctypes.memmove(to, parameters[index], ctypes.sizeof(kind))
            value = getattr(arguments, name)
            if kind.__name__ == "array_t" and value.data:
                extents = [(value.shape[axis], value.strides[axis]) for axis in range(value.ndim)]
                size = sum((count - 1) * stride for count, stride in extents) + 4
                touched.append((value.data, size if all(count for count, _ in extents) else 0, name))
        return bounds, arguments, touched


def replace_library(context: Any) -> None:
    """Have Warp's runtime load ``Library``, and note which kernel a handle stands for."""
    load_dll, get_kernel_hooks = context.Runtime.load_dll, context.ModuleExec.get_kernel_hooks

    def load(self: Any, path: str) -> Any:
        library = load_dll(self, path)
        if not path.endswith("warp.so"):
            return library
        replaced = Library(library)
        _started.append(replaced._driver)
        return replaced

    def hooks_of(self: Any, kernel: Any) -> Any:
        hooks = get_kernel_hooks(self, kernel)
        if self.device.is_cuda:
            with lock:
                if hooks.forward not in driver().kernels:
                    cpu = kernel.module.load(context.runtime.cpu_device, 1)
                    driver().kernels[hooks.forward] = Kernel(kernel, get_kernel_hooks(cpu, kernel))
        return hooks

    context.Runtime.load_dll = load
    context.ModuleExec.get_kernel_hooks = hooks_of


class Finder(importlib.abc.MetaPathFinder):
    """Changes Warp's module as it is imported."""

    def find_spec(self, name: str, path: Any, target: Any = None) -> importlib.machinery.ModuleSpec | None:
        if name != CONTEXT_MODULE:
            return None
        sys.meta_path.remove(self)
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        assert spec
        assert spec.loader
        run = spec.loader.exec_module

        def exec_module(module: Any) -> None:
            run(module)
            replace_library(module)

        spec.loader.exec_module = exec_module  # type: ignore[method-assign]
        return spec


def finish() -> None:
    """Do the work that is left, if Warp was started."""
    with lock:
        for machine in [each.machine for each in _started]:
            for number in range(len(machine.legacy)):
                machine.finish_all(number)


def install() -> None:
    """Give this process the devices. Warp must not have been imported yet."""
    assert CONTEXT_MODULE not in sys.modules, "Warp was imported before the test device"
    sys.meta_path.insert(0, Finder())
    atexit.register(finish)
