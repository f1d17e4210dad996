"""What shows a run besides its file: ``--animate``, and ``--preview``."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from warpsplat.cli.options import FILE
from warpsplat.cli.say import say
from warpsplat.errors import UsageError

if TYPE_CHECKING:
    from warpsplat.fit.work import Progress
    from warpsplat.jobs.vectorize import Result
    from warpsplat.motion.recorder import Recorder

Function = TypeVar("Function", bound=Callable[..., Any])

OPTIONS = ("animate", "animate_what", "animate_width")


def motion_options(function: Function) -> Function:
    """The flags; ``Motion.of`` takes their values."""
    options = [
        click.option(
            "--animate",
            type=FILE,
            metavar="FILE",
            help="Write an animation as well: .svg, .gif, .webp or .mp4.",
        ),
        click.option(
            "--animate-what",
            type=click.Choice(["training", "drawing"]),
            help="How the shapes came to be, or how they are drawn one after the other.  [default: training,"
            " and drawing of what is traced]",
        ),
        click.option(
            "--animate-width",
            type=int,
            metavar="PX",
            help="Of an animation of pixels.  [default: that of the image, 800 px or a GIF's 480 at the most]",
        ),
    ]
    for option in reversed(options):
        function = option(function)
    return function


@dataclass
class Motion:
    """The wishes of a command line, checked before the run."""

    animation: Path | None = None
    what: Any = None
    width: int | None = None
    recorder: Recorder | None = None

    @classmethod
    def of(cls, given: dict[str, Any]) -> Motion:
        """Take the values of ``motion_options`` out of those of a command."""
        return cls(*(given.pop(name) for name in OPTIONS))

    def for_several(self) -> None:
        """Of several images.

        Raises:
            UsageError: the command line has wishes.
        """
        if self.animation:
            raise UsageError("--animate takes one image")

    def check(self, *files: Path, overwrite: bool) -> None:
        """Find out before the work whether the animation can be made, beside other ``files`` of the run.

        Raises:
            UsageError: it cannot.
        """
        if self.animation is None:
            if self.what or self.width is not None:
                raise UsageError("--animate-what and --animate-width say how --animate FILE is made")
            return
        from warpsplat.files.inputs import STANDARD
        from warpsplat.files.output import check_output
        from warpsplat.motion.films import check_format
        from warpsplat.motion.recorder import Recorder, check_width

        if self.animation == STANDARD:
            raise UsageError("an animation does not go to the standard output: give --animate FILE")
        check_format(self.animation)
        check_width(self.width)
        check_output(self.animation, *files, overwrite=overwrite)
        if self.animation.absolute() in {file.absolute() for file in files if file != STANDARD}:
            raise UsageError(f"{self.animation}: is another file of this run; give another name")
        self.recorder = Recorder()

    def watch(self, report: Callable[[Progress], None]) -> Callable[[Progress], None]:
        """What hears of the run in place of ``report``, which hears first."""
        recorder = self.recorder
        if recorder is None:
            return report

        def heard(progress: Progress) -> None:
            report(progress)
            recorder(progress)

        return heard

    def finish(self, result: Result, *, quiet: bool) -> None:
        """Write what was asked for.

        Raises:
            OutputError: it cannot be written.
        """
        if self.animation is None or self.recorder is None:
            return
        what = self.what or self.recorder.shows(result)
        if what == "training" and not self.recorder.has_training:
            say(f"warpsplat: {self.animation}: no training to show, so it shows the drawing", err=True)
            what = "drawing"
        size = self.recorder.save(self.animation, result, what=what, width=self.width)
        if not quiet:
            say(f"warpsplat: {self.animation}: animation of the {what}, {size:,} bytes", err=True)
