"""Record the shapes of a run, and save its animation."""

from __future__ import annotations

import os
from dataclasses import fields
from pathlib import Path
from typing import Literal, get_args

import numpy as np

from warpsplat.errors import UsageError
from warpsplat.files.output import write_result
from warpsplat.fit.progress import Progress
from warpsplat.motion import drawing, films, training
from warpsplat.motion.timing import DEFAULT_SECONDS, MAX_SECONDS, MIN_SECONDS, kept
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.rendering.device_lock import device_lock
from warpsplat.run.result import Result
from warpsplat.scene import Scene

Subject = Literal["training", "drawing"]
"""How the shapes were optimised, or how they are drawn one after the other."""

MAX_SCENES = 240
"""More than any animation shows."""

MAX_BYTES = 256 << 20
"""Total of all recorded scenes."""

MIN_SCENES = 3
"""For an animation of the training."""

MIN_WIDTH, MAX_WIDTH = 16, 2048
"""Limits of an animation's width [px]."""


class Recorder:
    """A callback of ``vectorize`` and ``refine`` that records what an animation of the run needs.

    Example::

        recorder = warpsplat.Recorder()
        result = warpsplat.vectorize("cat.jpg", callback=recorder)
        recorder.save("cat.gif", result)
    """

    def __init__(self) -> None:
        self.scenes: list[Scene] = []
        """The shapes of the run so far; thinned out when they become too many."""
        self.moments: list[int] = []
        """Numbers of the progress reports that they come from."""
        self._reports = self._bytes = 0

    def __call__(self, progress: Progress) -> None:
        """Record the shapes of a progress report."""
        if progress.snapshot is None:
            return
        self.scenes.append(progress.snapshot.scene())
        self.moments.append(self._reports)
        self._reports += 1
        self._bytes += _bytes_of(self.scenes[-1])
        while len(self.scenes) > MIN_SCENES and (len(self.scenes) > MAX_SCENES or self._bytes > MAX_BYTES):
            chosen = kept(self.moments, max(MIN_SCENES, len(self.scenes) * 2 // 3))
            self.scenes = [self.scenes[i] for i in chosen]
            self.moments = [self.moments[i] for i in chosen]
            self._bytes = sum(map(_bytes_of, self.scenes))

    @property
    def has_training(self) -> bool:
        """Whether there are enough scenes for an animation of the training."""
        return len(self.scenes) >= MIN_SCENES

    def shows(self, result: Result) -> Subject:
        """Return the default: training of fitted shapes, drawing of traced ones, which change little."""
        return "training" if result.subject == "photo" and self.has_training else "drawing"

    def save(
        self,
        path: str | os.PathLike[str],
        result: Result,
        *,
        what: Subject | None = None,
        width: int | None = None,
        seconds: float = DEFAULT_SECONDS,
        device: str = "auto",
        threads: int | None = None,
    ) -> int:
        """Write the animation of the run that made ``result``; it ends with the finished picture.

        Args:
            path: ``.svg``, ``.gif``, ``.webp`` or ``.mp4`` (needs the extra ``video``). An existing file is
                replaced in one step.
            result: what the run returned.
            what: ``training``, how the shapes were optimised, or ``drawing``, how they are drawn one after
                the other; default: see ``shows``.
            width: of the picture [px], 16 to 2048; default: the file's, within limits of the format. An SVG
                is as large as the file.
            seconds: of movement, 0.5 to 60; then the finished picture stays.
            device: renders the scenes, see ``vectorize``.
            threads: see ``vectorize``.

        Returns:
            size of the file [bytes].

        Raises:
            UsageError: unknown extension, value out of range, missing package, or ``training`` with fewer
                than three recorded scenes.
            OutputError: it cannot be written.
        """
        path = Path(path)
        films.check_format(path)
        check_width(width)
        if not MIN_SECONDS <= seconds <= MAX_SECONDS:
            raise UsageError(f"an animation takes {MIN_SECONDS:g} to {MAX_SECONDS:g} s, not {seconds:g}")
        what = what or self.shows(result)
        if what not in get_args(Subject):
            raise UsageError(f"an animation shows {' or '.join(get_args(Subject))}, not {what}")
        if what == "training" and not self.has_training:
            raise UsageError(f"{path}: there is no training to show; the order of drawing can be shown")
        vector, recorded = path.suffix.lower() == ".svg", (self.scenes, self.moments, result)
        if what == "training" and vector:
            data = training.animated_svg(*recorded, seconds).encode()
        elif what == "training":
            start_warp()
            backend = Backend.on(choose_device(device), threads)
            with device_lock(backend.device):
                data = films.encoded(path, training.film(*recorded, path, width, seconds, backend))
        elif vector:
            data = drawing.animated_svg(result.svg, seconds).encode()
        else:
            own = result.before is None  # a refined SVG may be the user's own
            data = films.encoded(path, drawing.film(result.svg, path, width, seconds, own=own))
        write_result(path, data)
        return len(data)


def check_width(width: int | None) -> None:
    """Raise a ``UsageError`` if an animation cannot have this width [px]."""
    if width is not None and not MIN_WIDTH <= width <= MAX_WIDTH:
        raise UsageError(f"an animation is {MIN_WIDTH} to {MAX_WIDTH} px wide, not {width}")


def _bytes_of(scene: Scene) -> int:
    """Return the size of a scene's arrays."""
    arrays = (getattr(scene, field.name) for field in fields(scene))
    return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))
