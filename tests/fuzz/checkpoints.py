"""Checkpoints to change, of short runs that are nearly done, so that accepted ones end soon."""

from __future__ import annotations

import itertools
import random
import tempfile
from pathlib import Path

import warpsplat
from tests.fuzz.corpus import Seed, picture
from tests.fuzz.mutate import mutate_bytes
from warpsplat.cli.vectorize import command

COMMON = ("--device", "cpu", "--curves", "4", "--iterations", "56", "--subject", "photo", "--threads", "1")
RUNS = {
    ".open": ("--open",),
    ".layered": ("--levels", "2,4"),
    ".painted": ("--paint", "auto"),
    ".splat": ("--renderer", "splat"),
}
"""Flags by the endings of the checkpoints' names."""

STOPPED = 53
"""Steps, past the first evaluation of the file; more in the first fit of several."""


def checkpoints() -> list[Seed]:
    """Return one of each of ``RUNS``."""
    seeds = []
    for ending, flags in RUNS.items():
        with tempfile.TemporaryDirectory() as folder:
            image, path = Path(folder, "a.png"), Path(folder, "checkpoint")
            picture().save(image)
            given = command.make_context("vectorize", [str(image), *COMMON, *flags]).params
            known = ("curves", "iterations", "subject", "levels", "paint", "renderer", "device", "threads")
            steps = itertools.count(1)
            warpsplat.vectorize(
                image,
                **{name: given[name] for name in known},
                open=ending == ".open" or None,
                checkpoint=path,
                stop=lambda steps=steps: next(steps) >= STOPPED,  # type: ignore[misc]
            )
            seeds.append(Seed(f"run{ending}", path.read_bytes()))
    return seeds


def arguments(name: str, image: str) -> tuple[str, ...]:
    """Return the command line that resumes from a checkpoint ``name`` of the picture ``image``."""
    flags = RUNS[Path(name).suffix]
    return ("vectorize", image, "-o", "out.svg", *COMMON, *flags, "--checkpoint", name, "--resume")


def changed(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Change bytes of the file; its digest tells, so that none is accepted."""
    return mutate_bytes(rng, data, other)
