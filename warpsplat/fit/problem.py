"""Problems to fit, the runs that carry out the work, and their results: the arguments of every fit."""

from __future__ import annotations

import functools
import math
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeVar

from warpsplat.errors import DeviceError, Stopped
from warpsplat.fit.checkpoint import Checkpoint
from warpsplat.fit.custom_loss import CustomLoss
from warpsplat.fit.optics import Optics
from warpsplat.fit.progress import Callback, Progress
from warpsplat.fit.settings import Settings
from warpsplat.scene import FloatArray, Scene

if TYPE_CHECKING:
    from warpsplat.fit.state import Past
    from warpsplat.rendering.backend import Backend

Made = TypeVar("Made")


@dataclass(frozen=True, eq=False)
class Problem:
    """An image to fit and the settings: everything that decides the result."""

    target: FloatArray
    """The image, sRGB in [0, 1], shape (height, width, 3); or premultiplied with opacity, shape (height,
    width, 4), which makes a file without a background.
    """
    settings: Settings
    importance: FloatArray | None = None
    """How much the error of a pixel counts: grey mask in [0, 1], of any size."""
    loss: CustomLoss | None = None
    """Joins or replaces the squared error."""
    metadata: str = ""
    """Text for the file's metadata, which names the job."""

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the image [px]."""
        return self.target.shape[1], self.target.shape[0]

    @property
    def removes_background(self) -> bool:
        """Whether the file of a traced image is without its background."""
        return self.settings.removal is not None and self.target.shape[2] == 3

    def having(self, **settings: Any) -> Problem:
        """Return the problem with some settings changed."""
        return replace(self, settings=replace(self.settings, **settings))


@dataclass(frozen=True, eq=False)
class Start:
    """Shapes that a fit starts from; by default new ones, as many as the settings ask for."""

    scene: Scene | None = None
    """Shapes to start from; their number is kept, unless ``past`` is given."""
    past: Past | None = None
    """Optimizer state of these shapes: with it their number follows the schedule."""
    begin: int = 0
    """Step of the schedule to start at."""
    below: Scene | None = None
    """Shapes of earlier levels, in front of which new ones are placed."""


@dataclass(frozen=True)
class Rounding:
    """How the coordinates of a fit are rounded for its file."""

    per_pixel: float | None = None
    """View box units per pixel; None: chosen by the shapes."""
    by_bytes: bool = False
    """Whether the choice weighs the error against the bytes, instead of allowing a small loss."""


USUAL_ROUNDING = Rounding()


@dataclass(eq=False)
class Run:
    """How a problem is worked on: the device, the callbacks, and when to end.

    Work that consists of several fits gives each of them a run of its own, made by one of the methods below,
    which passes its progress reports on to the run that it was made from.
    """

    device: Backend | Callable[[], Backend]
    """The device, or a function that starts it when it is first needed: a draft of a drawing needs none.
    A function is cached (``functools.cache``)."""
    on_progress: Callback | None = None
    stop: Callable[[], bool] | None = None
    """Called after every step; once it returns True, the current shapes are the result."""
    deadline: float = math.inf
    """Time at which a fit has to end (``time.monotonic``): it takes as many steps as there is time for."""
    checkpoint: Checkpoint | None = None
    """Keeps the state, so that the run can be resumed; None with a deadline, which no two runs reach in the
    same number of steps.
    """
    failures: list[DeviceError] = field(default_factory=list)
    """Failures of the device, after which a run ends with what the host knows; shared by all its parts."""
    started: float = field(default_factory=time.monotonic)
    _ended: bool = field(default=False, init=False)
    """Whether ``on_progress`` asked for the end."""

    @functools.cached_property
    def backend(self) -> Backend:
        """The device."""
        return self.device() if callable(self.device) else self.device

    @property
    def device_name(self) -> str:
        """Name of the device that was used: the CPU if none was started."""
        started = getattr(self.device, "cache_info", None)
        return "cpu" if started and not started().currsize else str(self.backend.device)

    def stopped(self) -> bool:
        """Return whether the user wants the run to end, or its device failed."""
        return self._ended or bool(self.failures) or bool(self.stop and self.stop())

    def over(self) -> bool:
        """Return whether the run has to end, since it was stopped or its time is up."""
        return time.monotonic() > self.deadline or self.stopped()

    def check(self) -> None:
        """Raise ``Stopped`` if the run has to end."""
        if self.over():
            raise Stopped

    def attempt(self, work: Callable[[], Made]) -> Made | None:
        """Return the result of work on the device; None if that failed, which is then one of ``failures``."""
        from warpsplat.rendering.failures import failures_of  # imports Warp

        try:
            with failures_of(self.backend.device):
                return work()
        except DeviceError as failure:
            self.failures.append(failure)
            return None

    def report(self, progress: Progress) -> None:
        """Pass a progress report on."""
        if self.on_progress and self.on_progress(progress) is True:
            self._ended = True

    def derived(self, **changes: Any) -> Run:
        """Return a run with some fields changed that reports to this one, and ends when this one does."""
        return replace(self, **{"on_progress": self.report, "stop": self.stopped, **changes})

    def mapped(self, change: Callable[[Progress], Progress]) -> Run:
        """Return a run whose progress reports are changed by a function before they come here."""
        return self.derived(on_progress=lambda progress: self.report(change(progress)))

    def part(self, begin: float, end: float) -> Run:
        """Return a run for the part of this one's work between two shares in [0, 1]."""
        return self.mapped(lambda now: replace(now, work=begin + (end - begin) * now.work))

    def open_parts(self, begin: float = 0.0, share: float = 0.5) -> Iterator[Run]:
        """Yield runs for parts of unknown number: each covers a share of the work that is left."""
        while True:
            end = begin + share * (1 - begin)
            yield self.part(begin, end)
            begin = end

    def within(self, share: float) -> Run:
        """Return a run that may take a share of the time that is left."""
        now = time.monotonic()
        left = max(self.deadline - now, 0.0)
        return self.derived(deadline=now + share * left if left < math.inf else math.inf)

    def unsized(self) -> Run:
        """Return a run that ends at the deadline, but whose number of steps does not depend on it."""
        return self.derived(deadline=math.inf, stop=self.over)


@dataclass(frozen=True)
class Fit:
    """The result of a fit."""

    scene: Scene
    per_pixel: float
    """View box units per pixel of the grid that the scene is rounded to, or can be."""
    render_psnr: float
    """PSNR of the last training render, at its size [dB]; NaN: a trace, which was not rendered."""
    estimated_psnr: float
    """PSNR by the last step's loss [dB]: once the file is evaluated, an estimate of the file's."""
    iterations: int
    """Steps done."""
    interrupted: bool
    renewed: int = 0
    """How often a shape was reset because of a number that was not finite."""
    optics: Optics | None = None
    """How the image was made of it, as far as it is known; None: it is as sharp as the image."""
