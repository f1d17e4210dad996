"""Handle Ctrl-C and SIGTERM.

While there is nothing to save, the first signal raises KeyboardInterrupt. Once a run polls ``Interrupt``, the
signal is a request: the run ends by itself, with the best result so far. A second signal ends the process.

Handlers belong to the process, so their state is kept here, once. A signal that was ignored when the program
started (``nohup``, a background job of a shell) stays ignored; SIGHUP is never touched.
"""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Iterator
from typing import Any, ClassVar

SHOW_CURSOR = b"\x1b[?25h"
"""A progress bar hides the cursor and gets no chance to show it again."""


class Interrupt:
    """Tells a run whether to stop; polled between steps as ``stop`` of the library."""

    received: ClassVar[int | None] = None
    """The number of the first signal since ``handled`` began."""
    polled: ClassVar[bool] = False
    """Whether a run polls this, so that the first signal need not raise."""

    def __call__(self) -> bool:
        """Return whether a signal came. After the first call, signals no longer raise."""
        Interrupt.polled = True
        return Interrupt.received is not None

    @contextlib.contextmanager
    def watching(self) -> Iterator[None]:
        """Watch one run: signals no longer raise from its first call to the end of the block."""
        Interrupt.polled = False
        try:
            yield
        finally:
            Interrupt.polled = False


def _handle(number: int, frame: Any) -> None:
    if Interrupt.received is not None:
        _end(number)
    Interrupt.received = number
    if not Interrupt.polled:
        raise KeyboardInterrupt


def _end(number: int) -> None:
    """Exit now: remove unfinished files, do not wait for threads."""
    with contextlib.suppress(OSError):
        os.write(2, (SHOW_CURSOR if os.isatty(2) else b"") + b"\nwarpsplat: interrupted\n")
    _exit(128 + number)


def _exit(code: int) -> None:
    files = sys.modules.get("warpsplat.files.output")
    if files:
        files.remove_unfinished()
    os._exit(code)


def leave_compiler(code: int) -> None:
    """Exit now if kernels are being compiled that take longer: the compiler cannot be stopped."""
    compiler = sys.modules.get("warpsplat.rendering.compiler")
    # Time for modules that are being compiled when the program ends: they are kept, and leave no files [s].
    compiler_time = 2.0
    if compiler and not compiler.compiler_finished(compiler_time):
        with contextlib.suppress(OSError):
            sys.stdout.flush()
        _exit(code)


@contextlib.contextmanager
def handled() -> Iterator[None]:
    """Handle SIGINT and SIGTERM in the block, unless they are ignored or this is not the main thread."""
    Interrupt.received, Interrupt.polled = None, False
    before: dict[int, Any] = {}
    hook = sys.unraisablehook

    def unraisable(found: Any) -> None:
        if not isinstance(found.exc_value, KeyboardInterrupt):  # raised in a destructor
            hook(found)

    sys.unraisablehook = unraisable
    try:
        with contextlib.suppress(ValueError):
            for number in (signal.SIGINT, signal.SIGTERM):
                if signal.getsignal(number) is not signal.SIG_IGN:
                    before[number] = signal.signal(number, _handle)
        yield
    finally:
        for caught, handler in before.items():
            signal.signal(caught, handler)
        sys.unraisablehook = hook
