"""Vectorize an image by warpsplat and by another program, and measure both files alike."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from warpsplat._version import __version__
from warpsplat.errors import ImageError, Stopped, printable
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.metrics import Score, score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.run.figures import has_time_for_ssimulacra2
from warpsplat.run.prepare import PreparedImage
from warpsplat.run.result import Result
from warpsplat.run.vectorize import make_result
from warpsplat.scene import FloatArray
from warpsplat.tools.tracer import Tracer

OURS = "warpsplat"

Maker = Callable[[FloatArray, Settings, Callable[[str], None]], Result]
"""Vectorizes an image by settings, and hands over the SVG before it is scored (``vectorize``)."""


@dataclass(frozen=True)
class Row:
    """One file of one program at one setting."""

    image: str
    program: str
    setting: str
    svg: str
    """Empty where the program failed."""
    seconds: float
    """From the pixels to the SVG, on the clock; not the score."""
    cpu_seconds: float
    """The same by the processor: of all threads, and whatever else the machine does."""
    score: Score | None
    """None where there is no file, or one that no viewer can show."""
    error: str = ""
    """What went wrong, as one line."""

    def as_dict(self) -> dict[str, Any]:
        """Return values for JSON."""
        figures = self.score.as_dict() if self.score else {"error": self.error}
        names = {"image": self.image, "program": self.program, "setting": self.setting}
        times = {"seconds": round(self.seconds, 2), "cpu_seconds": round(self.cpu_seconds, 2)}
        return {**names, **figures, **times}


@dataclass(frozen=True)
class Comparison:
    """All rows, and how they were made."""

    rows: Sequence[Row]
    settings: Settings
    """Of ours, but for the number of shapes."""
    tracer: Tracer

    def by_image(self) -> dict[str, list[Row]]:
        """Return the rows of each image."""
        found: dict[str, list[Row]] = {}
        for row in self.rows:
            found.setdefault(row.image, []).append(row)
        return found

    def as_dict(self) -> dict[str, Any]:
        """Return values for JSON."""
        ours = {
            "version": __version__,
            "kind": self.settings.kind.name.lower(),
            "iterations": self.settings.iterations,
            "seed": self.settings.seed,
        }
        theirs = {"version": self.tracer.version, "settings": self.tracer.settings}
        return {OURS: ours, self.tracer.name: theirs, "results": [row.as_dict() for row in self.rows]}


def compare(
    image: str, target: FloatArray, settings: Sequence[Settings], tracer: Tracer, make: Maker
) -> Iterator[Row]:
    """Vectorize an image by each of our settings, then by each of the tracer's.

    Args:
        image: its name.
        target: sRGB in [0, 1], (height, width, 3); the tracer gets its 8 bits.
        settings: ours.
        tracer: the other program.
        make: makes our files.

    Raises:
        Stopped: a run of ours was interrupted: its file says nothing.
    """
    for ours in settings:
        yield our_row(image, target, ours, make)
    eyes = all(has_time_for_ssimulacra2(ours, target) for ours in settings)
    file = io.BytesIO()
    Image.fromarray(np.round(255 * target).astype(np.uint8)).save(file, "PNG", compress_level=1)
    for setting in tracer.settings:
        yield their_row(image, target, file.getvalue(), tracer, setting, eyes=eyes)


class Watch:
    """Measures time since its creation."""

    def __init__(self) -> None:
        self.begin = time.monotonic(), time.process_time()

    def read(self) -> tuple[float, float]:
        """Return the wall time and the processor time since then [s]."""
        return time.monotonic() - self.begin[0], time.process_time() - self.begin[1]


def our_row(image: str, target: FloatArray, settings: Settings, make: Maker) -> Row:
    """Our file, of at most ``settings.curves`` shapes.

    Raises:
        Stopped: the run was interrupted.
    """
    watch = Watch()
    spent = watch.read()

    def note_end(_: str) -> None:
        nonlocal spent
        spent = watch.read()

    result = make(target, settings, note_end)
    if result.stopped or result.score is None:
        raise Stopped
    return Row(image, OURS, str(settings.curves), result.svg, *spent, result.score)


def their_row(image: str, target: FloatArray, png: bytes, tracer: Tracer, setting: str, *, eyes: bool) -> Row:
    """The tracer's file of ``png``, which holds ``target``; ``eyes`` as in ``score_svg``.

    Whatever the tracer throws is its own failure at this setting.
    """
    watch = Watch()
    try:
        svg = tracer.trace(png, tracer.settings[setting])
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # a panic of Rust code derives from no Exception
        cause = (str(error).strip().splitlines() or ["no cause given"])[0]
        message = printable(f"failed: {type(error).__name__}: {cause}")
        return Row(image, tracer.name, setting, "", *watch.read(), None, message)
    spent = watch.read()
    try:
        score = score_svg(svg, target, eyes=eyes)
    except ImageError as error:
        return Row(image, tracer.name, setting, svg, *spent, None, f"its file: {error}")
    return Row(image, tracer.name, setting, svg, *spent, score)


def warm_up(settings: Settings, backend: Backend) -> None:
    """Load or compile the kernels of a run, so that no row's time includes that."""
    y, x = np.mgrid[:64, :64].astype(np.float32) / 64
    target = np.stack([y, x, x * y], axis=2)
    quick = make_settings(kind=settings.kind, renderer=settings.renderer, curves=8, iterations=60)
    make_result(PreparedImage(Problem(target, quick)), Run(backend))
