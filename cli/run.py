"""One run with a progress bar, that Ctrl-C ends with the best so far."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import click
import warp as wp

from warpsplat.config import Settings
from warpsplat.pipeline import Result, vectorize_file
from warpsplat.train import Progress


class Interrupt:
    """Turns the first Ctrl-C into a wish to stop; a second one ends the program at once."""

    def __init__(self) -> None:
        self.requested = False

    def __call__(self) -> bool:
        """Whether to stop."""
        return self.requested

    def _handle(self, number: int, frame: Any) -> None:
        if self.requested:
            raise KeyboardInterrupt
        self.requested = True

    @contextlib.contextmanager
    def watching(self) -> Iterator[None]:
        """Catch Ctrl-C in the block."""
        before = signal.signal(signal.SIGINT, self._handle)
        try:
            yield
        finally:
            signal.signal(signal.SIGINT, before)


def run_file(
    source: Path,
    output: Path,
    settings: Settings,
    device: wp.Device,
    *,
    verbose: int = 0,
    quiet: bool = False,
    interrupt: Interrupt | None = None,
) -> Result:
    """``vectorize_file`` with a progress bar on stderr where that is a terminal."""
    interrupt = interrupt or Interrupt()
    show = sys.stderr.isatty() and not quiet
    if verbose:
        click.echo(f"{source}: {settings.curves} {settings.kind} curves on {device}", err=True)
    with contextlib.ExitStack() as stack:
        stack.enter_context(interrupt.watching())
        bar: Any = None
        if show:
            bar = stack.enter_context(
                click.progressbar(
                    length=settings.iterations,
                    label=source.name,
                    file=sys.stderr,
                    item_show_func=lambda p: f"{p.psnr:.2f} dB" if p else None,
                )
            )
        last = 0

        def report(progress: Progress) -> None:
            nonlocal last
            if bar:
                bar.update(progress.step - last, progress)
            last = progress.step
            if verbose > 1 and not bar:
                click.echo(
                    f"{source}: step {progress.step}/{progress.steps}, {progress.psnr:.2f} dB, "
                    f"{progress.seconds:.1f} s",
                    err=True,
                )

        return vectorize_file(source, output, settings, device, report=report, stop=interrupt)
