"""Doing one task, in whatever process: bytes in, a result and its figures out."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from warpsplat.errors import WarpsplatError, explain, printable
from warpsplat.files.inputs import read_input
from warpsplat.files.output import make_folder
from warpsplat.fit.work import Progress
from warpsplat.jobs.executors.tasks import Outcome, Source, Stop, Task
from warpsplat.jobs.formats import named_bytes
from warpsplat.jobs.keys import STOPPED, job_key
from warpsplat.jobs.prepare import load_target
from warpsplat.jobs.reports.command import vectorize_command
from warpsplat.jobs.reports.single import Facts, report_page
from warpsplat.jobs.vectorize import vectorize_image
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.rendering.device_lock import device_lock
from warpsplat.svg.inspect import svg_text

Report = Callable[[Progress], None]


def do(task: Task, stop: Stop | None = None, report: Report | None = None) -> Outcome:
    """Do ``task``; whatever goes wrong is in the outcome.

    Args:
        task: what to do.
        stop: asked after every step; once true, the shapes as they are make the file.
        report: called every few steps.

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
        return _made(task, key, image, stop, report)
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic of Rust code derives from no Exception
        return Outcome(task.number, "failed", key=key, error=failure(error, task.name, task.output))


def failure(error: BaseException, *names: str) -> str:
    """What to tell a user of an error of an image, one line with the image's name, the first of ``names``."""
    message, _ = explain(error)
    shown = [printable(name) for name in names]
    return message if any(name in message for name in shown) else f"{shown[0]}: {message}"


def read(source: Source, what: str = "an image") -> bytes:
    """The bytes of an image, or of ``what`` it should be.

    Raises:
        ImageError: it cannot be read.
    """
    return source if isinstance(source, bytes) else read_input(Path(source), what)


def _made(task: Task, key: str, image: bytes, stop: Stop | None, report: Report | None) -> Outcome:
    output = Path(task.output)
    start_warp()
    backend = Backend.on(choose_device(task.device), task.threads)
    if not task.bring:
        make_folder(output.parent)
    with device_lock(backend.device):
        result = vectorize_image(
            image,
            task.settings,
            backend,
            output=None if task.bring else output,
            name=task.name,
            importance=task.mask,
            keyed=True,
            report=report,
            stop=stop,
        )
        made = Outcome(task.number, "made")
        if task.report and not result.stopped:
            line = vectorize_command(task.settings, task.name, task.output)
            made = _reported(task, image, result.svg, Facts.of(result, line), backend, own=True)
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
        line = vectorize_command(task.settings, task.name, task.output)
        facts = Facts(task.report.figures or score.as_dict(), command=line)
        start_warp()
        backend = Backend.on(choose_device(task.device), task.threads)
        with device_lock(backend.device):
            made = _reported(task, image, svg_text(data, task.output), facts, backend, own=False)
    return replace(made, key=key, digest=digest(data), figures=score.as_dict())


def _reported(task: Task, image: bytes, svg: str, facts: Facts, backend: Backend, *, own: bool) -> Outcome:
    """The report of a result that is there: if it cannot be made, that is no reason to lose the result."""
    outcome = Outcome(task.number, "made" if own else "measured")
    name, svg_name = (os.path.basename(path) for path in (task.name, task.output))
    try:
        made = report_page(
            svg,
            image,
            backend,
            facts,
            name=name,
            svg_name=f"{svg_name.rpartition('.')[0]}.svg",
            own=own,
            back=task.report.back if task.report else "",
        )
    except (WarpsplatError, OSError, MemoryError) as error:
        return replace(outcome, report_error=failure(error, task.name, task.output))
    return replace(outcome, report=made.text)


def digest(data: bytes) -> str:
    """Names the bytes of a result."""
    return hashlib.sha256(data).hexdigest()
