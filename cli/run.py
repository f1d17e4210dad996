"""Runs on one image, with a progress bar; Ctrl-C ends them with the best result so far."""

from __future__ import annotations

import contextlib
import math
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.hooks import Hooks
from warpsplat.cli.request import Request
from warpsplat.cli.signals import Interrupt
from warpsplat.errors import ExitCode, printable
from warpsplat.files.inputs import input_name
from warpsplat.fit.progress import Progress, TimeLeft
from warpsplat.fit.settings import Settings
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.run.result import Result
from warpsplat.run.several import vectorize_several
from warpsplat.run.suggest import Suggestion, suggest
from warpsplat.run.vectorize import vectorize
from warpsplat.scene import Kind

PLURALS = {Kind.FILL: "fills", Kind.STROKE: "strokes"}

SUBJECTS = {"photo": "photograph", "drawing": "drawing", "line": "line drawing", "pixel": "picture of cells"}
"""Subjects as messages call them."""

BAR_LENGTH = 1000
"""Length of a progress bar: thousandths of the work."""


class Bar:
    """The text beside a progress bar, whose decibels never fall."""

    def __init__(self) -> None:
        self._time = TimeLeft()
        self._best = -math.inf

    def update(self, progress: Progress, now: float) -> str:
        """Return the text for a progress report at a time ``now`` [s]."""
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
    """Yield a callback that shows progress: a bar if stderr is a terminal, else lines with ``-vv``."""
    if not sys.stderr.isatty() or quiet:

        def tell(progress: Progress) -> None:
            if verbose > 1:
                quality = f"{progress.psnr:.2f} dB" if progress.fine else "reduced image"
                step = f"step {progress.step}/{progress.steps}"
                echo(f"{source}: {step}, {quality}, {progress.seconds:.1f} s", err=True)

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
            bar.update(round(BAR_LENGTH * progress.work) - bar.pos, text)

        yield show


@contextlib.contextmanager
def watched(request: Request, settings: Settings) -> Iterator[tuple[Callable[[Progress], None], Interrupt]]:
    """Yield the progress callback of a run on the image of ``request``, and its stop callback, Ctrl-C.

    Raises:
        UsageError: an unknown device is found before a bar is shown.
    """
    start_warp()
    choose_device(request.device)
    interrupt = Interrupt()
    bar = progress_bar(request.image, settings, quiet=request.quiet, verbose=request.verbose)
    with interrupt.watching(), bar as report:
        yield report, interrupt


def run_file(
    request: Request, output: Path, settings: Settings, data: bytes, *, hooks: Hooks, **keeping: Any
) -> Result:
    """Vectorize an image with a progress bar.

    Args:
        request: the image and where to compute.
        output: the file.
        settings: of the run.
        data: bytes of the image.
        hooks: what extensions add to the run.
        keeping: ``checkpoint`` and what goes with it, see ``warpsplat.vectorize``.
    """
    if request.verbose:
        say_start(request, _asked(settings))
    with watched(request, settings) as (report, stop):
        result = vectorize(
            data,
            settings=settings,
            output=output,
            overwrite=request.overwrite,
            callback=hooks.watch(report),
            stop=stop,
            **request.source,
            **keeping,
        )
        hooks.show(result, data)
    if not request.quiet:
        say_about(request.image, settings, result, verbose=request.verbose)
    return result


def run_several(
    request: Request, outputs: Sequence[Path], numbers: Sequence[int], settings: Settings, data: bytes
) -> tuple[Result, ...]:
    """Vectorize an image, whose bytes are ``data``, with several numbers of shapes and one progress bar."""
    if request.verbose:
        say_start(request, f"{', '.join(map(str, numbers))} {PLURALS[settings.kind]}")
    with watched(request, settings) as (report, stop):
        return vectorize_several(
            data, numbers, settings=settings, outputs=outputs, callback=report, stop=stop, **request.source
        )


def suggest_file(request: Request, settings: Settings, data: bytes) -> Suggestion | None:
    """Suggest a number of shapes for the image, whose bytes are ``data``."""
    with watched(request, settings) as (report, stop):
        return suggest(data, settings=settings, callback=report, stop=stop, **request.source)


def _asked(settings: Settings) -> str:
    """Return the number and kind of shapes that are asked for."""
    has_goal = settings.target_psnr or settings.max_bytes
    number = f"{'at most ' if settings.simplify or has_goal else ''}{settings.curves}"
    if settings.simplify and has_goal:
        number = "no more than needed"
    return f"{number} {'fills and strokes' if settings.mixed else PLURALS[settings.kind]}"


def say_start(request: Request, what: str) -> None:
    """Print what is about to be made, and on which device."""
    start_warp()
    echo(f"{request.image}: {what} on {choose_device(request.device)}", err=True)


def say_about(source: Path, settings: Settings, result: Result, *, verbose: int) -> None:
    """Print what the image was taken for, and what else may be unexpected."""
    has_goal = settings.target_psnr or settings.max_bytes
    count = len(result.scene)
    traced = result.subject != "photo"
    if result.why and (traced or verbose):
        other = "; --subject photo fits translucent shapes" if traced else ""
        taken = f"taken for a {SUBJECTS[result.subject]}"
        echo(f"warpsplat: {input_name(source)}: {taken}: {result.why}{other}", err=True)
    if not traced and settings.simplify and not has_goal and count < settings.curves:
        hint = f"a simple image: {count} shapes; --curves N for another number"
        echo(f"warpsplat: {input_name(source)}: {hint}", err=True)
    say_reduced(input_name(source), result)
    say_renewed(input_name(source), result)


def say_reduced(name: str, result: Result) -> None:
    """Print what was done to stay below the limit of memory, if anything."""
    if result.reduced:
        echo(f"warpsplat: {name}: {result.reduced}", err=True)


def say_renewed(name: str, result: Result) -> None:
    """Print how many shapes had to be reset in the training, if any."""
    if result.renewed:
        found = f"shapes had numbers that are not finite, {result.renewed} times; these were reset"
        echo(f"warpsplat: {name}: {found}", err=True)


def leave(result: Result) -> None:
    """Print missed goals, and end the program with the exit code for them, if there are any."""
    for goal in result.missed:
        echo(f"warpsplat: goal missed: {goal}", err=True)
    if result.missed:
        sys.exit(ExitCode.GOAL_MISSED)
