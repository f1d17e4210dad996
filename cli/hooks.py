"""Hooks by which extensions add options to ``vectorize``, ``refine`` and ``eval``, check them before the run,
watch the run, and show or write more than the file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import click

from warpsplat.cli.help import GroupedCommand
from warpsplat.cli.options import Function, Request, together
from warpsplat.errors import UsageError
from warpsplat.extensions import extensions, load

if TYPE_CHECKING:
    from warpsplat.fit.progress import Progress
    from warpsplat.run.result import Result

Mode = Literal["one file", "several images", "several numbers", "suggestion"]
"""The output that a command line asks for."""

TAKES: dict[Mode, str] = {
    "several images": "one image",
    "several numbers": "one number of shapes",
    "suggestion": "a run that makes a file",
}
"""For messages: the mode that an option needs if it cannot be given in this one."""


@dataclass(frozen=True)
class Done:
    """The outcome of a command."""

    request: Request
    data: bytes | Path
    """The image: its bytes, or the path that it can be read from again."""
    made: Sequence[tuple[Path, Result | bytes | Path]]
    """Files with their results; of ``eval``, the SVG that was measured."""
    command: str = ""
    """The command line that repeats it."""
    several: bool = False
    """Whether several numbers of shapes were asked for."""


class RunHook:
    """Base class of hooks; it does nothing. One is made for each command line, with its options' values."""

    commands: ClassVar[tuple[str, ...]] = ("vectorize", "refine")
    modes: ClassVar[tuple[Mode, ...]] = ("one file",)
    """Modes in which its options can be given."""
    options: ClassVar[dict[str, Callable[[Any], Any]]] = {}
    """Parameter -> click decorator."""

    def __init__(self, **values: Any) -> None:
        """``values``: of ``options``."""

    @staticmethod
    def rewrite(arguments: list[str]) -> list[str]:
        """Return the words of the command line as click is to parse them."""
        return arguments

    def flag(self) -> str | None:
        """Return the first flag that was given, for messages; None if there is none."""
        return None

    def check(self, inputs: Sequence[Path], outputs: Sequence[Path], *, overwrite: bool) -> None:
        """Raise ``UsageError`` before the run if what is asked for cannot be done."""

    def watch(self, on_progress: Callable[[Progress], None]) -> Callable[[Progress], None]:
        """Return the callback of the run, in place of ``on_progress``, which shows the progress bar."""
        return on_progress

    def show(self, result: Result, image: bytes | Path | None) -> None:
        """Show a result as soon as it is available; ``image`` is None if it cannot be read again."""

    def finish(self, done: Done) -> None:
        """Write further output, after the file is written and its figures are printed."""

    def as_dict(self) -> dict[str, Any]:
        """Return further items for the object of ``--json``."""
        return {}


def hooks_of(command: str) -> Iterable[type[RunHook]]:
    """Yield the hooks of a command."""
    for extension in extensions().values():
        for target in extension.run_hooks:
            if command in (hook := load(target)).commands:
                yield hook


def hook_options(command: str) -> Callable[[Function], Function]:
    """Return a decorator that adds the options of all hooks of a command."""
    return together(*(option for hook in hooks_of(command) for option in hook.options.values()))


class HookedCommand(GroupedCommand):
    """A command whose hooks may rewrite the words before they are parsed."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse ``args`` as the hooks rewrite them."""
        for hook in hooks_of(self.name or ""):
            args = hook.rewrite(args)
        return super().parse_args(ctx, args)


class Hooks:
    """All hooks of one command line."""

    def __init__(self, command: str, given: dict[str, Any]) -> None:
        """Take the values of the hooks' options out of ``given``."""
        self.values: dict[str, Any] = {}
        self._hooks = []
        for hook in hooks_of(command):
            values = {name: given.pop(name) for name in hook.options}
            self.values |= values
            self._hooks.append(hook(**values))

    def check_mode(self, mode: Mode) -> None:
        """Raise ``UsageError`` if an option that was given is not possible in a mode."""
        for hook in self._hooks:
            if mode not in hook.modes and (flag := hook.flag()):
                raise UsageError(f"{flag} takes {TAKES[mode]}")

    def check(self, inputs: Sequence[Path], outputs: Sequence[Path], *, overwrite: bool) -> None:
        """See ``RunHook``."""
        for hook in self._hooks:
            hook.check(inputs, outputs, overwrite=overwrite)

    def check_files(
        self, inputs: Sequence[Path], output: Path, checkpoint: Path | None, *, overwrite: bool
    ) -> None:
        """Check before a run that the result and the checkpoint can be written, then ``check``."""
        from warpsplat.files.output import check_output
        from warpsplat.run.formats import ENDINGS, check_format

        check_output(output, *inputs, endings=ENDINGS, overwrite=overwrite)
        check_format(output)
        if checkpoint:
            check_output(checkpoint, *inputs)
        self.check(inputs, [output, *filter(None, [checkpoint])], overwrite=overwrite)

    def watch(self, on_progress: Callable[[Progress], None]) -> Callable[[Progress], None]:
        """See ``RunHook``."""
        for hook in self._hooks:
            on_progress = hook.watch(on_progress)
        return on_progress

    def show(self, result: Result, image: bytes | Path | None) -> None:
        """See ``RunHook``."""
        for hook in self._hooks:
            hook.show(result, image)

    def finish(self, done: Done) -> None:
        """See ``RunHook``."""
        for hook in self._hooks:
            hook.finish(done)

    def as_dict(self) -> dict[str, Any]:
        """See ``RunHook``."""
        return {name: value for hook in self._hooks for name, value in hook.as_dict().items()}
