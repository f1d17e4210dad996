"""Runs on one image, with a progress bar; Ctrl-C ends them with the best result so far."""

from __future__ import annotations

import contextlib
import json
import math
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.hooks import Done, Hooks
from warpsplat.cli.options import Request
from warpsplat.cli.signals import Interrupt
from warpsplat.errors import ExitCode, counted, printable
from warpsplat.extensions import load_renderer
from warpsplat.files.inputs import input_name
from warpsplat.fit.progress import Progress, TimeLeft
from warpsplat.fit.settings import SUBJECTS, Settings
from warpsplat.run.arguments import ALWAYS_THERE
from warpsplat.run.result import Result
from warpsplat.scene import Kind

PLURALS = {Kind.FILL: "fills", Kind.STROKE: "strokes"}


class Bar:
    """The text beside the progress bar; the PSNR it shows never decreases."""

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
def progress_bar(source: Path, *, quiet: bool, verbose: int) -> Iterator[Callable[[Progress], None]]:
    """Yield a callback that shows progress: a bar if stderr is a terminal, else lines with ``-vv``."""
    if not sys.stderr.isatty() or quiet:

        def echo_step(progress: Progress) -> None:
            if verbose > 1:
                quality = f"{progress.psnr:.2f} dB" if progress.fine else "reduced image"
                step = f"step {progress.step}/{progress.steps}"
                echo(f"{source}: {step}, {quality}, {progress.seconds:.1f} s", err=True)

        yield echo_step
        return
    bar_length = 1000  # units of the progress bar, each a thousandth of the work
    bar: Any = click.progressbar(
        length=bar_length,
        label=printable(source.name),
        file=sys.stderr,
        item_show_func=lambda text: text,
        show_eta=False,  # it would count the time that kernels took to compile
    )
    state = Bar()

    def show(progress: Progress) -> None:
        text = state.update(progress, time.monotonic())
        bar.update(round(bar_length * progress.work) - bar.pos, text)

    with bar:
        yield show


@contextlib.contextmanager
def watched(
    request: Request, source: Path, shapes: str = ""
) -> Iterator[tuple[Callable[[Progress], None], Interrupt]]:
    """Yield the progress callback of a run on the file ``source``, and its stop callback, Ctrl-C.

    With ``-v``, print first which ``shapes`` are about to be made, if given, and on which device. An unknown
    device raises ``UsageError`` before a bar is shown.
    """
    told = shapes and request.verbose
    if told or request.device not in ALWAYS_THERE:
        from warpsplat.rendering.device import choose_device, start_warp

        start_warp()
        device = choose_device(request.device)
        if told:
            echo(f"{source}: {shapes} on {device}", err=True)
    interrupt = Interrupt()
    bar = progress_bar(source, quiet=request.quiet, verbose=request.verbose)
    with interrupt.watching(), bar as on_progress:
        yield on_progress, interrupt


def requested(settings: Settings) -> str:
    """Return the number and kind of shapes that are asked for."""
    has_goal = settings.target_psnr or settings.max_bytes
    number = f"{'at most ' if settings.simplify or has_goal else ''}{settings.curves}"
    if settings.simplify and has_goal:
        number = "no more than needed"
    kind = "fills and strokes" if settings.mixed else PLURALS[settings.kind]
    return f"{number} {kind.removesuffix('s') if number == '1' else kind}"


def echo_notes(source: Path, settings: Settings, result: Result, *, verbose: int) -> None:
    """Print what the image was taken for, and what else may be unexpected."""
    name, count, traced = input_name(source), len(result.scene), result.subject != "photo"
    if result.why and (traced or verbose):
        other = "; use --subject photo to fit translucent shapes instead" if traced else ""
        echo(f"warpsplat: {name}: taken for a {SUBJECTS[result.subject]}: {result.why}{other}", err=True)
    has_goal = settings.target_psnr or settings.max_bytes
    if not traced and settings.simplify and not has_goal and count < settings.curves:
        hint = f"a simple image: {counted(count, 'shape')}; --curves N for another number"
        echo(f"warpsplat: {name}: {hint}", err=True)
    echo_remarks(name, result)


def echo_unused_dxf(dxf: str | None, output: Path) -> None:
    """Print that ``--dxf``, if it is given, has no effect on files of other formats."""
    if dxf is not None and output.suffix.lower() != ".dxf":
        echo(f"warpsplat: {output}: --dxf {dxf} has no effect; give -o FILE.dxf", err=True)


def echo_remarks(name: str, result: Result) -> None:
    """Print the notes of a run, what was kept, how the image was reduced, and whether shapes were reset."""
    reset = f"shapes with numbers that are not finite were reset, {counted(result.renewed, 'time')}"
    notes = (
        *result.notes,
        result.kept and f"kept as it is: {result.kept}",
        result.reduced,
        result.renewed and reset,
    )
    for note in filter(None, notes):
        echo(f"warpsplat: {name}: {note}", err=True)


def finish(done: Done, hooks: Hooks, values: dict[str, Any], *, note: str = "", aside: bool) -> None:
    """Print the figures ``values`` of a file, on stderr if ``aside``, and missed goals; have hooks finish.

    Ends the program with the exit code for missed goals, if there are any.
    """
    ((output, result),) = done.made
    assert isinstance(result, Result)
    if done.request.as_json:
        echo(json.dumps({**values, **hooks.as_dict()}), err=aside)
    elif not done.request.quiet:
        echo(summary(output, values) + note, err=aside)
    hooks.finish(done)
    for goal in result.missed:
        echo(f"warpsplat: goal missed: {goal}", err=True)
    if result.missed:
        sys.exit(ExitCode.GOAL_MISSED)


def summary(output: Path, values: dict[str, Any]) -> str:
    """Return one line about a result."""
    from warpsplat.run.formats import PICTURE_ENDINGS

    name = "standard output" if str(output) == "-" else printable(str(output))
    note = f", stopped after {counted(values['iterations'], 'iteration')}" if values["stopped"] else ""
    picture = " as an SVG" if output.suffix.lower() in PICTURE_ENDINGS else ""
    if values["paths"] is None:
        size = f"{values['bytes'] / 1000:.1f} kB{picture}"
        return f"{name}: figures not measured, {size}, {values['seconds']:.1f} s{note}"
    similar = "".join(
        f", {name} {values[key]:.{digits}f}"
        for name, key, digits in (
            ("SSIM", "ssim", 3),
            ("MS-SSIM", "ms_ssim", 3),
            ("SSIMULACRA2", "ssimulacra2", 1),
        )
        if values[key] is not None
    )
    psnr = decibels(values["psnr"])
    if load_renderer(values["renderer"]).soft:
        psnr = f"the soft render {values['render_psnr']:.2f} dB, the file {psnr}"
    levels = ", ".join(
        f"{counted(each['shapes'], 'shape')} {decibels(each['psnr'])}" for each in values["levels"][:-1]
    )
    note += f"; the first {levels}" if levels else ""
    return (
        f"{name}: {psnr}{similar}, {counted(values['paths'], 'path')}, {counted(values['nodes'], 'node')}, "
        f"{values['bytes'] / 1000:.1f} kB ({values['gzip_bytes'] / 1000:.1f} kB gzipped){picture}, "
        f"{values['seconds']:.1f} s{note}"
    )


def decibels(psnr: float | None) -> str:
    """Return a PSNR of ``Result.as_dict`` as text."""
    return "exact" if psnr is None else f"{psnr:.2f} dB"
