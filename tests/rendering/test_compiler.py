"""The threads that compile."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from functools import partial

import pytest

from warpsplat.rendering import compiler
from warpsplat.rendering.compiler import compile_later, compiler_finished, wait_for


def compile_now(work: Callable[[], object]) -> None:
    """Have work done by the compiler, and wait for it."""
    wait_for(partial(compile_later, lambda: work() and None))


@pytest.fixture
def cores(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> Iterator[int]:
    """A compiler of its own for a test, with so many cores."""
    monkeypatch.setattr(compiler, "available_cores", lambda: request.param)
    compiler._compiler.cache_clear()
    yield request.param
    compiler._compiler.cache_clear()


@pytest.mark.parametrize("cores", [2], indirect=True)
def test_modules_are_compiled_at_the_same_time(cores: int) -> None:
    both = threading.Barrier(cores, timeout=20)

    def work() -> None:
        both.wait()

    for future in [compile_later(work) for _ in range(cores)]:
        future.result()


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


@pytest.mark.parametrize("cores", [1], indirect=True)
def test_at_the_end_only_what_has_begun_is_finished(cores: int) -> None:
    begun, go_on = threading.Event(), threading.Event()

    def work() -> None:
        begun.set()
        go_on.wait()

    first = compile_later(work)
    second = compile_later(lambda: None)
    begun.wait()
    assert not compiler_finished(0.01)
    assert second.cancelled()
    go_on.set()
    assert compiler_finished()
    assert first.result() is None


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
