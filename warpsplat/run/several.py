"""Vectorize an image with several numbers of shapes, and do work that does not depend on the number once."""

from __future__ import annotations

import functools
import os
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.errors import UsageError, shown
from warpsplat.files.output import make_folder
from warpsplat.files.remote import path_of
from warpsplat.files.sources import ImageSource
from warpsplat.fit.problem import Run
from warpsplat.fit.progress import Callback
from warpsplat.fit.settings import SUBJECTS, Settings
from warpsplat.run.arguments import backend_on, settings_given, takes
from warpsplat.run.formats import write_named
from warpsplat.run.prepare import PreparedImage, prepare
from warpsplat.run.result import Result
from warpsplat.run.typed import Options
from warpsplat.run.vectorize import make_result
from warpsplat.search.series import Series

if TYPE_CHECKING:
    from typing_extensions import Unpack

OWN_NUMBER = {"line", "pixel", "silhouette"}
"""Subjects whose images decide how many shapes there are."""


def check_several(settings: Settings, numbers: Sequence[int]) -> None:
    """Raise ``UsageError`` unless there can be a run with several numbers of shapes."""
    most_numbers = 16  # most numbers of shapes in one run
    if not 1 <= len(numbers) <= most_numbers:
        raise UsageError(f"curves: from 1 to {most_numbers} numbers, not {len(numbers)}")
    for number in numbers:
        replace(settings, curves=number, levels=())
        if numbers.count(number) > 1:
            raise UsageError(f"curves: {number} is given twice")
    if settings.counting:
        raise UsageError(f"several numbers of shapes and {settings.counting[0]} cannot be combined")


@takes(Options)
def vectorize_several(
    image: ImageSource,
    curves: Sequence[int],
    *,
    settings: Settings | None = None,
    importance: ImageSource | None = None,
    outputs: Sequence[str | os.PathLike[str]] | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    ready: Callable[[Result], None] | None = None,
    name: str | None = None,
    **options: Unpack[Options],
) -> tuple[Result, ...]:
    """Turn an image into SVGs of several numbers of shapes, which share as much work as they can.

    Arguments that differ from those of ``vectorize``:
        curves: numbers of shapes; of a drawing, the most. They are made from few to many.
        outputs: a file for each number, written as soon as it is made; missing folders are made.
        callback: ``Progress.work`` is the share of the work for all numbers.
        ready: called with each result as soon as it is available.

    Returns:
        a result for each number, in the order of ``curves``; if the run was stopped, only of the smallest
        numbers, the last of which may be ``stopped``.

    Raises:
        UsageError: a number that is out of range or given twice; settings that decide the number of shapes,
            as goals and levels do; line art and pixel art, which decide it themselves.
        ImageError, OutputError, ResourceError, TypeError: as for ``vectorize``.
    """
    if not isinstance(curves, Sequence) or isinstance(curves, str):
        raise UsageError(f"curves must be several numbers of shapes, not {shown(curves)}")
    if outputs is not None and len(outputs) != len(curves):
        raise UsageError(f"{len(curves)} numbers of shapes and {len(outputs)} outputs")
    settings = settings_given(vectorize_several, settings, **options)
    check_several(settings, curves)
    with backend_on(device, threads) as backend:
        most = replace(settings, curves=max(curves), simplify=False)
        prepared = prepare(image, most, name=name, importance=importance, backend=backend)
        subject = prepared.problem.settings.subject
        if subject in OWN_NUMBER:
            raise UsageError(
                f"{prepared.name}: the image itself decides how many shapes a {SUBJECTS[subject]} has, so "
                "there is only one file; --subject photo fits shapes"
            )
        paths = {number: path_of(output) for number, output in zip(curves, outputs or (), strict=False)}
        for folder in sorted({path.parent for path in paths.values()}):
            make_folder(folder)
        results = _results(prepared, curves, Run(backend, callback, stop), paths, ready)
    return tuple(results[number] for number in curves if number in results)


def _results(
    image: PreparedImage,
    numbers: Sequence[int],
    run: Run,
    outputs: dict[int, Path],
    ready: Callable[[Result], None] | None,
) -> dict[int, Result]:
    """Return the results by their numbers of shapes; only the smaller ones if the run was stopped."""
    # Fits to drawings that continue others lose half a decibel or more (docs/experiments.md).
    shares = guess_subject(image.problem.target).subject == "photo"
    series = Series(image.problem.settings, numbers, shares=shares)
    results: dict[int, Result] = {}
    dxf = image.problem.settings.dxf
    for number in sorted(numbers):
        write = functools.partial(write_named, outputs[number], dxf=dxf) if number in outputs else None
        most = max(results, default=0)
        drawn = image.problem.settings.subject == "drawing"
        if drawn and most and len(results[most].scene) < most:  # it has all regions already
            result = results[most]
            if write:
                write(result.svg)
        else:
            settings, start = series.next(number)
            problem = replace(image.problem, settings=settings)
            result = make_result(replace(image, problem=problem), series.part(number, run), write, start)
        results[number] = result
        if ready:
            ready(result)
        if result.stopped or run.stopped():
            break
    return results
