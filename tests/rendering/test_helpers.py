"""Threads that share launches: those that cannot be had, what they raise, and forks."""

from __future__ import annotations

import os
import threading
import time
from typing import Any

import numpy as np
import pytest
import warp as wp

from tests.scenes import random_scene
from warpsplat.rendering import helpers
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.program import Launch, Program
from warpsplat.rendering.renderer import render
from warpsplat.scene import Kind


def test_without_threads_the_caller_does_all(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = random_scene(Kind.FILL, count=12, width=90, height=70)
    expected = render(scene, backend=Backend.on(device, 1))

    def refuse(*arguments: Any) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    helpers.helpers.cache_clear()
    np.testing.assert_array_equal(render(scene, backend=Backend.on(device, 5)), expected)
    helpers.helpers.cache_clear()


def test_what_a_piece_raises_reaches_the_caller() -> None:
    failing = Program(wp.get_device("cpu"), 2)
    started = threading.Barrier(2, timeout=10)

    def fail() -> None:
        started.wait()
        if threading.current_thread() is not threading.main_thread():
            raise ValueError("no good")

    failing.launches.append(Launch("", "fail", (fail, fail)))
    with pytest.raises(ValueError, match="no good"):
        failing.run()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_process_has_helpers_of_its_own() -> None:
    scene = random_scene(Kind.FILL, count=12, width=90, height=70)
    expected = render(scene, backend=Backend.on("cpu", 2))
    child = os.fork()
    if child == 0:
        same = np.array_equal(render(scene, backend=Backend.on("cpu", 2)), expected)
        os._exit(0 if same else 1)
    deadline = time.monotonic() + 60
    while time.monotonic() < deadline:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            break
        time.sleep(0.05)
    else:
        os.kill(child, 9)
        os.waitpid(child, 0)
        pytest.fail("the child waits for threads that it does not have")
    assert os.waitstatus_to_exitcode(status) == 0
