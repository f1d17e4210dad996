"""One run with a progress bar, that Ctrl-C ends with the best so far."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

from warpsplat.api import vectorize
from warpsplat.cli.say import say
from warpsplat.cli.signals import Interrupt
from warpsplat.errors import ExitCode, printable
from warpsplat.files.inputs import input_name
from warpsplat.fit.loop import Progress
from warpsplat.fit.settings import Settings
from warpsplat.jobs.vectorize import Result
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.scene import Kind

PLURALS = {Kind.FILL: "fills", Kind.STROKE: "strokes"}

SUBJECTS = {"photo": "photograph", "drawing": "drawing", "line": "line drawing", "pixel": "picture of cells"}
"""What messages call what an image shows."""

BAR_LENGTH = 1000
"""Of a progress bar: thousandths of the work."""


def _quality(progress: Progress) -> str:
    """The decibels, but only of the finest size: a reduced image has more, and they would seem to fall."""
    return f"{progress.psnr:.2f} dB" if progress.fine else "reduced image"


def time_left(first: Progress, now: Progress) -> int | None:
    """Seconds that the rest takes if work goes on as it did since ``first``; None at the very start."""
    done = now.work - first.work
    return round((now.seconds - first.seconds) / done * (1 - now.work)) if done > 0 else None


@contextlib.contextmanager
def progress_bar(
    source: Path, settings: Settings, *, quiet: bool, verbose: int
) -> Iterator[Callable[[Progress], None]]:
    """A function to report progress to: a bar on stderr where that is a terminal, lines with ``-vv``."""
    if not sys.stderr.isatty() or quiet:

        def tell(progress: Progress) -> None:
            if verbose > 1:
                step = f"step {progress.step}/{progress.steps}"
                say(f"{source}: {step}, {_quality(progress)}, {progress.seconds:.1f} s", err=True)

        yield tell
        return
    bar: Any
    first: Progress | None = None

    def state(progress: Progress | None) -> str | None:
        if progress is None or first is None:
            return None
        seconds = time_left(first, progress)
        left = "" if seconds is None else f"{seconds // 60}:{seconds % 60:02} left, "
        return left + _quality(progress)

    with click.progressbar(
        length=BAR_LENGTH,
        label=printable(source.name),
        file=sys.stderr,
        item_show_func=state,
        show_eta=False,  # it would count the time that kernels took to compile
    ) as bar:

        def show(progress: Progress) -> None:
            nonlocal first
            first = first or progress
            bar.update(round(BAR_LENGTH * progress.work) - bar.pos, progress)

        yield show


def run_file(
    source: Path,
    output: Path,
    settings: Settings,
    *,
    data: bytes,
    device: str,
    threads: int | None,
    importance: Path | None = None,
    verbose: int = 0,
    quiet: bool = False,
) -> Result:
    """``warpsplat.vectorize`` of the bytes ``data`` of ``source``, with a progress bar, until Ctrl-C.

    ``importance``: file of a mask.
    """
    pursued = settings.target_psnr or settings.max_bytes
    start_warp()
    if verbose:
        number = f"{'at most ' if settings.simplify or pursued else ''}{settings.curves}"
        if settings.simplify and pursued:
            number = "no more than needed"
        plural = "fills and strokes" if settings.mixed else PLURALS[settings.kind]
        say(f"{source}: {number} {plural} on {choose_device(device)}", err=True)
    interrupt = Interrupt()
    with interrupt.watching(), progress_bar(source, settings, quiet=quiet, verbose=verbose) as report:
        result = vectorize(
            data,
            settings=settings,
            output=output,
            device=device,
            threads=threads,
            name=input_name(source),
            importance=importance,
            callback=report,
            stop=interrupt,
        )
    count = len(result.scene)
    traced = result.subject != "photo"
    if result.why and not quiet and (traced or verbose):
        other = "; --subject photo fits translucent shapes" if traced else ""
        taken = f"taken for a {SUBJECTS[result.subject]}"
        say(f"warpsplat: {input_name(source)}: {taken}: {result.why}{other}", err=True)
    if not traced and settings.simplify and not pursued and count < settings.curves and not quiet:
        hint = f"a simple image: {count} shapes; --curves N for another number"
        say(f"warpsplat: {input_name(source)}: {hint}", err=True)
    return result


def leave(result: Result) -> None:
    """Name missed goals and end the program with the code for it, if there is one to give."""
    for goal in result.missed:
        say(f"warpsplat: goal missed: {goal}", err=True)
    if result.missed:
        sys.exit(ExitCode.GOAL_MISSED)
