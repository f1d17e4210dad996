"""Do one task, in whatever process: bytes in, a result and its figures out."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

from warpsplat.batch.executors.tasks import Outcome, Source, Stop, Task
from warpsplat.errors import WarpsplatError, explain, printable
from warpsplat.files.inputs import read_input
from warpsplat.files.output import make_folder
from warpsplat.fit.problem import Run
from warpsplat.fit.progress import Progress
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.rendering.turns import turn
from warpsplat.run.command_line import vectorize_command
from warpsplat.run.formats import named_bytes, write_named
from warpsplat.run.keys import STOPPED, job_key
from warpsplat.run.prepare import load_target, prepare
from warpsplat.run.result import Result
from warpsplat.run.vectorize import make_result
from warpsplat.svg.inspect import svg_text

OnProgress = Callable[[Progress], None]


def do(task: Task, stop: Stop | None = None, on_progress: OnProgress | None = None) -> Outcome:
    """Do ``task``, and return any error in its outcome.

    Args:
        task: what to do.
        stop: asked after every step; once true, the shapes as they are make the file.
        on_progress: called every few steps.

    Raises:
        KeyboardInterrupt: by a signal's handler, with nothing of this image to save.
    """
    key = ""
    try:
        image = read(task.image)
        mask = None if task.mask is None else read(task.mask)
        key = job_key(task.settings, image, mask)
        if task.measure:
            return _measured(task, key, image)
        return _made(task, key, image, stop, on_progress)
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic of Rust code derives from no Exception
        return Outcome(task.number, "failed", key=key, error=failure(error, task.name, task.output))


def failure(error: BaseException, *names: str) -> str:
    """Return one line about an error; it starts with the first of ``names`` if it contains none of them."""
    message, _ = explain(error)
    shown = [printable(name) for name in names]
    return message if any(name in message for name in shown) else f"{shown[0]}: {message}"


def read(source: Source, what: str = "an image") -> bytes:
    """Return the bytes of an image, or of ``what`` it should be.

    Raises:
        ImageError: it cannot be read.
    """
    return source if isinstance(source, bytes) else read_input(Path(source), what)


def _made(task: Task, key: str, image: bytes, stop: Stop | None, on_progress: OnProgress | None) -> Outcome:
    output = Path(task.output)
    start_warp()
    backend = Backend.on(choose_device(task.device), task.threads)
    if not task.bring:
        make_folder(output.parent)
    with turn(backend.device):
        prepared = prepare(image, task.settings, name=task.name, importance=task.mask, keyed=True)
        write = None if task.bring else partial(write_named, output)
        result = make_result(prepared, Run(backend, on_progress, stop), write)
        made = Outcome(task.number, "made")
        if task.report and not result.stopped:
            made = _with_report(task, image, result.svg, result, backend)
    data = named_bytes(output, result.svg, key=STOPPED if result.stopped else key)
    return replace(
        made,
        status="stopped" if result.stopped else "made",
        key=key,
        digest=digest(data),
        data=data if task.bring else None,
        figures=result.as_dict(),
    )


def _measured(task: Task, key: str, image: bytes) -> Outcome:
    data = read(task.result or task.output, "an SVG")
    target = load_target(image, task.name, task.settings.background)
    score = score_svg(svg_text(data, task.output), target, eyes=False)
    made = Outcome(task.number, "measured")
    if task.report:
        figures = task.report.figures or score.as_dict()
        start_warp()
        backend = Backend.on(choose_device(task.device), task.threads)
        with turn(backend.device):
            made = _with_report(task, image, svg_text(data, task.output), figures, backend)
    return replace(made, key=key, digest=digest(data), figures=score.as_dict())


def _with_report(
    task: Task, image: bytes, svg: str, done: Result | Mapping[str, Any], backend: Backend
) -> Outcome:
    """Return an outcome with the page on an SVG, or with the error that prevented the page.

    ``done``: the result of the run just done, or the figures of an earlier one.
    """
    from warpsplat.pages.reports.single import Facts, report_page

    own = isinstance(done, Result)
    outcome = Outcome(task.number, "made" if own else "measured")
    name, svg_name = (os.path.basename(path) for path in (task.name, task.output))
    line = vectorize_command(task.settings, task.name, task.output)
    try:
        made = report_page(
            svg,
            image,
            backend,
            Facts.of(done, line) if isinstance(done, Result) else Facts(done, command=line),
            name=name,
            svg_name=f"{svg_name.rpartition('.')[0]}.svg",
            own=own,
            back=task.report.back if task.report else "",
        )
    except (WarpsplatError, OSError, MemoryError) as error:
        return replace(outcome, report_error=failure(error, task.name, task.output))
    return replace(outcome, report=made)


def digest(data: bytes) -> str:
    """Return the SHA-256 of a result."""
    return hashlib.sha256(data).hexdigest()
