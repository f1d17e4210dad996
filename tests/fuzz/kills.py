"""``python -m tests.fuzz.kills --count 60 --seed N``: signals at random moments of runs, as a table."""

from __future__ import annotations

import argparse
import contextlib
import hashlib
import json
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from tests import ROOT
from tests.forks import make_image
from warpsplat.batch.manifest import NAME, entry_of
from warpsplat.errors import WarpsplatError
from warpsplat.svg.viewer import render_svg

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGKILL)
SETTINGS = {"curves": "24", "iterations": "150", "device": "cpu"}
MANY = ("a.png", "b.png", "c.png", "d.png")
INPUTS = {"vectorize": MANY[:1], "batch": MANY[:3], "workers": MANY, "minified": MANY}
FLAGS = tuple(f"--{k}={v}" for k, v in SETTINGS.items())
ARGUMENTS = {
    "vectorize": ("vectorize", "a.png", *FLAGS),
    "batch": ("batch", "jobs.yaml", "--workers=1"),
    "workers": ("batch", ".", "--workers=2", "--threads=1", *FLAGS),
    "minified": ("batch", ".", "--workers=2", "--threads=1", "--minify", *FLAGS),
}


def lay_out(folder: Path, command: str) -> None:
    """Make a command's inputs."""
    for seed, name in enumerate(INPUTS[command]):
        make_image(folder / name, seed)
    if command == "batch":
        values = {**SETTINGS, "curves": int(SETTINGS["curves"]), "iterations": int(SETTINGS["iterations"])}
        (folder / "jobs.yaml").write_text(json.dumps({"defaults": values, "jobs": [{"images": "*.png"}]}))


def start(folder: Path, command: str, cache: Path | None = None) -> subprocess.Popen[str]:
    """Start a command; ``cache``: folder of its compiled kernels, if not the usual one."""
    environment = {**os.environ, "PYTHONPATH": str(ROOT), TOKEN: str(folder)}
    return subprocess.Popen(
        [sys.executable, "-m", "warpsplat", *ARGUMENTS[command]],
        cwd=folder,
        env=environment | ({"WARP_CACHE_PATH": str(cache)} if cache else {}),
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


TOKEN = "WARPSPLAT_KILLS"
"""Environment variable that marks all processes of a run."""


def orphans(folder: Path) -> list[int]:
    """Return the processes of a run in ``folder`` that live a second after it; Linux only."""
    found: list[int] = []
    for _ in range(10):
        found = []
        for entry in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                if f"{TOKEN}={folder}\0".encode() in (entry / "environ").read_bytes():
                    found.append(int(entry.name))
        if not found:
            break
        time.sleep(0.1)
    return found


def manifest_faults(folder: Path) -> list[str]:
    """Return what is wrong with a finished batch's manifest: it has each result once, with its digest."""
    entries = [entry_of(line) for line in (folder / NAME).read_bytes().splitlines() if line]
    made = [entry for entry in entries if entry and entry.event == "made"]
    latest = {entry.output: entry.digest for entry in made}
    digests = {name: hashlib.sha256(data).hexdigest() for name, data in results(folder).items()}
    faults = [] if latest == digests else ["the manifest says something else"]
    keys = Counter((entry.output, entry.key) for entry in made)
    return faults + [f"{output} was made {count} times" for (output, _), count in keys.items() if count > 1]


def results(folder: Path) -> dict[str, bytes]:
    """Return the SVGs in ``folder``."""
    return {path.name: path.read_bytes() for path in folder.glob("*.svg")}


def broken(folder: Path) -> list[str]:
    """Return the results that are no complete SVG."""
    found = []
    for name, data in results(folder).items():
        try:
            render_svg(data.decode(), width=32, height=24)
            is_whole = data.rstrip().endswith(b"</svg>")
        except (WarpsplatError, UnicodeDecodeError):
            is_whole = False
        found += [] if is_whole else [name]
    return found


COMPILING = 8.0
"""Time to compile the kernels [s], in native code that a signal does not interrupt."""

LATE = 5.0
"""Longest time from a signal to the end of a run [s], on a busy machine."""

ENDING = 0.3
"""Time of Python's own end [s], in which a signal no longer changes the exit code."""


class Kill(NamedTuple):
    """A run that was ended, and the next one."""

    command: str
    cold: bool
    """Whether it had to compile its kernels."""
    signal: str
    moment: float
    """[s] after the start."""
    code: int
    wait: float
    """From the signal to the end [s]."""
    faults: list[str]

    def line(self) -> str:
        return (
            f"{self.command:10}{'cold' if self.cold else 'warm':5}{self.signal:8}{self.moment:6.2f} s  "
            f"{self.code:5}{self.wait:7.2f} s  {'; '.join(self.faults) or 'ok'}"
        )


def kill_once(
    rng: random.Random,
    scratch: Path,
    whole: dict[str, dict[str, bytes]],
    span: dict[str, float],
    signals: Sequence[signal.Signals],
    chance: float,
) -> Kill | None:
    """End a run at a random moment, then run again; None: the run was done before that moment.

    Half of the runs find old results, and some, with a probability of ``chance``, no kernels.
    """
    command, number, cold = rng.choice(list(whole)), rng.choice(signals), rng.random() < chance
    folder, cache = scratch / "folder", scratch / "cache" if cold else None
    folder.mkdir()
    lay_out(folder, command)
    if rng.random() < 0.5 and command != "minified":  # minified files would not be known as ours
        for name, data in whole[command].items():
            # An older version's, so that a batch makes it again.
            (folder / name).write_bytes(data.replace(b"<!--warpsplat ", b"<!--warpsplat 0"))
    before = results(folder)
    moment = rng.uniform(0, span[command] + (COMPILING if cold else 0))
    process = start(folder, command, cache)
    time.sleep(moment)
    if process.poll() is not None:
        process.communicate()
        return None
    process.send_signal(number)
    sent = time.monotonic()
    try:
        stderr = process.communicate(timeout=60)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        stderr = process.communicate()[1]
    wait, code = time.monotonic() - sent, process.returncode
    faults = [f"process {number} lives on" for number in orphans(folder)]
    faults += [f"{name} is not whole" for name in broken(folder)]
    faults += [f"{name} is gone" for name in before if name not in results(folder)]
    # Python may be interrupted before a line of this program runs, and prints a traceback then.
    begun = "warpsplat" in stderr or "Traceback" not in stderr
    # 0: just done; minus the signal: Python had not begun, or was ending; 128 + signal: as in a shell.
    if code not in (0, 128 + number, -number) and begun:
        faults.append(f"exit code {code}")
    if "Traceback" in stderr and begun:
        faults.append("traceback")
    if wait > (LATE + COMPILING if cold else LATE):
        faults.append("late")
    if code == 0 and wait > ENDING:
        faults.append("went on")
    again = start(folder, command, cache)
    again.communicate(timeout=600)
    if again.returncode:
        faults.append(f"next run: exit code {again.returncode}")
    if results(folder) != whole[command]:
        faults.append("next run: other results")
    if command != "vectorize":
        faults += [f"next run: {fault}" for fault in manifest_faults(folder)]
    known = {*INPUTS[command], *whole[command], "jobs.yaml", NAME}
    faults += [f"next run: left {name}" for name in os.listdir(folder) if name not in known]
    return Kill(command, cold, number.name, moment, code, wait, faults)


def main() -> None:
    """Run and print the table."""
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz.kills", description=__doc__)
    parser.add_argument("--count", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--commands", nargs="+", choices=ARGUMENTS, default=list(ARGUMENTS))
    parser.add_argument("--signals", nargs="+", choices=[s.name for s in SIGNALS], default=None)
    parser.add_argument("--cold", type=float, default=0.1, help="share of runs without compiled kernels")
    given = parser.parse_args()
    signals = [s for s in SIGNALS if not given.signals or s.name in given.signals]
    rng = random.Random(given.seed)
    whole: dict[str, dict[str, bytes]] = {}
    span: dict[str, float] = {}
    for command in given.commands:
        for _ in range(2):  # the first one may compile
            with tempfile.TemporaryDirectory() as scratch:
                lay_out(Path(scratch), command)
                begin = time.monotonic()
                stderr = start(Path(scratch), command).communicate()[1]
                span[command] = time.monotonic() - begin
                whole[command] = results(Path(scratch))
                assert len(whole[command]) == len(INPUTS[command]), stderr
    kills: list[Kill] = []
    while len(kills) < given.count:
        with tempfile.TemporaryDirectory() as scratch:
            kill = kill_once(rng, Path(scratch), whole, span, signals, given.cold)
        if kill:
            kills.append(kill)
            print(kill.line(), flush=True)
    print()
    counts = Counter((k.command, k.signal, k.code, bool(k.faults)) for k in kills)
    for (command, name, code, is_faulty), count in sorted(counts.items()):
        print(f"{command:10}{name:9} exit {code:4}  {'FAULTY' if is_faulty else 'ok':7}{count:4}")
    faulty = sum(bool(k.faults) for k in kills)
    slowest = max((k.wait for k in kills), default=0.0)
    print(f"{len(kills)} runs ended, {faulty} with faults; the longest wait after a signal: {slowest:.2f} s")
    sys.exit(bool(faulty))


if __name__ == "__main__":
    main()
