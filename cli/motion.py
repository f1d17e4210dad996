"""What shows a run besides its file: ``--animate``, and ``--preview``."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from warpsplat.cli.options import FILE
from warpsplat.cli.say import say
from warpsplat.errors import UsageError

if TYPE_CHECKING:
    from warpsplat.fit.progress import Progress
    from warpsplat.motion.recorder import Recorder
    from warpsplat.motion.terminal.preview import Preview
    from warpsplat.run.result import Result

Function = TypeVar("Function", bound=Callable[..., Any])

OPTIONS = ("animate", "animate_what", "animate_width", "preview")

PROTOCOLS = ("auto", "kitty", "iterm", "sixel", "blocks")


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
            help="Width of a .gif, .webp or .mp4.  [default: the image's; at most 800, of a GIF 480]",
        ),
        preview_option,
    ]
    for option in reversed(options):
        function = option(function)
    return function


preview_option = click.option(
    "--preview",
    type=click.Choice(PROTOCOLS),
    help="Show the picture in the terminal (stderr), also while it comes to be: as well as the terminal can,"
    " or --preview=blocks ...",
)


class WithPreview(click.Command):
    """A command whose ``--preview`` takes a value behind ``=`` only: what follows it may be an image."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """As every command does."""
        end = args.index("--") if "--" in args else len(args)
        bare = ["--preview=auto" if word == "--preview" else word for word in args[:end]]
        return super().parse_args(ctx, bare + args[end:])


@dataclass
class Motion:
    """The wishes of a command line, checked before the run."""

    animation: Path | None = None
    what: Any = None
    width: int | None = None
    protocol: Any = None
    recorder: Recorder | None = None
    preview: Preview | None = None

    @classmethod
    def of(cls, given: dict[str, Any]) -> Motion:
        """Take the values of ``motion_options`` out of those of a command."""
        return cls(*(given.pop(name) for name in OPTIONS))

    def for_several(self, takes: str = "one image") -> None:
        """Of several images, or where there is no single run to show: messages say what the wishes take.

        Raises:
            UsageError: the command line has wishes.
        """
        if self.animation or self.protocol:
            raise UsageError(f"{'--animate' if self.animation else '--preview'} takes {takes}")

    def check(self, *files: Path, overwrite: bool) -> None:
        """Find out before the work whether the animation can be made, beside other ``files`` of the run.

        Raises:
            UsageError: it cannot.
        """
        if self.animation is None:
            if self.what or self.width is not None:
                raise UsageError("--animate-what and --animate-width say how --animate FILE is made")
        else:
            self._check_animation(self.animation, files, overwrite=overwrite)
        self.preview = preview_of(self.protocol)

    def _check_animation(self, path: Path, files: tuple[Path, ...], *, overwrite: bool) -> None:
        from warpsplat.files.inputs import STANDARD
        from warpsplat.files.output import check_output
        from warpsplat.motion.films import check_format
        from warpsplat.motion.recorder import Recorder, check_width

        if path == STANDARD:
            raise UsageError("an animation does not go to the standard output: give --animate FILE")
        check_format(path)
        check_width(self.width)
        check_output(path, *files, overwrite=overwrite)
        if path.absolute() in {file.absolute() for file in files if file != STANDARD}:
            raise UsageError(f"{path}: is another file of this run; give another name")
        self.recorder = Recorder()

    def watch(self, report: Callable[[Progress], None]) -> Callable[[Progress], None]:
        """What hears of the run in place of ``report``, a progress bar's: it comes below the picture."""
        preview, recorder = self.preview, self.recorder

        def heard(progress: Progress) -> None:
            if preview:
                preview.report(progress)
            report(progress)
            if recorder:
                recorder(progress)

        return heard if preview or recorder else report

    def show(self, result: Result, source: bytes | Path | None) -> None:
        """Show the finished picture, beside the image that it was made of if that can be read once more."""
        if self.preview is None:
            return
        from warpsplat.cli.preview import finished

        finished(self.preview, result, source)

    def finish(
        self, result: Result, *, quiet: bool, device: str = "auto", threads: int | None = None
    ) -> None:
        """Write what was asked for, drawn as the run was made.

        Raises:
            OutputError: it cannot be written.
        """
        if self.animation is None or self.recorder is None:
            return
        what = self.what or self.recorder.shows(result)
        if what == "training" and not self.recorder.has_training:
            say(f"warpsplat: {self.animation}: no training to show, so it shows the drawing", err=True)
            what = "drawing"
        log = logging.getLogger("warpsplat")
        log.info(f"{self.animation}: pictures of the {what} ...", extra={"passing": True})
        try:
            size = self.recorder.save(
                self.animation, result, what=what, width=self.width, device=device, threads=threads
            )
        finally:
            log.info("", extra={"passing": True})
        if not quiet:
            say(f"warpsplat: {self.animation}: animation of the {what}, {size:,} bytes", err=True)


def preview_of(protocol: str | None) -> Preview | None:
    """What draws on stderr, or None: nothing is to be shown, or nothing can; then a line says so."""
    if protocol is None:
        return None
    from warpsplat.cli.preview import preview_on

    return preview_on(sys.stderr, None if protocol == "auto" else protocol)
