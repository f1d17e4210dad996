"""Suggest how many shapes an image is worth, by drafts with more and more shapes."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.errors import UsageError, counted
from warpsplat.field_docs import described
from warpsplat.files.sources import ImageSource
from warpsplat.fit.loop import fit
from warpsplat.fit.place import simple_curves
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.progress import Callback
from warpsplat.fit.settings import SUBJECTS, Settings, Subject
from warpsplat.run.arguments import backend_on, settings_given, takes
from warpsplat.run.prepare import prepare
from warpsplat.run.typed import Options
from warpsplat.search.candidate import measured
from warpsplat.search.goal import draft_of

if TYPE_CHECKING:
    from typing_extensions import Unpack

FEWEST_SHAPES, MOST_SHAPES = 64, 1024
"""Range of the number of shapes: below it, more are nearly always worth their bytes; above it, a file is
larger than many a JPEG of the same photograph.
"""

VISIBLE_GAIN, GAIN_BYTES = 0.5, 10_000
"""Least gain that can be seen [dB], a rule of thumb of image coding, and the most bytes that it may take."""

SIMPLER = ", and --detail how small they may be"
"""Ending of a suggestion for a drawing."""


@described
@dataclass(frozen=True)
class Expected:
    """Quality and size of a draft; a run of the default effort gets a little more of the same size."""

    shapes: int
    """Number of shapes."""
    psnr: float
    """PSNR of the file as a viewer shows it [dB]."""
    bytes: int
    """Size of the file."""


@described
@dataclass(frozen=True)
class Suggestion:
    """A suggested number of shapes, and the reason."""

    curves: int | None
    """Number of shapes; None if the image itself decides it."""
    subject: Subject
    """Subject that the image was taken for."""
    why: str
    """The reason, in sentences."""
    expected: tuple[Expected, ...]
    """Drafts with ascending numbers of shapes, each twice that of the one before."""
    seconds: float
    """Time that the search took."""

    def as_dict(self) -> dict[str, Any]:
        """Return the values for JSON."""
        return {
            **{name: value for name, value in vars(self).items() if name != "expected"},
            "expected": [asdict(one) for one in self.expected],
            "seconds": round(self.seconds, 2),
        }


def check_suggesting(settings: Settings) -> None:
    """Raise ``UsageError`` if the settings decide the number of shapes already."""
    if others := settings.counting or ([] if settings.simplify else ["curves"]):
        raise UsageError(f"suggest and {others[0]} both decide the number of shapes: give one of them")


@takes(Options)
def suggest(
    image: ImageSource,
    *,
    settings: Settings | None = None,
    importance: ImageSource | None = None,
    device: str = "auto",
    threads: int | None = None,
    callback: Callback | None = None,
    stop: Callable[[], bool] | None = None,
    name: str | None = None,
    **options: Unpack[Options],
) -> Suggestion | None:
    """Suggest how many shapes an image is worth: as many as still gain what can be seen for their bytes.

    Drafts are made with twice as many shapes each time, until that gains less than 0.5 dB for 10 kB.

    Arguments are those of ``vectorize``, without ``curves`` and goals.

    Returns:
        the number, the reason, and the drafts; None if the run was stopped. Images that are traced have no
        number to choose, which the reason explains.

    Raises:
        UsageError: settings that decide the number of shapes.
        ImageError, ResourceError, TypeError: as for ``vectorize``.
    """
    settings = settings_given(suggest, settings, **options)
    check_suggesting(settings)
    with backend_on(device, threads) as backend:
        run = Run(backend, callback, stop)
        prepared = prepare(image, settings, name=name, importance=importance, backend=backend)
        subject = prepared.problem.settings.subject
        if subject != "photo":
            seen = f" ({prepared.why})" if prepared.why else ""
            why = (
                f"A {SUBJECTS[subject]}{seen}, which is traced: the picture says how many shapes there are"
                f"{SIMPLER if subject == 'drawing' else ''}. --subject photo fits a number of shapes to it."
            )
            return Suggestion(None, subject, why, (), time.monotonic() - run.started)
        drafts = make_drafts(prepared.problem, run)
    if run.failures:
        raise run.failures[0]
    if drafts is None:
        return None
    curves, why = choose(drafts)
    guess = guess_subject(prepared.problem.target)
    if guess.subject != "photo":
        why += f" It looks like a {SUBJECTS[guess.subject]} ({guess.why}), of which this is a rough guess."
    return Suggestion(curves, "photo", why, drafts, time.monotonic() - run.started)


def make_drafts(problem: Problem, run: Run) -> tuple[Expected, ...] | None:
    """Return drafts of ascending numbers of shapes until one is not worth its bytes; None if stopped."""
    most = min(MOST_SHAPES, simple_curves(problem.target))
    shapes, drafts, settings = min(FEWEST_SHAPES, most), list[Expected](), draft_of(problem.settings)
    parts = run.open_parts()
    while shapes <= most and (len(drafts) < 2 or is_worth(*drafts[-2:])):
        draft = replace(problem, settings=replace(settings, curves=shapes, simplify=False))
        made = fit(draft, next(parts))
        if made.interrupted:
            return None
        candidate = measured(draft, made)
        drafts.append(Expected(shapes, round(candidate.psnr, 2), candidate.size))
        shapes *= 2
    return tuple(drafts)


def is_worth(one: Expected, two: Expected) -> bool:
    """Tell whether the second draft gains what can be seen for its additional bytes."""
    return (two.psnr - one.psnr) * GAIN_BYTES > VISIBLE_GAIN * (two.bytes - one.bytes)


def choose(drafts: Sequence[Expected]) -> tuple[int, str]:
    """Return the number of shapes of the last draft that is worth its bytes, and the reason."""
    if len(drafts) == 1:
        shapes = counted(drafts[0].shapes, "shape")
        return drafts[0].shapes, f"The picture is so small that there is no room for more than {shapes}."
    rule = f"{VISIBLE_GAIN} dB, about the least that can be seen, for each {GAIN_BYTES // 1000} kB"
    one, two = drafts[-2:]
    if is_worth(one, two):
        return two.shapes, f"Up to {two.shapes:,} shapes, twice as many always buy at least {rule}."
    gain, size = two.psnr - one.psnr, (two.bytes - one.bytes) / 1000
    return one.shapes, f"Twice as many buy {gain:.1f} dB for {size:.0f} kB more: less than {rule}."
