"""Checkpoints to mutate, of short runs that are nearly done, so that accepted ones end soon."""

from __future__ import annotations

import io
import itertools
import random
import tempfile
import zipfile
import zlib
from pathlib import Path

import numpy as np

import warpsplat
from tests.fuzz import mutate
from tests.fuzz.corpus import Seed, picture
from warpsplat.cli.vectorize import command

COMMON = ("--device", "cpu", "--curves", "4", "--iterations", "56", "--subject", "photo", "--threads", "1")
RUNS = {
    ".closed": (),
    ".open": ("--open",),
    ".layered": ("--levels", "2,4"),
    ".painted": ("--paint", "auto"),
    ".splat": ("--renderer", "splat"),
}
"""Flags by the endings of the checkpoints' names."""

STOPPED = 53
"""Steps, past the first evaluation of the file; more in the first fit of several."""

WORDS = (
    "step", "began", "curves", "per_pixel", "settled", "rounding", "colored", "generator", "room",
    "fits", "state", "samples", "slots", "needed", "inc", "has_uint32", "PCG64", "true", "false", "null",
    "NaN", "Infinity",
)  # fmt: skip

SNIPPETS = (
    "{", "}", "[", "]", ",", '"', "[" * 2000, "[0]", "{}", "null,", "1e999", "9" * 5000, '"fits": [],',
    '"\\ud800"', "-", "\0",
)  # fmt: skip

FLOATS = np.float32([0, -0.0, 1, -1, 1e-40, 3e38, -3e38, np.inf, -np.inf, np.nan, 1e9, 2e9])


def checkpoints() -> list[Seed]:
    """Return one of each of ``RUNS``."""
    seeds = []
    for ending, flags in RUNS.items():
        with tempfile.TemporaryDirectory() as folder:
            image, path = Path(folder, "a.png"), Path(folder, "checkpoint")
            picture().save(image)
            given = command.make_context("vectorize", [str(image), *COMMON, *flags]).params
            known = {"curves", "iterations", "subject", "levels", "paint", "renderer", "device", "threads"}
            options = {name: value for name, value in given.items() if name in known}
            steps = itertools.count(1)
            warpsplat.vectorize(
                image,
                **options,
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
    """Change bytes of the file, or those of a part of it with correct checksums."""
    if rng.random() < 0.2:
        return mutate.mutate_bytes(rng, data, other)
    parts, others = _parts(data), _parts(other)
    for _ in range(rng.choice((1, 1, 1, 1, 3))):
        place = rng.randrange(len(parts)) if rng.random() < 0.8 else 0
        name, part = parts[place]
        action = rng.randrange(10)
        if place == 0:
            # What comes before identifies the run: most changes there are refused at once.
            head, mark, rest = part.partition(b'"fits"' if rng.random() < 0.9 else b'"format"')
            text = mutate.mutate_text(rng, mark + rest, part, WORDS, SNIPPETS)
            parts[0] = (name, head + text)
        elif action == 0:
            del parts[place]
        elif action == 1:
            parts[place] = (name, rng.choice(others)[1])
        elif action == 2:
            parts[place] = (rng.choice(parts)[0], part)
        elif action == 3:
            parts[place] = (name, mutate.mutate_bytes(rng, part, rng.choice(others)[1]))
        else:
            parts[place] = (name, _other_numbers(rng, part))
    return _packed(parts, rng)


def _parts(data: bytes) -> list[tuple[str, bytes]]:
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return [(info.filename, archive.read(info)) for info in archive.infolist()]


def _other_numbers(rng: random.Random, part: bytes) -> bytes:
    """Return an array with some numbers changed, or with rows added or removed."""
    try:
        array = np.load(io.BytesIO(part))
    except Exception:  # it was mutated before
        return mutate.mutate_bytes(rng, part, part)
    flat = array.reshape(-1)
    whole = array.dtype == np.int32
    for _ in range(rng.choice((1, 1, 2, 8)) if len(flat) else 0):
        other = rng.choice(mutate.INTERESTING) if whole else rng.choice(FLOATS)
        if rng.random() < 0.7:  # a value from elsewhere in the array is valid
            other = rng.choice(flat)
        flat[rng.randrange(len(flat))] = np.int64(other).astype(np.int32) if whole else other
    if rng.random() < 0.15:
        array = array[: rng.randrange(len(array) + 1)]
    elif rng.random() < 0.1:
        array = np.concatenate([array, array])
    made = io.BytesIO()
    np.lib.format.write_array(made, array)
    return made.getvalue()


def _packed(parts: list[tuple[str, bytes]], rng: random.Random) -> bytes:
    """Return an archive; seldom a compressed one."""
    how = zipfile.ZIP_STORED if rng.random() < 0.97 else zipfile.ZIP_DEFLATED
    made = io.BytesIO()
    with zipfile.ZipFile(made, "w", how, compresslevel=zlib.Z_BEST_SPEED) as archive:
        for name in dict.fromkeys(name for name, _ in parts):
            archive.writestr(zipfile.ZipInfo(name), next(data for other, data in parts if other == name), how)
    return made.getvalue()
