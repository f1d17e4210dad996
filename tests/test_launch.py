"""Recorded launches: threads that cannot be had, and steps as graphs."""

from __future__ import annotations

import os
import threading
import time
from typing import Any

import numpy as np
import pytest
import warp as wp

from tests.scenes import random_scene
from warpsplat import launch
from warpsplat.config import make_settings
from warpsplat.launch import Program, capture
from warpsplat.render import render
from warpsplat.train import Trainer, phases


def test_without_threads_the_caller_does_all(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = random_scene("closed", count=12, width=90, height=70)
    expected = render(scene, device=device, threads=1)

    def refuse(*arguments: Any) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    launch._helpers.cache_clear()
    np.testing.assert_array_equal(render(scene, device=device, threads=5), expected)
    launch._helpers.cache_clear()


def test_what_a_piece_raises_reaches_the_caller() -> None:
    program = Program(wp.get_device("cpu"), 2)
    started = threading.Barrier(2, timeout=10)

    def fail() -> None:
        started.wait()
        if threading.current_thread() is not threading.main_thread():
            raise ValueError("no good")

    program.launches.append(launch.Launch("", "fail", (fail, fail)))
    with pytest.raises(ValueError, match="no good"):
        program.run()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_process_has_helpers_of_its_own() -> None:
    scene = random_scene("closed", count=12, width=90, height=70)
    expected = render(scene, device="cpu", threads=2)
    child = os.fork()
    if child == 0:
        same = np.array_equal(render(scene, device="cpu", threads=2), expected)
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


def test_a_captured_step_does_what_its_launches_do(device: str) -> None:
    """On a CPU a step is a graph where one thread is asked for; on a GPU always."""
    target = np.random.default_rng(0).uniform(size=(48, 64, 3)).astype(np.float32)
    settings = make_settings(curves=10, iterations=50)
    scenes = []
    for graph in (True, False):
        trainer = Trainer(target, settings, wp.get_device(device), threads=1)
        trainer.enter(phases(settings, 64, 48)[-1])
        assert trainer.graph is not None
        if not graph:
            trainer.graph = None
        for _ in range(7):
            trainer.advance()
        scenes.append(trainer.scene())
    np.testing.assert_array_equal(scenes[0].points, scenes[1].points)
    np.testing.assert_array_equal(scenes[0].colors, scenes[1].colors)


def test_several_cpu_threads_are_not_given_up_for_a_graph() -> None:
    assert capture(wp.get_device("cpu"), [Program(wp.get_device("cpu"), 2)]) is None
