"""Checkpoints: files from which an interrupted run is resumed."""

from __future__ import annotations

import hashlib
import json
import logging
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpsplat._version import __version__
from warpsplat.errors import OutputError, UsageError
from warpsplat.files.inputs import STANDARD
from warpsplat.files.output import check_output, write_atomically
from warpsplat.files.packed import is_packed, pack, unpack
from warpsplat.fit.checkpoint import SAVE_INTERVAL, Checkpoint, Content
from warpsplat.fit.options import parse_duration
from warpsplat.fit.problem import Problem
from warpsplat.fit.settings import Settings
from warpsplat.scene import FloatArray

if TYPE_CHECKING:
    from warpsplat.rendering.backend import Backend

log = logging.getLogger(__name__)


DIGESTS = ("image", "mask", "svg")
"""Parts of ``identity`` that are digests."""


@dataclass(frozen=True)
class CheckpointFile:
    """The file in which a run saves its state, and what to do with an existing one."""

    path: Path
    resume: bool = False
    """Whether to resume from the checkpoint that is there; without one the run starts from the beginning."""
    overwrite: bool = False
    """Whether a run that is not resumed may replace what is there."""
    every: float = SAVE_INTERVAL
    """Time between two saves [s]."""

    def check(self, *others: Path) -> None:
        """Raise ``UsageError`` unless the file can be written without replacing anything else.

        ``others``: files that it must not replace.
        """
        if self.path == STANDARD:
            raise UsageError("a checkpoint is a file, not the standard output")
        if any(os.path.realpath(self.path) == os.path.realpath(other) for other in others):
            raise UsageError(f"{self.path}: is the input or the result; give the checkpoint another name")
        check_output(self.path)
        try:
            found = is_packed(self.path)
        except FileNotFoundError:
            return
        except OSError as error:
            raise UsageError(f"{self.path}: cannot be read: {error.strerror}") from error
        if self.resume:
            if not found:
                raise UsageError(f"{self.path}: is not a checkpoint of warpsplat")
        elif not self.overwrite:
            hint = "--resume continues from it, --overwrite starts over"
            raise UsageError(
                f"{self.path}: a checkpoint exists; {hint}"
                if found
                else f"{self.path}: exists and is not a checkpoint; --overwrite replaces it"
            )

    def open(self, run: Mapping[str, Any], backend: Backend) -> Checkpoint:
        """Return the state that a run saves here, and is resumed from.

        ``run``: everything that decides its result (``identity``).

        Raises ``UsageError`` if the checkpoint is that of another run or version, and ``CheckpointError`` if
        it is damaged.
        """
        device = backend.device.name
        saved = self._read(run, device) if self.resume and self.path.exists() else None
        if self.resume and not saved:
            log.warning("%s: no checkpoint exists yet: starts from the beginning", self.path)

        def write(content: Content) -> None:
            whole = {"version": __version__, "device": device, "run": run, **content}
            try:
                write_atomically(self.path, pack(whole))
            except OutputError as error:  # a failed save must not end hours of work
                log.warning("%s; the run continues without this checkpoint", error)

        checkpoint = Checkpoint(write, self.every, saved)
        if saved and checkpoint.is_empty:
            log.warning("%s: nothing to resume from: starts from the beginning", self.path)
        return checkpoint

    def _read(self, run: Mapping[str, Any], device: str) -> Content:
        saved = unpack(self.path)
        if saved["version"] != __version__:
            raise UsageError(f"{self.path}: made by warpsplat {saved['version']}, this is {__version__}")
        for name, was, now in differences(saved["run"], run):
            detail = f" ({was}, now {now})" if name not in DIGESTS else ""
            raise UsageError(f"{self.path}: belongs to another run: {name} differs{detail}")
        if saved["device"] != device:
            log.warning(
                "%s: was made on another device; the run continues, but its bytes will differ", self.path
            )
        return saved


def open_checkpoint(
    path: str | os.PathLike[str] | None,
    every: float | str,
    others: tuple[object, ...],
    *,
    resume: bool,
    overwrite: bool,
) -> CheckpointFile | None:
    """Return the checkpoint of a run, if it is to have one, checked against ``others`` that are paths."""
    if path is None:
        if resume:
            raise UsageError("to resume, a run needs a checkpoint")
        return None
    made = CheckpointFile(Path(path), resume, overwrite, parse_duration(every))
    made.check(*(Path(other) for other in others if isinstance(other, (str, os.PathLike))))
    return made


def identity(command: str, settings: Settings, problem: Problem, svg: str | None = None) -> dict[str, Any]:
    """Return everything that decides a run's result, as JSON has it."""
    mask = problem.importance
    return {
        "command": command,
        "image": _digest(problem.target),
        "mask": "" if mask is None else _digest(mask),
        "svg": "" if svg is None else hashlib.sha256(svg.encode()).hexdigest(),
        "loss": problem.loss.name if problem.loss else "",
        "settings": json.loads(json.dumps(asdict(settings))),
    }


def _digest(image: FloatArray) -> str:
    """Return a digest of pixels and size."""
    found = hashlib.sha256(f"{image.shape} ".encode())
    found.update(np.ascontiguousarray(image, np.float32).data.cast("B"))
    return found.hexdigest()


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Yield the names of the values that differ, and both values, for people."""
    value_characters = 40  # characters of a value in a message
    for name in {**now, **before}:
        old, new = before.get(name), now.get(name)
        if isinstance(old, dict) and isinstance(new, dict):
            yield from differences(old, new)
        elif old != new:
            yield name.replace("_", "-"), str(old)[:value_characters], str(new)[:value_characters]
