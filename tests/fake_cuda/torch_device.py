"""PyTorch with its tensors in the test device's memory.

PyTorch without CUDA computes on the CPU. Within ``tensors_on_device`` its tensors say that they are on
``cuda:0``, their memory is the device's for Warp, and each function of PyTorch first waits for what its
current stream was given, and for nothing else.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from typing import Any

import pytest
import torch
import warp as wp
from torch.overrides import TorchFunctionMode

from tests.fake_cuda.install import driver
from tests.fake_cuda.memory import Block
from tests.fake_cuda.streams import Event

DEVICE = torch.device("cuda", 0)

PROPERTIES = {torch.Tensor.device.__get__: DEVICE, torch.Tensor.is_cuda.__get__: True}  # type: ignore[attr-defined]

MOVES = {torch.Tensor.cuda, torch.Tensor.cpu}


class TorchStream:
    """A stream as PyTorch has them; without a handle one of its side streams, which do not block."""

    device = DEVICE

    def __init__(self, handle: int | None = None) -> None:
        found = driver().machine.new_stream(0, blocking=False).handle if handle is None else handle
        self.cuda_stream = found

    def wait_stream(self, other: TorchStream) -> None:
        """Have later work here wait for the work of another stream so far."""
        source = driver().stream(other.cuda_stream)
        driver().machine.let_wait(driver().stream(self.cuda_stream), Event(source, driver().machine.now()))


class OnDevice(TorchFunctionMode):
    """Functions of PyTorch as if tensors were on the device, in the order of a stream."""

    def __init__(self, stream: TorchStream) -> None:
        super().__init__()
        self.stream = stream
        self.kept: list[object] = []

    @contextlib.contextmanager
    def on(self, stream: TorchStream) -> Iterator[None]:
        """Work on another stream meanwhile: ``torch.cuda.stream``."""
        before, self.stream = self.stream, stream
        try:
            yield
        finally:
            self.stream = before

    def __torch_function__(self, function: Any, types: Any, args: Any = (), kwargs: Any = None) -> Any:
        if function in PROPERTIES:
            return PROPERTIES[function]
        if function is torch.device:
            return function(*args, **(kwargs or {}))
        driver().wp_cuda_stream_synchronize(self.stream.cuda_stream)
        if function in MOVES:
            return args[0]
        args = [each for each in args if not isinstance(each, torch.device)]
        result = function(
            *args, **{name: value for name, value in (kwargs or {}).items() if name != "device"}
        )
        return self.address(args[0]) if function is torch.Tensor.data_ptr else result

    def address(self, tensor: torch.Tensor) -> int:
        """Return where the device finds a tensor, whose memory becomes the device's."""
        region = driver().machine.region
        with torch._C.DisableTorchFunction():
            storage = tensor.untyped_storage()
            start, offset = storage.data_ptr(), tensor.data_ptr() - storage.data_ptr()
            if region.holds(start - region.shift):
                return start - region.shift + offset
            if start not in region.blocks:
                region.add(Block(start, storage.nbytes(), 0, 0))
                self.kept.append(storage)
        return start + offset


def to_torch(array: wp.array) -> torch.Tensor:
    """Return a tensor that shares the memory of a dense array."""
    scalar = wp.dtype_to_numpy(getattr(array.dtype, "_wp_scalar_type_", array.dtype))
    shape = (*array.shape, *getattr(array.dtype, "_shape_", ()))
    count = array.capacity // scalar().itemsize
    with torch._C.DisableTorchFunction():
        return torch.from_numpy(driver().machine.region.typed(array.ptr, count, scalar).reshape(shape))


@contextlib.contextmanager
def tensors_on_device(side_stream: bool = False) -> Iterator[None]:
    """Have tensors on the device meanwhile; on a stream that does not block, or the legacy default stream."""
    run_backward = torch.autograd._engine_run_backward  # type: ignore[attr-defined]

    def run_with_mode(*arguments: Any, **named: Any) -> Any:
        with mode:  # which is off while one of PyTorch's functions runs
            return run_backward(*arguments, **named)

    with pytest.MonkeyPatch.context() as patch, OnDevice(TorchStream(None if side_stream else 0)) as mode:
        patch.setattr(torch.cuda, "is_available", lambda: True)
        patch.setattr(torch.cuda, "device_count", lambda: 1)
        patch.setattr(torch.cuda, "current_stream", lambda device=None: mode.stream)
        patch.setattr(torch.cuda, "stream", mode.on)
        patch.setattr(torch.cuda, "Stream", TorchStream)
        patch.setattr(wp, "stream_to_torch", lambda stream: TorchStream(stream.cuda_stream))
        patch.setattr(torch.cuda, "is_current_stream_capturing", lambda: False)
        patch.setattr(torch.autograd, "_engine_run_backward", run_with_mode)
        patch.setattr(wp, "to_torch", to_torch)
        yield
