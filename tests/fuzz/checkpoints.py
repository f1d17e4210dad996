"""Checkpoints to change, of short runs that are nearly done, so that accepted ones end soon."""

from __future__ import annotations

import io
import itertools
import random
import tempfile
import zipfile
from pathlib import Path

import numpy as np

import warpsplat
from tests.fuzz.corpus import Seed, picture
from tests.fuzz.mutate import INTERESTING, mutate_bytes, mutate_text
from tests.fuzz.vocabulary import JSON_WORDS
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

FLOATS = np.float32([0, -0.0, 1, -1, 1e-40, 3e38, -3e38, np.inf, -np.inf, np.nan, 1e9, 2e9])


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
    """Change bytes of the file, or of parts of it with correct checksums."""
    if rng.random() < 0.2:
        return mutate_bytes(rng, data, other)
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        parts = {name: archive.read(name) for name in archive.namelist()}
    header, *names = parts
    for _ in range(rng.choice((1, 1, 1, 1, 3))):
        name, action = rng.choice(names), rng.randrange(10)
        if action < 3:
            # What comes before identifies the run: most changes there are refused at once.
            head, mark, rest = parts[header].partition(b'"fits"' if rng.random() < 0.9 else b'"format"')
            parts[header] = head + mutate_text(rng, mark + rest, rest, JSON_WORDS)
        elif action == 3:
            parts[name] = rng.choice((b"", parts[rng.choice(names)]))
        elif action == 4:
            parts[name] = mutate_bytes(rng, parts[name], parts[header])
        else:
            parts[name] = _change_numbers(rng, parts[name])
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w") as archive:
        for name, part in parts.items():
            archive.writestr(zipfile.ZipInfo(name), part)
    return made.getvalue()


def _change_numbers(rng: random.Random, part: bytes) -> bytes:
    """Return an array with some numbers changed, or with rows added or removed."""
    try:
        array = np.load(io.BytesIO(part))
    except Exception:  # it was changed before
        return mutate_bytes(rng, part, part)
    flat = array.reshape(-1)
    for _ in range(rng.choice((1, 1, 2, 8)) if len(flat) else 0):
        odd = (
            np.array(rng.choice(INTERESTING)).astype(np.int32)
            if flat.dtype == np.int32
            else rng.choice(FLOATS)
        )
        # A value from elsewhere in the array is valid.
        flat[rng.randrange(len(flat))] = rng.choice(flat) if rng.random() < 0.7 else odd
    if rng.random() < 0.25:
        array = np.concatenate([array, array])[: rng.randrange(2 * len(array) + 1)]
    made = io.BytesIO()
    np.lib.format.write_array(made, array)
    return made.getvalue()
