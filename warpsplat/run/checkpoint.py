"""Checkpoints: files from which an interrupted run goes on."""

from __future__ import annotations

import hashlib
import json
import logging
import os
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpsplat._version import __version__
from warpsplat.errors import OutputError, UsageError
from warpsplat.files.inputs import STANDARD
from warpsplat.files.output import check_output, write_atomically
from warpsplat.files.packed import is_packed, pack, unpack
from warpsplat.fit.settings import Settings
from warpsplat.fit.stages import INTERVAL, Content, Stages
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class CheckpointFile:
    """Where a run saves its state, and what it makes of a state that is there."""

    path: Path
    resume: bool = False
    """Whether to go on from the checkpoint that is there; where there is none, the run starts anew."""
    overwrite: bool = False
    """Whether a run that starts anew may replace what is there."""
    every: float = INTERVAL
    """Time between two saves [s]."""

    def check(self, *others: Path) -> None:
        """Find out before the work whether it can be written, and may be.

        Args:
            others: files that it must not replace.

        Raises:
            UsageError: it cannot, is a file of another kind, or a checkpoint that nobody asked to go on from.
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
                raise UsageError(f"{self.path}: is no checkpoint of warpsplat")
        elif not self.overwrite:
            hint = "--resume goes on from it, --overwrite starts anew"
            raise UsageError(
                f"{self.path}: a checkpoint is there; {hint}"
                if found
                else f"{self.path}: exists and is no checkpoint; --overwrite replaces it"
            )

    def stages(self, run: Mapping[str, Any], backend: Backend) -> Stages:
        """What a run keeps here, and goes on from.

        Args:
            run: what decides its result (``identity``).
            backend: where it is computed.

        Raises:
            UsageError: the checkpoint is that of a run that is decided otherwise.
            CheckpointError: it is damaged, or of another version.
        """
        device = backend.device.name
        saved = self._read(run, device) if self.resume and self.path.exists() else None
        if self.resume and not saved:
            log.warning("%s: no checkpoint is there yet: starts anew", self.path)

        def write(content: Content) -> None:
            header = {"version": __version__, "device": device, "run": run, **content.numbers}
            try:
                write_atomically(self.path, pack(header, content.arrays))
            except OutputError as error:  # hours of work are not to end for it
                log.warning("%s: goes on without", error)

        stages = Stages(str(self.path), write, self.every, saved)
        if saved and stages.is_empty:
            log.warning("%s: there is nothing in it to go on from: starts anew", self.path)
        return stages

    def _read(self, run: Mapping[str, Any], device: str) -> Content:
        header, arrays = unpack(self.path)
        if header.get("version") != __version__:
            made = str(header.get("version"))[:20]
            raise UsageError(f"{self.path}: made by warpsplat {made}, this is {__version__}")
        before = header.get("run")
        for name, was, now in differences(before if isinstance(before, dict) else {}, run):
            detail = f" ({was}, now {now})" if name not in DIGESTS else ""
            raise UsageError(f"{self.path}: is of another run: {name} differs{detail}")
        if header.get("device") != device:
            log.warning("%s: made on another device: goes on, not to the same bytes", self.path)
        return Content(header, arrays)

    def remove(self) -> None:
        """The run is done."""
        self.path.unlink(missing_ok=True)


DIGESTS = ("image", "mask", "svg")
"""What a run is given, of which a digest is kept."""

SHOWN = 40
"""Characters of a value in a message."""


def identity(
    command: str,
    settings: Settings,
    image: FloatArray,
    mask: FloatArray | None = None,
    svg: str | None = None,
) -> dict[str, Any]:
    """What decides a run's result, as JSON has it."""
    return {
        "command": command,
        "image": _digest(image),
        "mask": "" if mask is None else _digest(mask),
        "svg": "" if svg is None else hashlib.sha256(svg.encode()).hexdigest(),
        "settings": json.loads(json.dumps(asdict(settings))),
    }


def _digest(image: FloatArray) -> str:
    """Of pixels and size."""
    found = hashlib.sha256(f"{image.shape} ".encode())
    found.update(np.ascontiguousarray(image, np.float32).data.cast("B"))
    return found.hexdigest()


def differences(before: Mapping[str, Any], now: Mapping[str, Any]) -> Iterator[tuple[str, str, str]]:
    """Names of the values that differ, and both, for people."""
    for name in {**now, **before}:
        old, new = before.get(name), now.get(name)
        if isinstance(old, dict) and isinstance(new, dict):
            yield from differences(old, new)
        elif old != new:
            yield name.replace("_", "-"), str(old)[:SHOWN], str(new)[:SHOWN]
