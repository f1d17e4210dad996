"""The thread that compiles."""

from __future__ import annotations

import os
import threading

import pytest

from warpsplat.rendering import compiler
from warpsplat.rendering.compiler import compile_by, compiling


def test_all_modules_are_compiled_by_one_thread() -> None:
    """As Warp precompiles its headers in each."""
    threads: list[threading.Thread] = []
    for _ in range(2):
        compile_by(lambda: threads.append(threading.current_thread()))
    assert threads[0] is threads[1] is not threading.current_thread()


def test_what_the_compiler_raises_is_raised_where_it_is_waited_for() -> None:
    def fail() -> None:
        raise ValueError("no such kernel")

    with pytest.raises(ValueError, match="no such kernel"):
        compile_by(fail)
    done = threading.Event()
    compile_by(done.set)
    assert done.is_set()


def test_an_interrupted_wait_leaves_the_compiler_at_work(monkeypatch: pytest.MonkeyPatch) -> None:
    go_on, done = threading.Event(), threading.Event()

    def interrupt(*_: object, **__: object) -> None:
        raise KeyboardInterrupt

    compile_by(done.clear)  # the first time another message is logged
    assert not compiling()
    with monkeypatch.context() as patch:
        patch.setattr(compiler, "MESSAGE_INTERVAL", 0.01)
        patch.setattr(compiler.log, "info", interrupt)
        with pytest.raises(KeyboardInterrupt):
            compile_by(go_on.wait)
    assert compiling()
    go_on.set()
    compile_by(done.set)
    assert done.is_set()
    assert not compiling()


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no forks")
@pytest.mark.filterwarnings("ignore:.*fork.*:DeprecationWarning")
def test_a_fork_has_a_compiler_of_its_own() -> None:
    compile_by(lambda: None)
    child = os.fork()
    if child == 0:
        made: list[int] = []
        compile_by(lambda: made.append(1))
        os._exit(made != [1])
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0
