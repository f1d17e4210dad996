"""One run with a progress bar, that Ctrl-C ends with the best so far."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click
import warp as wp

from warpsplat.config import Settings
from warpsplat.errors import ExitCode
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


@contextlib.contextmanager
def progress_bar(
    source: Path, settings: Settings, *, quiet: bool, verbose: int
) -> Iterator[Callable[[Progress], None]]:
    """A function to report progress to: a bar on stderr where that is a terminal, lines with ``-vv``."""
    if not sys.stderr.isatty() or quiet:

        def tell(progress: Progress) -> None:
            if verbose > 1:
                click.echo(
                    f"{source}: step {progress.step}/{progress.steps}, {progress.psnr:.2f} dB, "
                    f"{progress.seconds:.1f} s",
                    err=True,
                )

        yield tell
        return
    bar: Any
    with click.progressbar(
        length=settings.iterations,
        label=source.name,
        file=sys.stderr,
        item_show_func=lambda p: f"{p.psnr:.2f} dB" if p else None,
    ) as bar:
        last = 0

        def show(progress: Progress) -> None:
            nonlocal last
            bar.length = progress.steps  # a time budget may change it
            bar.update(progress.step - last, progress)
            last = progress.step

        yield show


def run_file(
    source: Path,
    output: Path,
    settings: Settings,
    device: wp.Device,
    *,
    threads: int | None = None,
    verbose: int = 0,
    quiet: bool = False,
    interrupt: Interrupt | None = None,
) -> Result:
    """``vectorize_file`` with a progress bar."""
    interrupt = interrupt or Interrupt()
    if verbose:
        most = "at most " if settings.simplify or settings.max_bytes else ""
        click.echo(f"{source}: {most}{settings.curves} {settings.kind} curves on {device}", err=True)
    with interrupt.watching(), progress_bar(source, settings, quiet=quiet, verbose=verbose) as report:
        result = vectorize_file(
            source, output, settings, device, threads=threads, report=report, stop=interrupt
        )
    count = len(result.scene)
    if settings.simplify and not settings.max_bytes and count < settings.curves and not quiet:
        click.echo(f"{source}: a simple image: {count} shapes; --curves N for another number", err=True)
    return result


def leave(result: Result) -> None:
    """Name missed goals and end the program with the code for it, if there is one to give."""
    for goal in result.missed:
        click.echo(f"warpsplat: goal missed: {goal}", err=True)
    if result.stopped:
        sys.exit(ExitCode.INTERRUPTED)
    if result.missed:
        sys.exit(ExitCode.GOAL_MISSED)
