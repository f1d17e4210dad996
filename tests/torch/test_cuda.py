"""What torch and Warp share of CUDA, on the test device: there need be no torch that can use it."""

from __future__ import annotations

import pytest
import torch

from tests import fake_cuda
from warpsplat.torch.cuda import can_use

STREAMS = """
import contextlib, torch, warp as wp
from tests.fake_cuda.torch_device import DEVICE, tensors_on_device
from warpsplat.kernels import lanes
from warpsplat.rendering.device import start_warp
from warpsplat.rendering.program import Program
from warpsplat.torch.cuda import shared_stream

start_warp()
device = wp.get_device("cuda:0")


def total(sums, by_lane):
    program = Program(device)
    program.launch(lanes.lane_sums, len(sums), by_lane=by_lane, sums=sums)
    program.run()


def summed(raises=False):
    theirs, usual = torch.cuda.current_stream(), device.stream
    stream = wp.Stream(device, cuda_stream=theirs.cuda_stream)
    source = wp.array([[1.0, 2.0], [3.0, 4.0]], dtype=wp.float32, device=device)
    given, middle, result = (wp.zeros(2, dtype=wp.float32, device=device) for _ in range(3))
    wp.synchronize_device(device)
    with wp.ScopedStream(stream, sync_enter=False):  # what torch does before
        total(given, source)
    with contextlib.suppress(KeyError), shared_stream(DEVICE):
        assert torch.cuda.current_stream().cuda_stream == device.stream.cuda_stream != theirs.cuda_stream
        own = wp.zeros(2, dtype=wp.float32, device=device)
        total(own, given.reshape((2, 1)))
        total(middle, own.reshape((2, 1)))
        own = None  # freed before anything has been done
        total(result, middle.reshape((2, 1)))
        if raises:
            raise KeyError
    assert torch.cuda.current_stream() is theirs and device.stream is usual
    with wp.ScopedStream(stream, sync_enter=False):  # what torch does after
        total(given, result.reshape((2, 1)))
    wp.synchronize_stream(stream)
    print(*given.numpy().tolist())


with tensors_on_device():
    summed()
with tensors_on_device(side_stream=True):
    summed()
    summed(raises=True)
"""
"""Sums handed from torch to Warp and back; none is computed before something waits for it."""


@pytest.mark.slow
def test_work_of_torch_and_warp_is_in_order() -> None:
    """On the legacy default stream and on one that does not wait for it, where Warp frees memory."""
    done = fake_cuda.run("-c", STREAMS)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == ["3.0 7.0"] * 3


def test_a_torch_without_cuda_can_use_the_cpu(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 0)
    assert can_use("cpu")
    assert not can_use("cuda:0")
    monkeypatch.setattr(torch.cuda, "device_count", lambda: 1)
    assert can_use("cuda:0")
    assert not can_use("cuda:1")
