"""One image in several numbers of shapes, in one run: what does not depend on the number is done once."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path

from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.errors import UsageError
from warpsplat.files.output import make_folder
from warpsplat.files.sources import ImageSource
from warpsplat.fit.settings import Settings
from warpsplat.fit.work import Report
from warpsplat.rendering.backend import Backend
from warpsplat.run.formats import write_named
from warpsplat.run.prepare import Prepared, prepare
from warpsplat.run.result import Result
from warpsplat.run.vectorize import make
from warpsplat.scene import FloatArray
from warpsplat.search.several import Series

MOST_NUMBERS = 16
"""Of shapes, in one run."""


def check_several(settings: Settings, numbers: Sequence[int]) -> None:
    """Find out before the work whether there can be a run with several numbers of shapes.

    Raises:
        UsageError: a number is given twice or out of range, or other settings say how many shapes there are.
    """
    if not 1 <= len(numbers) <= MOST_NUMBERS:
        raise UsageError(f"curves: from 1 to {MOST_NUMBERS} numbers, not {len(numbers)}")
    for number in numbers:
        replace(settings, curves=number, levels=())
        if numbers.count(number) > 1:
            raise UsageError(f"curves: {number} is there twice")
    if settings.counting:
        raise UsageError(f"several numbers of shapes and {settings.counting[0]} do not go together")


def vectorize_several(
    source: ImageSource,
    numbers: Sequence[int],
    settings: Settings,
    backend: Backend,
    *,
    outputs: Sequence[Path] | None = None,
    name: str | None = None,
    importance: ImageSource | None = None,
    report: Report | None = None,
    stop: Callable[[], bool] | None = None,
    ready: Callable[[Result], None] | None = None,
) -> tuple[Result, ...]:
    """Vectorize an image once with each of several numbers of shapes, from few to many.

    Args:
        source: the image.
        numbers: of shapes; of a drawing, the most.
        settings: all else that decides the results.
        backend: where to compute.
        outputs: a file for each number, each written as soon as it is made, see ``vectorize_image``; folders
            that are missing are made once nothing is left to refuse.
        name: how messages call the image.
        importance: a mask.
        report: called every few steps; ``work`` is the share of all that is to be done.
        stop: asked after every step; once true, the shapes as they are make the file of the number that it
            was about, and no other is begun.
        ready: called with each result, once it is measured.

    Returns:
        the results, as the numbers were given; fewer where it was stopped.

    Raises:
        UsageError: see ``check_several``; or the image shows what has a number of shapes of its own.
        ImageError, OutputError, ResourceError: see ``vectorize_image``.
    """
    check_several(settings, numbers)
    settings = replace(settings, simplify=False)
    work = prepare(source, replace(settings, curves=max(numbers)), name=name, importance=importance)
    subject = work.settings.subject
    if subject in OWN_NUMBER:
        raise UsageError(
            f"{work.name}: a {OWN_NUMBER[subject]} has a number of shapes of its own: one file is all there "
            "is of it; --subject photo fits shapes"
        )
    for folder in sorted({path.parent for path in outputs or ()}):
        make_folder(folder)
    series = Series(work.settings, numbers, *work.size, backend, shares=can_share(work.target))
    results: dict[int, Result] = {}
    for number in sorted(numbers):
        output = outputs[numbers.index(number)] if outputs else None
        result = _made(work, series, number, results, backend, output, report, stop)
        results[number] = result
        if ready:
            ready(result)
        if result.stopped or (stop and stop()):
            break
    return tuple(results[number] for number in numbers if number in results)


OWN_NUMBER = {"line": "line drawing", "pixel": "picture of cells"}
"""Subjects whose pictures say how many shapes there are, as messages call them."""


def can_share(image: FloatArray) -> bool:
    """Whether fits to ``image`` lose nothing where they go on from fits with fewer shapes.

    Those to drawings lose half a decibel and more, from wherever in their schedule (docs/experiments.md).
    """
    return guess_subject(image).subject == "photo"


def _made(
    work: Prepared,
    series: Series,
    number: int,
    earlier: dict[int, Result],
    backend: Backend,
    output: Path | None,
    report: Report | None,
    stop: Callable[[], bool] | None,
) -> Result:
    """The result with ``number`` shapes, after those with fewer."""
    if work.settings.subject == "drawing" and earlier:
        most, last = max(earlier.items())
        if len(last.scene) < most:  # there are no more regions
            if output is not None:
                write_named(output, last.svg)
            return last
    settings, start = series.next(number)
    return make(
        replace(work, settings=settings),
        backend,
        start=start,
        output=output,
        report=series.watch(number, report),
        stop=stop,
    )
