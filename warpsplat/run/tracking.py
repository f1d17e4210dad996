"""The progress and the deadline of a run."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import TYPE_CHECKING

from warpsplat.errors import DeviceError, counted
from warpsplat.fit.problem import Fit, Run
from warpsplat.fit.progress import Progress, Snapshot
from warpsplat.fit.settings import Settings
from warpsplat.native import release_memory
from warpsplat.scene import FloatArray

if TYPE_CHECKING:
    from warpsplat.run.result import Result

TAIL_SECONDS, TAIL_PER_PIXEL = 0.3, 3e-7
"""Part of a time budget that the last step, exporting and scoring take [s]."""


def recorded(run: Run, history: list[Progress]) -> Run:
    """Return a run whose progress is recorded and never falls, and which releases memory now and then."""

    def record(now: Progress) -> Progress:
        now = replace(now, work=max(now.work, history[-1].work) if history else now.work)
        history.append(replace(now, snapshot=None))  # which holds a run's arrays
        # Progress reports from one release of free memory to the next: a release takes as long as a step
        # does.
        release_interval = 10
        if len(history) % release_interval == 0:
            release_memory()
        return now

    return run.mapped(record)


def report_end(made: Fit, run: Run, history: list[Progress]) -> None:
    """Report the end of the training, unless the last report already did."""
    if history and history[-1].work < 1 and not made.interrupted:
        scene = made.scene

        def shown() -> FloatArray:
            from warpsplat.rendering.renderer import render

            return render(scene, backend=run.backend)

        snapshot = Snapshot(lambda: scene, shown)
        last = replace(history[-1], work=1.0, fine=True, psnr=made.estimated_psnr, shapes=len(scene))
        run.report(replace(last, seconds=time.monotonic() - run.started, snapshot=snapshot))


def timed(run: Run, settings: Settings, target: FloatArray) -> Run:
    """Return the run with the deadline that ``time_budget`` sets, which leaves time to write and score."""
    if settings.time_budget is None:
        return run
    tail = TAIL_SECONDS + TAIL_PER_PIXEL * target[..., 0].size
    return run.derived(deadline=time.monotonic() + settings.time_budget - tail, checkpoint=None)


def failed(run: Run, name: str, result: Result) -> DeviceError:
    """Return the error of a run whose device failed, and that has made ``result`` of what was left."""
    saved = run.checkpoint and not run.checkpoint.is_empty
    resumed = "; --resume continues from the checkpoint" if saved else ""
    after = f"has the shapes after {counted(result.iterations, 'step')}"
    left = after if result.iterations else "is the trace alone"
    text = f"{name}: {run.failures[0]}; its file {left}{resumed}"
    error = DeviceError(text)
    error.result, error.is_lost = result, run.failures[0].is_lost
    return error


def before_clearing(run: Run, target: FloatArray) -> Run:
    """Return the run of a fit, after which there is time to draw outlines back from what is transparent."""
    # Share of the time of an image with transparency that is left to draw outlines back (fit/clear.py).
    clearing_share = 0.1
    return run.within(1 - clearing_share) if target.shape[2] == 4 else run
