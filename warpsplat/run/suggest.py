"""How many shapes an image is worth: as many as still buy what can be seen, with their bytes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.errors import UsageError
from warpsplat.files.sources import ImageSource
from warpsplat.fit.settings import Settings, Subject
from warpsplat.fit.work import Report
from warpsplat.portable import elementary
from warpsplat.rendering.backend import Backend
from warpsplat.run.prepare import prepare
from warpsplat.run.several import OWN_NUMBER
from warpsplat.search.survey import Worth, survey

CALLED = {"drawing": "drawing", **OWN_NUMBER}
"""Subjects that are traced, as messages call them."""

TABLE = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Shapes of the rows of a table, over those suggested."""

SAMPLES = 513
"""Numbers of shapes among which the knee is looked for."""

SEEN = 0.5
"""Decibels from which on an eye tells two pictures apart: a rule of thumb of image coding."""

MORE_SHAPES, MORE_BYTES = 100, 10_000
"""That are to buy as much. It is one price for all pictures: their quality grows about evenly with doublings,
and by the mean slope of each one's own curve (Satopää et al. 2011) all would get the same number.
"""

EXACT = 58.0
"""Decibels at which a picture of 8 bits a channel has no error but that of rounding."""

FINE = 0.05
"""Steps that a suggestion is rounded to, at the most, over itself: it is no more exact than that."""


@dataclass(frozen=True)
class Expected:
    """What a number of shapes is expected to give."""

    shapes: int
    psnr: float
    """[dB]"""
    bytes: int

    def __str__(self) -> str:
        """As the beginning of a sentence."""
        size = f"{self.bytes / 1000:.0f} kB" if self.bytes >= 10_000 else f"{self.bytes / 1000:.1f} kB"
        return f"{self.shapes} shapes are expected to give {self.psnr:.1f} dB in {size}"


@dataclass(frozen=True)
class Suggestion:
    """A number of shapes, and why."""

    curves: int | None
    """Shapes; None where the image itself says how many there are."""
    subject: Subject
    """What the image was taken for ..."""
    why: str
    """The reason, in sentences."""
    expected: tuple[Expected, ...]
    """Of the suggested number and of others around it, ascending, of runs of the default effort."""
    by_shapes: int | None
    """The knee of quality against shapes ..."""
    by_bytes: int | None
    """... and against bytes, in shapes."""
    seconds: float

    def as_dict(self) -> dict[str, Any]:
        """For JSON."""
        return {
            **{name: value for name, value in vars(self).items() if name != "expected"},
            "expected": [asdict(one) for one in self.expected],
            "seconds": round(self.seconds, 2),
        }


def check_suggesting(settings: Settings) -> None:
    """Find out whether there is anything to suggest.

    Raises:
        UsageError: the settings say how many shapes there are to be.
    """
    if others := settings.counting or ([] if settings.simplify else ["curves"]):
        raise UsageError(
            f"suggest says how many shapes are worth it, and {others[0]} as well: give one of them"
        )


def suggest_curves(
    source: ImageSource,
    settings: Settings,
    backend: Backend,
    *,
    name: str | None = None,
    importance: ImageSource | None = None,
    report: Report | None = None,
    stop: Callable[[], bool] | None = None,
) -> Suggestion | None:
    """Suggest a number of shapes for an image; None where it was stopped. Arguments are those of
    ``run.vectorize.vectorize_image``.

    Raises:
        UsageError: see ``check_suggesting``.
        ImageError, ResourceError: see ``vectorize_image``.
    """
    check_suggesting(settings)
    started = time.monotonic()
    work = prepare(source, settings, name=name, importance=importance)
    subject = work.settings.subject
    if subject != "photo":
        seen = f" ({work.why})" if work.why else ""
        why = (
            f"A {CALLED[subject]}{seen}, which is traced: the picture says how many shapes there are. "
            "--subject photo fits a number of shapes to it."
        )
        return Suggestion(None, subject, why, (), None, None, time.monotonic() - started)
    worth = survey(work.target, work.settings, backend, importance=work.importance, report=report, stop=stop)
    if worth is None:
        return None
    made = suggestion(worth)
    guess = guess_subject(work.target)
    if guess.subject != "photo":
        rough = f"It looks like a {CALLED[guess.subject]} ({guess.why}), of which this is a rough guess."
        made = replace(made, why=f"{made.why} {rough}")
    return replace(made, seconds=time.monotonic() - started)


def suggestion(worth: Worth) -> Suggestion:
    """What is suggested: the fewer shapes of its two knees, or the fewest where more are worth nothing."""
    by_shapes, by_bytes = knee(worth, MORE_SHAPES), knee(worth, MORE_BYTES / worth.bytes_each)
    chosen = min(by_shapes, by_bytes)
    why = reason(worth, chosen, "100 more" if by_shapes <= by_bytes else "10 kB more")
    rows = sorted({min(max(round(share * chosen), worth.fewest), worth.most) for share in TABLE})
    expected = tuple(expect(worth, row) for row in rows)
    return Suggestion(chosen, "photo", why, expected, by_shapes, by_bytes, 0.0)


def knee(worth: Worth, more: float) -> int:
    """The most shapes at which ``more`` of them buy ``SEEN``, at the rate there; the fewest if none do."""
    low, high = elementary.log([worth.fewest, worth.most])
    shapes = elementary.exp(np.linspace(low, high, SAMPLES))
    shapes[[0, -1]] = worth.fewest, worth.most
    if worth.fewest == worth.most:
        return worth.most
    rate = np.gradient(np.minimum(worth.psnr(shapes), EXACT), shapes)
    at = np.flatnonzero(more * rate >= SEEN)
    return min(rounded(float(shapes[at[-1]])), worth.most) if len(at) else worth.fewest


def expect(worth: Worth, shapes: int) -> Expected:
    """What ``shapes`` are expected to give."""
    return Expected(shapes, round(float(worth.psnr(shapes)), 2), round(float(worth.size(shapes))))


def reason(worth: Worth, chosen: int, more: str) -> str:
    """Why it is this number; ``more``: what buys less from there on."""
    if worth.fewest == worth.most:
        return f"The picture is so small that there is no room for more than {worth.most} shapes."
    one, two = expect(worth, chosen), expect(worth, 2 * chosen)
    if one.psnr > EXACT:
        return f"{one}; more are expected to add nothing that can be seen."
    first = str(one)
    if 2 * chosen <= worth.most:
        size = (two.bytes - one.bytes) / 1000
        first += f", and twice as many {two.psnr - one.psnr:.1f} dB more for {size:.0f} kB more"
    if chosen >= worth.most:
        return (
            f"{first}. All the way to {worth.most:,} shapes {more} buy {SEEN} dB at least, which can be seen."
        )
    if chosen == worth.fewest:
        return f"{first}. From there on {more} buy less than {SEEN} dB, which can hardly be seen."
    seen = f"{more} buy {SEEN} dB at least, which can be seen"
    return f"{first}. Up to there {seen}, beyond it less. This is the knee."


def rounded(number: float) -> int:
    """A number that is easily said, near another one."""
    most = max(FINE * number, 1.0)
    unit = elementary.power_of_ten(len(str(int(most))) - 1)
    step = max(unit * factor for factor in (1, 2, 5) if unit * factor <= most)
    return max(1, round(step * round(number / step)))
