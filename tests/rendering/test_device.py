"""Devices that cannot be used, and pictures that no memory holds, are refused before any allocation."""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any, cast

import pytest
import warp as wp

import warpsplat
from tests import fake_cuda
from tests.scenes import random_scene
from warpsplat.errors import DeviceError, ResourceError, UsageError
from warpsplat.rendering import backend, cuda, device, memory
from warpsplat.rendering.backend import Viewport
from warpsplat.rendering.device import choose_device, no_gpu, start_warp
from warpsplat.rendering.memory import check_memory
from warpsplat.scene import Kind

CHOOSE = """
import json, logging, sys
from warpsplat.errors import explain
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.tools.doctor import check_devices

start_warp()
heard = []
handler = logging.Handler()
handler.emit = lambda record: heard.append(record.getMessage())
logging.getLogger("warpsplat").addHandler(handler)

def chosen(name):
    try:
        return str(choose_device(name))
    except Exception as error:
        return [*explain(error)]

found = {name: chosen(name) for name in ("auto", "cuda", "cuda:0", "cuda:1", "auto")}
print(json.dumps({**found, "heard": heard, "doctor": check_devices().as_dict()}))
"""


def choices(**options: Any) -> dict[str, Any]:
    """What each name of a device gives, what is logged, and what ``doctor`` says, with such GPUs."""
    done = fake_cuda.run("-c", CHOOSE, **options)
    assert done.returncode == 0 and done.stderr == "", done.stderr
    return dict(json.loads(done.stdout))


@pytest.mark.parametrize(
    ("options", "cause", "remedy"),
    [
        ({"arch": 70}, "its architecture is sm_70, and Warp", "install a build of Warp for CUDA"),
        ({"fail": "context"}, "the driver refuses a context: out of memory", "nvidia-smi lists the programs"),
        ({"driver": 12020}, "the NVIDIA driver is one for CUDA 12.2, and Warp", "update the NVIDIA driver"),
    ],
    ids=["old card", "refused", "old driver"],
)
def test_a_gpu_that_cannot_be_used(options: dict[str, Any], cause: str, remedy: str) -> None:
    """``auto`` says so in one line and takes the CPU, a name is refused, and ``doctor`` says the same."""
    found = choices(**options)
    assert found["auto"] == "cpu"
    (line,) = found["heard"]
    assert line.startswith("the CPU is used; ") and cause in line and remedy in line
    for name in ("cuda", "cuda:0"):
        message, code = found[name]
        assert code == 7 and message.startswith(name[:4]) and "--device cpu" in message
        assert cause in message and remedy in message
    doctor = found["doctor"]
    assert doctor["status"] == "note" and cause in doctor["text"] and remedy in doctor["hint"]


def test_gpus_that_can_be_used() -> None:
    found = choices(devices=2)
    assert [found[name] for name in ("auto", "cuda", "cuda:0", "cuda:1")] == ["cuda:0"] * 3 + ["cuda:1"]
    assert found["heard"] == []
    assert found["doctor"]["status"] == "ok" and found["doctor"]["text"].endswith("default: cuda:0")


def test_hidden_gpus(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CUDA_VISIBLE_DEVICES", "-1")
    found = choices(devices=0)
    assert found["auto"] == "cpu" and found["heard"] == []
    message, code = found["cuda:0"]
    assert code == 2 and "unknown device 'cuda:0'; here there are: cpu" in message
    assert "CUDA_VISIBLE_DEVICES is '-1'" in message and "CUDA_VISIBLE_DEVICES" in found["doctor"]["text"]
    assert found["doctor"]["status"] == "note"


ERROR = "Warp CUDA error"
NO_DRIVER: dict[str, Any] = {
    "driver_version": None,
    **dict.fromkeys(("min_driver_version", "toolkit_version"), (13, 0)),
}


@pytest.mark.parametrize(
    ("enabled", "error", "visible", "cause", "there"),
    [
        (False, "", None, "this build of Warp has no CUDA", False),
        (True, "", "0", "there is no NVIDIA driver", False),
        (True, f"{ERROR} 803: unsupported combination (in function init)", None, "unsupported combi", True),
        (True, f"{ERROR} 100: no CUDA-capable device is detected", "", "is '', which hides all GPUs", False),
        (True, f"{ERROR} 100: no CUDA-capable device is detected", None, "finds no GPU", False),
    ],
)
def test_no_gpu(
    enabled: bool, error: str, visible: str | None, cause: str, there: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Warp knows nothing of a driver where there is none, it does not start, or it is shown no GPU."""
    runtime = SimpleNamespace(**NO_DRIVER, is_cuda_enabled=enabled, get_error_string=lambda: error)
    monkeypatch.setattr(device, "_errors", [])
    for module in (cuda, device):
        monkeypatch.setattr(module, "runtime", lambda: runtime)
    monkeypatch.delenv("CUDA_VISIBLE_DEVICES", raising=False)
    if visible is not None:
        monkeypatch.setenv("CUDA_VISIBLE_DEVICES", visible)
    found = no_gpu()
    assert cause in found.cause and found.there is there
    monkeypatch.setattr("warp.get_cuda_devices", list)
    assert choose_device("auto").is_cpu
    with pytest.raises(DeviceError if there else UsageError, match="cuda:7.*" + cause[:20]):
        choose_device("cuda:7")


def test_a_driver_that_warp_refuses_to_start(monkeypatch: pytest.MonkeyPatch) -> None:
    """Warp prints why, and forgets it."""
    runtime = SimpleNamespace(**NO_DRIVER, is_cuda_enabled=True, get_error_string=lambda: "")
    runtime.core = SimpleNamespace(wp_set_error_output_enabled=lambda _: None)
    for module in (cuda, device):
        monkeypatch.setattr(module, "runtime", lambda: runtime)
    words = "Warp requires CUDA driver 12.0 or higher, but the current driver only supports CUDA 11.4"
    monkeypatch.setattr(device, "_errors", [])
    monkeypatch.setattr("warp.init", lambda: os.write(2, f"Warp CUDA error: {words}\n".encode()))
    start_warp()
    assert no_gpu().cause == words and no_gpu().there
    with pytest.raises(UsageError, match="unknown device 'tpu'; here there are: cpu"):
        choose_device("tpu")


def test_a_message_that_several_processes_send_is_shown_once(caplog: pytest.LogCaptureFixture) -> None:
    log = logging.getLogger(device.__name__)
    for _ in range(2):
        log.handle(log.makeRecord(log.name, logging.WARNING, "", 0, "sent twice", (), None))
    assert [record.message for record in caplog.records] == ["sent twice"]


SCENE = random_scene(Kind.FILL, width=40, height=40)


def by_torch(side: int, count: int) -> object:
    from warpsplat.torch import SceneTensors, render

    return render([SceneTensors.of(SCENE)] * count, side, side)


def by_pydiffvg(side: int) -> object:
    import torch

    from warpsplat import pydiffvg

    path = pydiffvg.Path(
        num_control_points=torch.tensor([0, 0, 0]),
        points=torch.tensor([[1.0, 1.0], [9.0, 1.0], [9.0, 9.0]]),
        is_closed=True,
    )
    group = pydiffvg.ShapeGroup(shape_ids=torch.tensor([0]), fill_color=torch.tensor([1.0, 0.0, 0.0, 1.0]))
    scene = pydiffvg.RenderFunction.serialize_scene(side, side, [path], [group])
    return pydiffvg.RenderFunction.apply(side, side, 2, 2, 0, None, *scene)


WAYS: dict[str, Callable[[int], object]] = {
    "scene": lambda side: warpsplat.render(SCENE, side, device="cpu"),
    "splat": lambda side: warpsplat.render(SCENE, side, side, device="cpu", renderer="splat"),
    "scale": lambda side: warpsplat.render(SCENE, scale=side / 40, device="cpu"),
    "tensors": lambda side: by_torch(side, 1),
    "several tensors": lambda side: by_torch(side, 3),
    "pydiffvg": by_pydiffvg,
}


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("side", [30_000, 200_000])
def test_pictures_too_large_for_memory_are_refused(
    way: str, side: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(memory, "machine_memory", lambda: 8 * 10**9)
    made: list[int] = []
    array = backend.Backend.array

    def counted(self: backend.Backend, dtype: object, *shape: int) -> object:
        made.extend(shape)
        return array(self, dtype, *shape)

    monkeypatch.setattr(backend.Backend, "array", counted)
    with pytest.raises(ResourceError, match=rf"of {side}x{side} px would take about .* 7\.2 GB; draw it"):
        WAYS[way](side)
    assert max(made, default=0) < 10**6


def test_memory_is_not_queried_for_small_pictures(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(memory, "machine_memory", lambda: pytest.fail("asked"))
    assert warpsplat.render(SCENE, 80, device="cpu").shape == (80, 80, 4)


def test_absurd_sizes_are_refused() -> None:
    for way in ("scene", "tensors"):
        with pytest.raises(UsageError, match=r"width must be a (whole )?number"):
            WAYS[way](10**400)
    with pytest.raises(ResourceError, match="GB"):
        warpsplat.render(SCENE, scale=1e300, device="cpu")


def test_free_memory_counts_on_a_gpu() -> None:
    """Others may have taken the rest."""
    gpu = cast(wp.Device, SimpleNamespace(is_cpu=False, free_memory=10**9, total_memory=10**11))
    check_memory(Viewport(4000, 4000), gpu)
    with pytest.raises(ResourceError, match=r"a picture of 5000x5000 px would take about 1\.2 GB, .* 900 MB"):
        check_memory(Viewport(5000, 5000), gpu)
