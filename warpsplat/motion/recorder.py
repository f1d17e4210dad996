"""Record a run for its animation: shapes now and then, no images."""

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
from warpsplat.motion.timing import LONGEST, SECONDS, SHORTEST, kept
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.device import choose_device, start_warp
from warpsplat.rendering.device_lock import device_lock
from warpsplat.run.result import Result
from warpsplat.scene import Scene

What = Literal["training", "drawing"]
"""Contents of an animation: the training, or the shapes drawn one after the other."""

MOST_SCENES = 240
"""Maximum number of scenes to keep: more than any animation shows."""

MOST_BYTES = 256 << 20
"""Maximum size of all that is kept [bytes]."""

FEWEST = 3
"""Scenes needed for an animation of the training."""

NARROWEST, WIDEST = 16, 2048
"""Limits of the width [px]."""


class Recorder:
    """A callback of ``vectorize`` and ``refine`` that records the run for an animation.

    Example::

        recorder = warpsplat.Recorder()
        result = warpsplat.vectorize("cat.jpg", callback=recorder)
        recorder.save("cat.gif", result)
    """

    def __init__(self) -> None:
        self.scenes: list[Scene] = []
        """The scenes so far, in order, thinned out if there are too many."""
        self.moments: list[int] = []
        """Numbers of the progress reports that they are from."""
        self._reports = self._bytes = 0

    def __call__(self, progress: Progress) -> None:
        """Keep the shapes of a progress report."""
        if progress.snapshot is None:
            return
        self.scenes.append(progress.snapshot.scene())
        self.moments.append(self._reports)
        self._reports += 1
        self._bytes += _bytes_of(self.scenes[-1])
        while len(self.scenes) > FEWEST and (len(self.scenes) > MOST_SCENES or self._bytes > MOST_BYTES):
            chosen = kept(self.moments, max(FEWEST, len(self.scenes) * 2 // 3))
            self.scenes = [self.scenes[i] for i in chosen]
            self.moments = [self.moments[i] for i in chosen]
            self._bytes = sum(map(_bytes_of, self.scenes))

    @property
    def has_training(self) -> bool:
        """Whether there are enough scenes for an animation of the training."""
        return len(self.scenes) >= FEWEST

    def shows(self, result: Result) -> What:
        """Return the default contents: the training of photographs, else the drawing."""
        return "training" if result.subject == "photo" and self.has_training else "drawing"

    def save(
        self,
        path: str | os.PathLike[str],
        result: Result,
        *,
        what: What | None = None,
        width: int | None = None,
        seconds: float = SECONDS,
        device: str = "auto",
        threads: int | None = None,
    ) -> int:
        """Write the animation of the run that made ``result``; its last frame is the file.

        Args:
            path: the ending says what it is: ``.svg``, ``.gif``, ``.webp`` or ``.mp4`` (which takes the
                extra ``video``). An existing file is replaced in one step.
            result: what the run returned.
            what: ``training`` or ``drawing``, see ``What``; default: what ``shows`` says.
            width: of the picture [px], 16 to 2048; default: that of the file, within bounds that depend on
                the ending. An SVG is as large as the file.
            seconds: of the movement, 0.5 to 60; then the finished picture stays.
            device: that draws, see ``vectorize``.
            threads: see there.

        Returns:
            bytes of the file.

        Raises:
            UsageError: another ending, a value out of range, a package that is missing, or ``training``
                where less than three reports had shapes.
            OutputError: it cannot be written.
        """
        path = Path(path)
        films.check_format(path)
        check_width(width)
        if not SHORTEST <= seconds <= LONGEST:
            raise UsageError(f"an animation takes {SHORTEST:g} to {LONGEST:g} s, not {seconds:g}")
        what = what or self.shows(result)
        if what not in get_args(What):
            raise UsageError(f"an animation shows {' or '.join(get_args(What))}, not {what}")
        if what == "training" and not self.has_training:
            raise UsageError(f"{path}: the run had no training to show; the order of drawing can be shown")
        vector = path.suffix.lower() == ".svg"
        if what == "training" and vector:
            data = training.vector(self.scenes, self.moments, result, seconds).encode()
        elif what == "training":
            start_warp()
            backend = Backend.on(choose_device(device), threads)
            with device_lock(backend.device):
                frames = training.pictures(self.scenes, self.moments, result, path, width, seconds, backend)
                data = films.encoded(path, frames)
        elif vector:
            data = drawing.vector(result.svg, seconds).encode()
        else:
            own = result.before is None  # of a refined SVG it may be as it was given
            data = films.encoded(path, drawing.pictures(result.svg, path, width, seconds, own=own))
        write_result(path, data)
        return len(data)


def check_width(width: int | None) -> None:
    """Check the width of an animation [px].

    Raises:
        UsageError: it may not.
    """
    if width is not None and not NARROWEST <= width <= WIDEST:
        raise UsageError(f"an animation is {NARROWEST} to {WIDEST} px wide, not {width}")


def _bytes_of(scene: Scene) -> int:
    """Return the size of a scene's arrays [bytes]."""
    arrays = (getattr(scene, field.name) for field in fields(scene))
    return sum(array.nbytes for array in arrays if isinstance(array, np.ndarray))
