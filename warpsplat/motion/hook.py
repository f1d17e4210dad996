"""``--animate`` and ``--preview``: show a run as an animation and in the terminal."""

from __future__ import annotations

import logging
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from warpsplat.cli.echo import echo
from warpsplat.cli.help import option_in
from warpsplat.cli.hooks import Done, RunHook
from warpsplat.cli.options import OUTPUT
from warpsplat.errors import UsageError

if TYPE_CHECKING:
    from warpsplat.fit.progress import Progress
    from warpsplat.motion.preview import Preview
    from warpsplat.motion.recorder import Recorder
    from warpsplat.run.result import Result

PROTOCOLS = ("auto", "kitty", "iterm", "blocks")


class MotionHook(RunHook):
    """Records a run for an animation, and shows it in the terminal."""

    options = {  # noqa: RUF012
        "animate": option_in(
            "Files",
            "--animate",
            type=OUTPUT,
            metavar="FILE",
            help="Also write an animation: .svg, .gif, .webp or .mp4.",
        ),
        "animate_what": option_in(
            "Files",
            "--animate-what",
            type=click.Choice(["training", "drawing"]),
            help="How the shapes were optimised, or how they are drawn one after the other."
            "  [default: training; drawing for traced images]",
        ),
        "animate_width": option_in(
            "Files",
            "--animate-width",
            type=int,
            metavar="PX",
            help="Width of a .gif, .webp or .mp4.  [default: the image's; at most 800, of a GIF 480]",
        ),
        "preview": option_in(
            "Run",
            "--preview",
            type=click.Choice(PROTOCOLS),
            help="Show the picture in the terminal (stderr), live during the run, by its best protocol;"
            " --preview=NAME chooses one.",
        ),
    }

    def __init__(
        self, animate: Path | None, animate_what: Any, animate_width: int | None, preview: Any
    ) -> None:
        self._file, self._what, self._width, self._protocol = animate, animate_what, animate_width, preview
        self._recorder: Recorder | None = None
        self._preview: Preview | None = None

    @staticmethod
    def rewrite(arguments: list[str]) -> list[str]:
        """Give ``--preview`` the value auto: the next word may be an image, other values follow a "="."""
        end = arguments.index("--") if "--" in arguments else len(arguments)
        words = ["--preview=auto" if word == "--preview" else word for word in arguments[:end]]
        return words + arguments[end:]

    def flag(self) -> str | None:
        """See ``RunHook``."""
        return "--animate" if self._file else "--preview" if self._protocol else None

    def check(self, inputs: Sequence[Path], outputs: Sequence[Path], *, overwrite: bool) -> None:
        """Check that the animation can be made and is no other file of the run, and start the preview."""
        if self._file is None:
            if self._what or self._width is not None:
                raise UsageError("--animate-what and --animate-width need --animate FILE")
        else:
            self._check_animation(self._file, [*inputs, *outputs], overwrite=overwrite)
        if self._protocol:
            from warpsplat.motion.preview import start_preview

            self._preview = start_preview(sys.stderr, None if self._protocol == "auto" else self._protocol)

    def _check_animation(self, path: Path, files: Sequence[Path], *, overwrite: bool) -> None:
        from warpsplat.files.inputs import STANDARD
        from warpsplat.files.output import check_output
        from warpsplat.motion.films import check_format
        from warpsplat.motion.recorder import Recorder, check_width

        if path == STANDARD:
            raise UsageError("an animation cannot be written to the standard output: give --animate FILE")
        check_format(path)
        check_width(self._width)
        check_output(path, *files, overwrite=overwrite)
        if path.absolute() in {file.absolute() for file in files if file != STANDARD}:
            raise UsageError(f"{path}: is another file of this run; give another name")
        self._recorder = Recorder()

    def watch(self, on_progress: Callable[[Progress], None]) -> Callable[[Progress], None]:
        """Draw the picture first, so that the progress bar comes below it."""
        preview, recorder = self._preview, self._recorder

        def watched(progress: Progress) -> None:
            if preview:
                preview.update(progress)
            on_progress(progress)
            if recorder:
                recorder(progress)

        return watched if preview or recorder else on_progress

    def show(self, result: Result, image: bytes | Path | None) -> None:
        """Show the finished picture, beside the image if there is one."""
        if self._preview:
            from warpsplat.motion.preview import show_finished

            show_finished(self._preview, result, image)

    def finish(self, done: Done) -> None:
        """Write the animation, rendered on the device of the run."""
        if self._file is None or self._recorder is None:
            return
        from warpsplat.run.result import Result

        ((_, result),) = done.made
        assert isinstance(result, Result)
        what = self._what or self._recorder.shows(result)
        if what == "training" and not self._recorder.has_training:
            echo(f"warpsplat: {self._file}: no training to show; it shows the drawing instead", err=True)
            what = "drawing"
        log = logging.getLogger("warpsplat")
        log.info(f"{self._file}: drawing frames of the {what} ...", extra={"passing": True})
        device, threads = done.request.device, done.request.threads
        try:
            size = self._recorder.save(
                self._file, result, what=what, width=self._width, device=device, threads=threads
            )
        finally:
            log.info("", extra={"passing": True})
        if not done.request.quiet:
            echo(f"warpsplat: {self._file}: animation of the {what}, {size:,} bytes", err=True)
