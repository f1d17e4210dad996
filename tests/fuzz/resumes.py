"""``python -m tests.fuzz.resumes --count 5 --seed N``: runs ended at random steps and resumed, as a table.

Each is ended twice: by SIGKILL right after a checkpoint, and, resumed, by SIGTERM in the middle of a step.
The third run must give the bytes of one that was not interrupted."""

from __future__ import annotations

import argparse
import os
import random
import signal
import subprocess
import sys
import tempfile
from pathlib import Path

import cv2

from tests import ROOT
from warpsplat.files.packed import unpack

IMAGE = ROOT / "docs" / "images" / "cat.jpg"
SIDE = 96
"""Side of the reduced image [px]."""

COMMON = ("--curves=32", "--iterations=160", "--subject=photo", "--device=cpu", "--threads=1")
RUNS = {
    "closed": (),
    "open": ("--open",),
    "exact": ("--paint=auto", "--mixed"),
    "splat": ("--renderer=splat",),
    "layered": ("--levels=8,32",),
}
STEPS = 156
"""Least number of steps of these runs."""

DRIVER = """
import os, sys
from warpsplat.fit import checkpoint
from warpsplat.fit.step import Step
number, step, done = {number}, {step}, []
checkpoint.LEAST_SAVE_RATIO = 0.0
def struck(owner, name):
    function = getattr(owner, name)
    def strike(*arguments, **options):
        done.append(name)
        if name == "advance" and len(done) == step:
            os.kill(os.getpid(), number)
        made = function(*arguments, **options)
        if name == "save" and len(done) == step:
            os.kill(os.getpid(), number)
        return made
    setattr(owner, name, strike)
struck(*((checkpoint.Checkpoint, "save") if number == 9 else (Step, "advance")))
from warpsplat.cli.main import main
main({arguments!r})
"""
"""A program that ends itself, by SIGKILL after a checkpoint or by another signal in a step, both counted."""


def run(folder: Path, kind: str, name: str, number: int = 0, step: int = 0) -> int:
    """Run a kind with the result ``name``, until signal ``number`` at ``step`` if given; return the exit
    code.
    """
    given = ["vectorize", "image.png", "-o", name, "-q", *COMMON, *RUNS[kind]]
    if name != "whole.svg":
        given += ["--checkpoint=run.checkpoint", "--resume", f"--checkpoint-every={0 if number == 9 else 30}"]
    driver = DRIVER.format(number=int(number), step=step, arguments=given)
    environment = os.environ | {"PYTHONPATH": str(ROOT)}
    return subprocess.run([sys.executable, "-c", driver], cwd=folder, env=environment, check=False).returncode


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.resumes", description=__doc__)
    parser.add_argument("--count", type=int, default=5, help="of each kind")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--kind", choices=RUNS, action="append", help="of runs; default: all")
    given = parser.parse_args()
    kinds, faults = given.kind or list(RUNS), 0
    for kind in kinds:
        rng = random.Random(f"{given.seed} {kind}")
        with tempfile.TemporaryDirectory() as scratch:
            folder = Path(scratch)
            small = cv2.resize(cv2.imread(str(IMAGE)), (SIDE, SIDE), interpolation=cv2.INTER_AREA)
            cv2.imwrite(str(folder / "image.png"), small)
            assert run(folder, kind, "whole.svg") == 0
            whole = (folder / "whole.svg").read_bytes()
            for _ in range(given.count):
                first = rng.randrange(1, STEPS - 20)
                second = rng.randrange(1, STEPS - first - 8)
                codes = [run(folder, kind, "again.svg", signal.SIGKILL, first)]
                saved = [unpack(folder / "run.checkpoint")[0]["fits"]]
                codes.append(run(folder, kind, "again.svg", signal.SIGTERM, second))
                saved.append(unpack(folder / "run.checkpoint")[0]["fits"])
                codes.append(run(folder, kind, "again.svg"))
                same = (folder / "again.svg").read_bytes() == whole
                left = (folder / "run.checkpoint").exists()
                right = same and not left and codes == [-9, 143, 0]
                faults += not right
                steps = [sum(fit.get("step", fit.get("iterations")) for fit in fits) for fits in saved]
                print(f"{kind:8} SIGKILL after step {steps[0]:3}, SIGTERM in step {steps[1]:3}, "
                      f"exit {codes}: {'the same bytes' if right else 'FAULTY'}", flush=True)  # fmt: skip
                (folder / "again.svg").unlink()
    print(f"{given.count * len(kinds)} runs ended twice, {faults} faulty")
    sys.exit(bool(faults))


if __name__ == "__main__":
    main()
