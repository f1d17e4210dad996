"""One run with a progress bar, that Ctrl-C ends with the best so far."""

from __future__ import annotations

import contextlib
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from warpsplat.api import suggest, vectorize, vectorize_several
from warpsplat.cli.motion import Motion
from warpsplat.cli.say import say
from warpsplat.cli.signals import Interrupt
from warpsplat.errors import ExitCode, printable
from warpsplat.files.inputs import input_name
from warpsplat.fit.settings import Settings
from warpsplat.fit.work import Progress, TimeLeft
from warpsplat.jobs.suggest import Suggestion
from warpsplat.jobs.vectorize import Result
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.scene import Kind

PLURALS = {Kind.FILL: "fills", Kind.STROKE: "strokes"}

SUBJECTS = {"photo": "photograph", "drawing": "drawing", "line": "line drawing", "pixel": "picture of cells"}
"""What messages call what an image shows."""

BAR_LENGTH = 1000
"""Of a progress bar: thousandths of the work."""


class Bar:
    """What a bar shows of a run's reports: nothing of it goes back."""

    def __init__(self) -> None:
        self._time = TimeLeft()
        self._best = -math.inf
        self.work = 0.0

    def update(self, progress: Progress, now: float) -> str:
        """Take note of a report, and say what there is to say, at a time ``now`` [s]."""
        self.work = max(self.work, progress.work)  # the share falls where a goal takes more than was thought
        if progress.fine:  # a reduced image has more decibels than the whole one
            self._best = max(self._best, progress.psnr)
        seconds = self._time.update(progress.work, now)
        left = None if seconds is None else round(seconds)
        quality = f"{self._best:.2f} dB" if self._best > -math.inf else "reduced image"
        return (f"{left // 60}:{left % 60:02} left, " if left is not None else "") + quality


@contextlib.contextmanager
def progress_bar(
    source: Path, settings: Settings, *, quiet: bool, verbose: int
) -> Iterator[Callable[[Progress], None]]:
    """A function to report progress to: a bar on stderr where that is a terminal, lines with ``-vv``."""
    if not sys.stderr.isatty() or quiet:

        def tell(progress: Progress) -> None:
            if verbose > 1:
                quality = f"{progress.psnr:.2f} dB" if progress.fine else "reduced image"
                step = f"step {progress.step}/{progress.steps}"
                say(f"{source}: {step}, {quality}, {progress.seconds:.1f} s", err=True)

        yield tell
        return
    bar: Any
    state = Bar()

    with click.progressbar(
        length=BAR_LENGTH,
        label=printable(source.name),
        file=sys.stderr,
        item_show_func=lambda text: text,
        show_eta=False,  # it would count the time that kernels took to compile
    ) as bar:

        def show(progress: Progress) -> None:
            text = state.update(progress, time.monotonic())
            bar.update(round(BAR_LENGTH * state.work) - bar.pos, text)

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
    motion: Motion | None = None,
    **keeping: Any,
) -> Result:
    """``warpsplat.vectorize`` of the bytes ``data`` of ``source``, with a progress bar, until Ctrl-C.

    ``importance``: file of a mask. ``motion``: what shows the run besides. ``keeping``: how its state is
    kept, see there.
    """
    pursued = settings.target_psnr or settings.max_bytes
    start_warp()
    chosen = choose_device(device)  # an unknown one is found before a bar is shown
    if verbose:
        number = f"{'at most ' if settings.simplify or pursued else ''}{settings.curves}"
        if settings.simplify and pursued:
            number = "no more than needed"
        plural = "fills and strokes" if settings.mixed else PLURALS[settings.kind]
        say(f"{source}: {number} {plural} on {chosen}", err=True)
    interrupt, motion = Interrupt(), motion or Motion()
    with interrupt.watching(), progress_bar(source, settings, quiet=quiet, verbose=verbose) as report:
        result = vectorize(
            data,
            settings=settings,
            output=output,
            device=device,
            threads=threads,
            name=input_name(source),
            importance=importance,
            callback=motion.watch(report),
            stop=interrupt,
            **keeping,
        )
        motion.show(result, data)
    if not quiet:
        say_about(source, settings, result, verbose=verbose)
    return result


def run_several(
    source: Path,
    outputs: Sequence[Path],
    numbers: Sequence[int],
    settings: Settings,
    *,
    data: bytes,
    device: str,
    threads: int | None,
    importance: Path | None = None,
    verbose: int = 0,
    quiet: bool = False,
) -> tuple[Result, ...]:
    """``warpsplat.vectorize_several`` of the bytes ``data`` of ``source``, with one bar, until Ctrl-C."""
    start_warp()
    chosen = choose_device(device)
    if verbose:
        say(f"{source}: {', '.join(map(str, numbers))} {PLURALS[settings.kind]} on {chosen}", err=True)
    interrupt = Interrupt()
    with interrupt.watching(), progress_bar(source, settings, quiet=quiet, verbose=verbose) as report:
        return vectorize_several(
            data,
            numbers,
            settings=settings,
            outputs=outputs,
            device=device,
            threads=threads,
            name=input_name(source),
            importance=importance,
            callback=report,
            stop=interrupt,
        )


def suggest_file(
    source: Path,
    settings: Settings,
    *,
    data: bytes,
    device: str,
    threads: int | None,
    importance: Path | None = None,
    verbose: int = 0,
    quiet: bool = False,
) -> Suggestion | None:
    """``warpsplat.suggest`` for the bytes ``data`` of ``source``, with a progress bar, until Ctrl-C."""
    start_warp()
    choose_device(device)
    interrupt = Interrupt()
    with interrupt.watching(), progress_bar(source, settings, quiet=quiet, verbose=verbose) as report:
        return suggest(
            data,
            settings=settings,
            device=device,
            threads=threads,
            name=input_name(source),
            importance=importance,
            callback=report,
            stop=interrupt,
        )


def say_about(source: Path, settings: Settings, result: Result, *, verbose: int) -> None:
    """Say what the image was taken for, and what else happened that one might not expect."""
    pursued = settings.target_psnr or settings.max_bytes
    count = len(result.scene)
    traced = result.subject != "photo"
    if result.why and (traced or verbose):
        other = "; --subject photo fits translucent shapes" if traced else ""
        taken = f"taken for a {SUBJECTS[result.subject]}"
        say(f"warpsplat: {input_name(source)}: {taken}: {result.why}{other}", err=True)
    if not traced and settings.simplify and not pursued and count < settings.curves:
        hint = f"a simple image: {count} shapes; --curves N for another number"
        say(f"warpsplat: {input_name(source)}: {hint}", err=True)
    say_reduced(input_name(source), result)
    say_renewed(input_name(source), result)


def say_reduced(name: str, result: Result) -> None:
    """Say what was done on ``name`` to stay below the limit of memory, if something was."""
    if result.reduced:
        say(f"warpsplat: {name}: {result.reduced}", err=True)


def say_renewed(name: str, result: Result) -> None:
    """Say how many shapes had to be set anew in the training on ``name``, if there were some."""
    if result.renewed:
        found = f"numbers of shapes that are not finite, {result.renewed} times; these began anew"
        say(f"warpsplat: {name}: {found}", err=True)


def leave(result: Result) -> None:
    """Name missed goals and end the program with the code for it, if there is one to give."""
    for goal in result.missed:
        say(f"warpsplat: goal missed: {goal}", err=True)
    if result.missed:
        sys.exit(ExitCode.GOAL_MISSED)
