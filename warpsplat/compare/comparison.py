"""Vectorize an image by warpsplat and by another program, and measure both files in the same way."""

from __future__ import annotations

import io
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from PIL import Image

from warpsplat._version import __version__
from warpsplat.compare.tracer import Tracer
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

OURS = "warpsplat"

Maker = Callable[[FloatArray, Settings, Callable[[str], None]], Result]
"""Vectorizes an image, and passes the SVG to the callback before it is scored."""


@dataclass(frozen=True)
class ComparisonRow:
    """A file of one program at one setting."""

    image: str
    program: str
    setting: str
    svg: str
    """Empty if the program failed."""
    seconds: float
    """Wall time from pixels to SVG, without the score."""
    cpu_seconds: float
    """The same in processor time of all threads, which hardly depends on what else the machine does."""
    score: Score | None
    """None if there is no file, or one that cannot be rendered."""
    error: str = ""
    """The failure, in one line."""

    def as_dict(self) -> dict[str, Any]:
        """Return values for JSON."""
        figures = self.score.as_dict() if self.score else {"error": self.error}
        names = {"image": self.image, "program": self.program, "setting": self.setting}
        times = {"seconds": round(self.seconds, 2), "cpu_seconds": round(self.cpu_seconds, 2)}
        return {**names, **figures, **times}


@dataclass(frozen=True)
class Comparison:
    """All rows, and how they were made."""

    rows: Sequence[ComparisonRow]
    settings: Settings
    """Ours, apart from the number of shapes."""
    tracer: Tracer

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
) -> Iterator[ComparisonRow]:
    """Vectorize an image by each of our settings, then by each of the tracer's; may raise ``Stopped``.

    ``target``: sRGB in [0, 1], (height, width, 3); the tracer gets its 8 bits. ``make`` makes our files.
    """
    for ours in settings:
        yield our_row(image, target, ours, make)
    with_ssimulacra2 = all(has_time_for_ssimulacra2(ours, target) for ours in settings)
    file = io.BytesIO()
    Image.fromarray(np.round(255 * target).astype(np.uint8)).save(file, "PNG", compress_level=1)
    for setting in tracer.settings:
        yield their_row(image, target, file.getvalue(), tracer, setting, with_ssimulacra2)


def stopwatch() -> Callable[[], tuple[float, float]]:
    """Return a function that returns the wall time and the processor time since this call [s]."""
    begin = time.monotonic(), time.process_time()
    return lambda: (time.monotonic() - begin[0], time.process_time() - begin[1])


def our_row(image: str, target: FloatArray, settings: Settings, make: Maker) -> ComparisonRow:
    """Return our file of at most ``settings.curves`` shapes; raise ``Stopped`` if the run was interrupted."""
    times: list[tuple[float, float]] = []
    elapsed = stopwatch()
    result = make(target, settings, lambda _: times.append(elapsed()))
    if result.stopped or result.score is None:
        raise Stopped
    return ComparisonRow(image, OURS, str(settings.curves), result.svg, *times[-1], result.score)


def their_row(
    image: str, target: FloatArray, png: bytes, tracer: Tracer, setting: str, with_ssimulacra2: bool
) -> ComparisonRow:
    """Return the tracer's file of ``png``, which holds ``target``; its exceptions become the row's error."""
    elapsed = stopwatch()
    try:
        svg = tracer.trace(png, tracer.settings[setting])
    except (KeyboardInterrupt, SystemExit, GeneratorExit):
        raise
    except BaseException as error:  # Rust panics do not derive from Exception
        cause = (str(error).strip().splitlines() or ["no cause given"])[0]
        message = printable(f"failed: {type(error).__name__}: {cause}")
        return ComparisonRow(image, tracer.name, setting, "", *elapsed(), None, message)
    times = elapsed()
    try:
        score = score_svg(svg, target, perceptual=with_ssimulacra2)
    except ImageError as error:
        return ComparisonRow(image, tracer.name, setting, svg, *times, None, f"its file: {error}")
    return ComparisonRow(image, tracer.name, setting, svg, *times, score)


def warm_up(settings: Settings, backend: Backend) -> None:
    """Load or compile the kernels of a run, so that no row's time includes this."""
    y, x = np.mgrid[:64, :64].astype(np.float32) / 64
    target = np.stack([y, x, x * y], axis=2)
    quick = make_settings(kind=settings.kind, renderer=settings.renderer, curves=8, iterations=60)
    make_result(PreparedImage(Problem(target, quick)), Run(backend))
