"""Threads: those that compile, those that share launches, and forks."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import warp as wp

from tests.scenes import random_scene
from warpsplat.rendering import compiler, helpers
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.compiler import compile_later, compiler_finished, wait_for
from warpsplat.rendering.program import Launch, Program
from warpsplat.rendering.renderer import render
from warpsplat.scene import Kind


def compile_now(work: Callable[[], object]) -> None:
    """Have work done by the compiler, and wait for it."""
    wait_for(partial(compile_later, lambda: work() and None))


def test_exceptions_in_builds_reach_the_caller() -> None:
    def fail() -> None:
        raise ValueError("no such kernel")

    with pytest.raises(ValueError, match="no such kernel"):
        compile_now(fail)
    done = threading.Event()
    compile_now(done.set)
    assert done.is_set()


def test_an_interrupted_wait_leaves_the_compiler_at_work(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on, done = threading.Event(), threading.Event()

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    compile_now(done.clear)  # the first time another message is logged
    with monkeypatch.context() as patch:
        patch.setattr(compiler, "MESSAGE_INTERVAL", 0.01)
        patch.setattr(compiler.log, "info", interrupt)
        with pytest.raises(KeyboardInterrupt):
            compile_now(go_on.wait)
    assert not compiler_finished(0.01)
    go_on.set()
    assert compiler_finished()
    compile_now(done.set)
    assert done.is_set()


def test_pending_builds_are_cancelled_at_exit(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a compiler of its own, which has one core."""
    begun, go_on = threading.Event(), threading.Event()

    def work() -> None:
        begun.set()
        go_on.wait()

    monkeypatch.setattr(compiler, "available_cores", lambda: 1)
    compiler._compiler.cache_clear()
    first, second = compile_later(work), compile_later(lambda: None)
    begun.wait()
    assert not compiler_finished(0.01)
    assert second.cancelled()
    go_on.set()
    assert compiler_finished()
    assert first.result() is None
    compiler._compiler.cache_clear()


def test_without_threads_the_caller_does_all(device: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = random_scene(Kind.FILL, count=12, width=90, height=70)
    expected = render(scene, backend=Backend.on(device, 1))

    def refuse(*arguments: Any) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refuse)
    helpers.helpers.cache_clear()
    np.testing.assert_array_equal(render(scene, backend=Backend.on(device, 5)), expected)
    helpers.helpers.cache_clear()


def test_exceptions_in_helper_threads_reach_the_caller() -> None:
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
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_forked_process_has_threads_of_its_own() -> None:
    """A compiler and helpers: it would wait for ever for those that it does not have."""
    scene = random_scene(Kind.FILL, count=12, width=90, height=70)
    expected = render(scene, backend=Backend.on("cpu", 2))
    compile_now(lambda: None)
    child = os.fork()
    if child == 0:
        made: list[int] = []
        compile_now(lambda: made.append(1))
        same = np.array_equal(render(scene, backend=Backend.on("cpu", 2)), expected)
        os._exit(0 if same and made == [1] else 1)
    alarm = threading.Timer(60, os.kill, (child, 9))
    alarm.start()
    status = os.waitpid(child, 0)[1]
    alarm.cancel()
    assert os.waitstatus_to_exitcode(status) == 0
