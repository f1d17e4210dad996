"""Whole runs on arrays, without an image to read."""

from __future__ import annotations

from collections.abc import Callable

from warpsplat.fit.problem import Problem, Run, Start
from warpsplat.fit.progress import Callback
from warpsplat.fit.settings import Settings
from warpsplat.metrics import Score
from warpsplat.rendering.backend import Backend
from warpsplat.run.prepare import PreparedImage
from warpsplat.run.result import Result
from warpsplat.run.vectorize import make_result
from warpsplat.scene import FloatArray


def vectorize(
    target: FloatArray,
    settings: Settings,
    backend: Backend,
    *,
    report: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    write: Callable[[str], None] | None = None,
    start: Start | None = None,
) -> Result:
    """Vectorize pixels."""
    return make_result(PreparedImage(Problem(target, settings)), Run(backend, report, stop), write, start)


def scored(result: Result) -> Score:
    """Return the score of a run that was not stopped."""
    assert result.score
    return result.score
