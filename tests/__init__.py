"""Laid out as the source is; ``ROOT`` is the checkout."""

import os
from pathlib import Path

ROOT = Path(__file__).parents[1]


def keep_to_one_core() -> None:
    """Of pytest-xdist's workers each keeps to one core, as do the programs that it starts: the threads of all
    their libraries would wait for one another otherwise, which takes three times the time.
    """
    worker = os.environ.get("PYTEST_XDIST_WORKER", "")
    if worker and hasattr(os, "sched_setaffinity"):
        cores = sorted(os.sched_getaffinity(0))
        os.sched_setaffinity(0, {cores[int(worker.removeprefix("gw")) % len(cores)]})


def make_image(path: Path, seed: int = 0) -> None:
    """Save a small picture of random pixels."""
    import numpy as np  # not above: some tasks start without any library
    from PIL import Image

    rng = np.random.default_rng(seed)
    Image.fromarray(rng.integers(0, 255, (24, 32, 3), dtype=np.uint8)).save(path)


keep_to_one_core()  # before any library counts the cores
