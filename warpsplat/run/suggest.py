"""Suggest how many shapes an image is worth: as many as still gain what can be seen for their bytes."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsplat.drawing.trace.subject import guess_subject
from warpsplat.errors import UsageError, counted
from warpsplat.field_docs import described
from warpsplat.files.sources import ImageSource
from warpsplat.fit.problem import Run
from warpsplat.fit.progress import Callback
from warpsplat.fit.settings import SUBJECTS, Settings, Subject
from warpsplat.portable import elementary
from warpsplat.run.arguments import backend_on, settings_given, takes
from warpsplat.run.prepare import prepare
from warpsplat.run.typed import Options
from warpsplat.search.survey import Worth, survey

if TYPE_CHECKING:
    from typing_extensions import Unpack

ROW_RATIOS = (0.25, 0.5, 1.0, 2.0, 4.0)
"""Shapes of the rows of a table, over the suggested number."""

GAIN_SAMPLES = 513
"""Numbers of shapes at which the gain is evaluated."""

VISIBLE_GAIN = 0.5
"""Least gain that can be seen [dB]: a rule of thumb of image coding."""

MORE_SHAPES, MORE_BYTES = 100, 10_000
"""Shapes, and bytes, that have to gain as much. The threshold is the same for all images: their quality grows
about evenly with doublings, so by the mean slope of each one's curve (Satopää et al. 2011) all would get the
same number.
"""

EXACT_PSNR = 58.0
"""PSNR at which an image of 8 bits a channel has no error but that of rounding [dB]."""

ROUNDING_SHARE = 0.05
"""Largest step to which a suggestion is rounded, as a share of it: it is no more exact than that."""

SIMPLER = ", and --detail how small they may be"
"""Ending of a suggestion for a drawing."""


@described
@dataclass(frozen=True)
class Expected:
    """Expected quality and size of a number of shapes."""

    shapes: int
    """Their number."""
    psnr: float
    """PSNR of the file as a viewer shows it [dB]."""
    bytes: int
    """Size of the file."""

    def __str__(self) -> str:
        """Return the beginning of a sentence."""
        size = f"{self.bytes / 1000:.0f} kB" if self.bytes >= 10_000 else f"{self.bytes / 1000:.1f} kB"
        return f"{counted(self.shapes, 'shape')} should give {self.psnr:.1f} dB in {size}"


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
    """For the suggested number and others around it, ascending, by runs of the default effort."""
    by_shapes: int | None
    """Most shapes of which 100 more gain what can be seen."""
    by_bytes: int | None
    """Most shapes of which 10 kB more gain what can be seen."""
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

    A short fit on a reduced image, whose shapes grow from few to many, estimates the result of each number;
    it takes a fraction of the time of a run.

    Arguments are those of ``vectorize``, without ``curves`` and goals.

    Returns:
        the number, the reason, and the expected results of it and others at the default effort; None if the
        run was stopped. Images that are traced have no number to choose, which the reason explains.

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
            return Suggestion(None, subject, why, (), None, None, time.monotonic() - run.started)
        worth = survey(prepared.problem, run)
    if run.failures:
        raise run.failures[0]
    if worth is None:
        return None
    made = suggestion(worth)
    guess = guess_subject(prepared.problem.target)
    rough = f" It looks like a {SUBJECTS[guess.subject]} ({guess.why}), of which this is a rough guess."
    why = made.why if guess.subject == "photo" else made.why + rough
    return replace(made, why=why, seconds=time.monotonic() - run.started)


def suggestion(worth: Worth) -> Suggestion:
    """Return the suggestion: the smaller of the numbers that shapes and bytes allow."""
    by_shapes, by_bytes = most_worth(worth, MORE_SHAPES), most_worth(worth, MORE_BYTES / worth.bytes_each)
    chosen = min(by_shapes, by_bytes)
    why = reason(worth, chosen, "100 more" if by_shapes <= by_bytes else "10 kB more")
    rows = sorted({min(max(round(share * chosen), worth.fewest), worth.most) for share in ROW_RATIOS})
    expected = tuple(expect(worth, row) for row in rows)
    return Suggestion(chosen, "photo", why, expected, by_shapes, by_bytes, 0.0)


def most_worth(worth: Worth, more: float) -> int:
    """Return the most shapes at which ``more`` of them gain ``VISIBLE_GAIN``; the fewest if none do."""
    low, high = elementary.log([worth.fewest, worth.most])
    shapes = elementary.exp(np.linspace(low, high, GAIN_SAMPLES))
    shapes[[0, -1]] = worth.fewest, worth.most
    if worth.fewest == worth.most:
        return worth.most
    rate = np.gradient(np.minimum(worth.psnr(shapes), EXACT_PSNR), shapes)
    at = np.flatnonzero(more * rate >= VISIBLE_GAIN)
    return min(rounded(float(shapes[at[-1]])), worth.most) if len(at) else worth.fewest


def expect(worth: Worth, shapes: int) -> Expected:
    """Return the expected quality and size of ``shapes``."""
    return Expected(shapes, round(float(worth.psnr(shapes)), 2), round(float(worth.size(shapes))))


def reason(worth: Worth, chosen: int, more: str) -> str:
    """Return the reason for a number, from which on ``more`` gains less."""
    if worth.fewest == worth.most:
        return f"The picture is so small that there is no room for more than {counted(worth.most, 'shape')}."
    one, two = expect(worth, chosen), expect(worth, 2 * chosen)
    if one.psnr > EXACT_PSNR:
        return f"{one}; more are expected to add nothing that can be seen."
    first = str(one)
    if 2 * chosen <= worth.most:
        size = (two.bytes - one.bytes) / 1000
        first += f", and twice as many {two.psnr - one.psnr:.1f} dB more for {size:.0f} kB more"
    seen = f"{more} buy {VISIBLE_GAIN} dB at least, which can be seen"
    if chosen >= worth.most:
        return f"{first}. All the way to {worth.most:,} shapes {seen}."
    if chosen == worth.fewest:
        return f"{first}. From there on {more} buy less than {VISIBLE_GAIN} dB, which can hardly be seen."
    return f"{first}. Up to there {seen}, beyond it less."


def rounded(number: float) -> int:
    """Return a round number near another one."""
    most = max(ROUNDING_SHARE * number, 1.0)
    unit = elementary.power_of_ten(len(str(int(most))) - 1)
    step = max(unit * factor for factor in (1, 2, 5) if unit * factor <= most)
    return max(1, round(step * round(number / step)))
