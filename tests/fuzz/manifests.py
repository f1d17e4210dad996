"""Manifests to mutate, of the images that a batch finds in the folder ``in``."""

from __future__ import annotations

import random
from collections.abc import Mapping
from pathlib import Path

from tests.fuzz import mutate
from tests.fuzz.corpus import Seed
from warpsplat.batch.manifest import Entry
from warpsplat.fit.settings import make_settings
from warpsplat.run.result import job_key

NAME = "case.jsonl"
FIGURES = {"psnr": 20.5, "bytes": 700, "seconds": 1.5, "paths": 4, "missed": [], "levels": []}

WORDS = (
    "v", "time", "output", "key", "event", "digest", "image", "error", "figures", "made", "failed", "writing",
    "psnr", "bytes", "seconds", "true", "null", "NaN", "Infinity", "out/a.svg", "1e308", "\n",
)  # fmt: skip

SNIPPETS = (
    "\n", "\r", "{", "}", "[", "]", ",", '"', "[" * 2000, "{}\n", "null\n", "9" * 5000, "1e999", '"\\ud800"',
    '"\\u0000"', "\0", "-", '{"v": 1}\n', '"v": 2', "../../x.svg",
)  # fmt: skip


def arguments(json: bool) -> tuple[str, ...]:
    """Return the command line of a batch that only reads the manifest."""
    fit = ("--curves", "4", "--iterations", "2", "--device", "cpu", "--dry-run", "--manifest", NAME)
    return ("batch", "in", "-o", "out", *fit, *(("--json",) if json else ()))


def manifests(images: Mapping[str, bytes]) -> list[Seed]:
    """Return one of failures, one of missing results, and one of both; ``images``: by path."""
    settings = make_settings(curves=4, iterations=2)
    keys = {f"out/{Path(name).stem}.svg": job_key(settings, data) for name, data in images.items()}
    failed = b"".join(
        Entry(name, key, "failed", error=f"{name}: not an image").line() for name, key in keys.items()
    )
    made = b"".join(Entry(name, key, "made", "0" * 64, figures=FIGURES).line() for name, key in keys.items())
    return [Seed("failed.jsonl", failed), Seed("made.jsonl", made), Seed("both.jsonl", made + failed)]


def changed(rng: random.Random, data: bytes, other: bytes) -> bytes:
    """Change words and numbers, or bytes, or truncate it."""
    if rng.random() < 0.1:
        return data[: rng.randrange(len(data) + 1)]
    if rng.random() < 0.3:
        return mutate.mutate_bytes(rng, data, other)
    return mutate.mutate_text(rng, data, other, WORDS, SNIPPETS)
