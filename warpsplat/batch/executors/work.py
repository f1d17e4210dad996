"""Do one task: vectorize an image, or measure a result."""

from __future__ import annotations

import io
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from warpsplat.batch.executors.tasks import OnProgress, Outcome, Stop, Task
from warpsplat.errors import DeviceError, WarpsplatError, explain, printable
from warpsplat.fit.problem import Run
from warpsplat.fit.progress import Progress
from warpsplat.metrics import score_svg
from warpsplat.run.arguments import backend_on
from warpsplat.run.command_line import vectorize_command
from warpsplat.run.formats import named_bytes
from warpsplat.run.prepare import load_target, prepare
from warpsplat.run.result import STOPPED, Result
from warpsplat.run.vectorize import make_result
from warpsplat.svg.inspect import svg_text

if TYPE_CHECKING:
    from warpsplat.rendering.backend import Backend


def do(task: Task, stop: Stop, on_progress: OnProgress) -> Outcome:
    """Do ``task``, and return any error in its outcome; ``stop`` and ``on_progress`` are called during it.

    Raises ``KeyboardInterrupt``, by a signal's handler, with nothing of this image to save.
    """
    try:
        return _made(task, stop, on_progress) if task.result is None else _measured(task, task.result)
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic of Rust code derives from no Exception
        words, saved = failure(error, task.name, task.output), getattr(error, "result", None)
        data = _file(task, saved.svg, STOPPED) if saved else None
        spent = isinstance(error, DeviceError) and error.is_lost
        return Outcome(task.number, "failed", key=task.key, data=data, error=words, spent=spent)


def failure(error: BaseException, *names: str) -> str:
    """Return one line about an error, preceded by the first of ``names`` if it contains none of them."""
    message, _ = explain(error)
    shown = [printable(name) for name in names]
    return message if any(name in message for name in shown) else f"{shown[0]}: {message}"


def _made(task: Task, stop: Stop, on_progress: OnProgress) -> Outcome:
    """Vectorize an image."""

    def advance(progress: Progress) -> None:
        on_progress(task.number, progress.work)

    mask = None
    if task.mask is not None:
        mask = io.BytesIO(task.mask)
        mask.name = task.mask_name
    with backend_on(task.device, task.threads) as backend:
        prepared = prepare(
            task.image, task.settings, name=task.name, importance=mask, keyed=True, backend=backend
        )
        result = make_result(prepared, Run(backend, advance, stop))
        data = _file(task, result.svg, STOPPED if result.stopped else task.key)
        status: Literal["stopped", "made"] = "stopped" if result.stopped else "made"
        outcome = Outcome(task.number, status, task.key, data, result.as_dict())
        return outcome if result.stopped else _with_report(outcome, task, result.svg, backend, result)


def _file(task: Task, svg: str, key: str) -> bytes:
    """Return the bytes of a task's result."""
    return named_bytes(Path(task.output), svg, key=key, dxf=task.settings.dxf)


def _measured(task: Task, data: bytes) -> Outcome:
    """Measure a result that exists."""
    svg = svg_text(data, task.output)
    score = score_svg(svg, load_target(task.image, task.name, task.settings.background), perceptual=False)
    outcome = Outcome(task.number, "measured", task.key, data, score.as_dict())
    if not task.report_back:
        return outcome
    with backend_on(task.device, task.threads) as backend:
        return _with_report(outcome, task, svg, backend)


def _with_report(
    outcome: Outcome, task: Task, svg: str, backend: Callable[[], Backend], result: Result | None = None
) -> Outcome:
    """Return an outcome with the page on its SVG if one is requested, or with the error that prevented it.

    ``result``: the result of the run just done; None: it was made earlier.
    """
    if not task.report_back:
        return outcome
    from warpsplat.pages.reports.single import Facts, report_page

    line = vectorize_command(task.settings, task.name, task.output)
    figures = task.figures or outcome.figures
    try:
        page = report_page(
            svg,
            task.image,
            backend(),
            Facts.of(result, line) if result else Facts(figures, command=line),
            name=os.path.basename(task.name),
            svg_name=f"{os.path.basename(task.output).rpartition('.')[0]}.svg",
            own=result is not None,
            back=task.report_back,
        )
    except (WarpsplatError, OSError, MemoryError) as error:
        return replace(outcome, report_error=failure(error, task.name, task.output))
    return replace(outcome, report=page)
