"""The threads that compile."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from functools import partial

import pytest

from warpsplat.rendering import compiler
from warpsplat.rendering.compiler import compile_later, compiler_finished, wait_for


def compile_now(work: Callable[[], object]) -> None:
    """Have work done by the compiler, and wait for it."""
    wait_for(partial(compile_later, lambda: work() and None))


def test_what_the_compiler_raises_is_raised_where_it_is_waited_for() -> None:
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


def test_at_the_end_only_what_has_begun_is_finished(monkeypatch: pytest.MonkeyPatch) -> None:
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


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_has_a_compiler_of_its_own() -> None:
    compile_now(lambda: None)
    child = os.fork()
    if child == 0:
        made: list[int] = []
        compile_now(lambda: made.append(1))
        os._exit(made != [1])
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
