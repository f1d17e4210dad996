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
from dataclasses import dataclass
from pathlib import Path

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
    """Start a command; ``cache``: where its compiled kernels are, if not where they always are."""
    return subprocess.Popen(
        [sys.executable, "-m", "warpsplat", *ARGUMENTS[command]],
        cwd=folder,
        env={
            **os.environ,
            "PYTHONPATH": str(ROOT),
            TOKEN: str(folder),
            **({"WARP_CACHE_PATH": str(cache)} if cache else {}),
        },
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
    )


TOKEN = "WARPSPLAT_KILLS"
"""Environment variable by which all processes of a run are known."""


def orphans(folder: Path) -> list[int]:
    """Processes of a run in ``folder`` that outlived it, a second later; Linux only."""
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


def noted(folder: Path) -> list[str]:
    """What is wrong with the manifest of a batch that is done: each result is in it once, with its bytes."""
    entries = [entry_of(line) for line in (folder / NAME).read_bytes().splitlines() if line]
    made = [entry for entry in entries if entry and entry.event == "made"]
    latest = {entry.output: entry.digest for entry in made}
    digests = {name: hashlib.sha256(data).hexdigest() for name, data in results(folder).items()}
    faults = [] if latest == digests else ["the manifest says something else"]
    keys = Counter((entry.output, entry.key) for entry in made)
    return faults + [f"{output} was made {count} times" for (output, _), count in keys.items() if count > 1]


def results(folder: Path) -> dict[str, bytes]:
    """The SVGs that are there."""
    return {path.name: path.read_bytes() for path in folder.glob("*.svg")}


def broken(folder: Path) -> list[str]:
    """Results that are no whole SVG."""
    found = []
    for name, data in results(folder).items():
        try:
            render_svg(data.decode(), width=32, height=24)
        except (WarpsplatError, UnicodeDecodeError):
            found.append(name)
        else:
            if not data.rstrip().endswith(b"</svg>"):
                found.append(name)
    return found


COMPILING = 8.0
"""About what the kernels take to compile [s]; that is native code, which a signal does not reach."""

LATE = 5.0
"""A run must have ended so long after a signal [s], on a busy machine; the summary has the longest."""

ENDING = 0.3
"""What Python's own end takes [s]: a signal in it changes the exit code no more."""


@dataclass(frozen=True)
class Kill:
    """One run that was ended, and the next one."""

    command: str
    cold: bool
    """Whether it had to compile its kernels."""
    number: signal.Signals
    moment: float
    """[s] after the start."""
    code: int
    wait: float
    """From the signal to the end [s]."""
    left: str
    """What was there afterwards: "none", "old", "new", or "mixed" in a batch."""
    faults: tuple[str, ...]

    def line(self) -> str:
        """A row of the table."""
        return (
            f"{self.command:10}{'cold' if self.cold else 'warm':5}{self.number.name:8}{self.moment:6.2f} s  "
            f"{self.code:5}{self.wait:7.2f} s  {self.left:7}{'; '.join(self.faults) or 'ok'}"
        )


def _state(before: dict[str, bytes], after: dict[str, bytes], count: int) -> str:
    if not after:
        return "none"
    if after == before:
        return "old"
    return "new" if len(after) == count and all(after[n] != before.get(n) for n in after) else "mixed"


def kill_once(
    rng: random.Random,
    scratch: Path,
    whole: dict[str, dict[str, bytes]],
    span: dict[str, float],
    signals: Sequence[signal.Signals],
    chance: float,
) -> Kill | None:
    """End a run at a random moment, then run again; half of the runs find old results, some no kernels
    (with a probability of ``chance``).

    None where the run was done before that moment.
    """
    command, number, cold = rng.choice(list(whole)), rng.choice(signals), rng.random() < chance
    folder, cache = scratch / "folder", scratch / "cache" if cold else None
    folder.mkdir()
    lay_out(folder, command)
    if rng.random() < 0.5 and command != "minified":  # which would not be known as ours
        for name, data in whole[command].items():
            # An older version's, so that a batch makes it anew.
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
        said = process.communicate(timeout=60)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        said = process.communicate()[1]
    wait, code = time.monotonic() - sent, process.returncode
    faults = [f"process {number} lives on" for number in orphans(folder)]
    after = results(folder)
    faults += [f"{name} is not whole" for name in broken(folder)]
    faults += [f"{name} is gone" for name in before if name not in after]
    # Python's own start can be interrupted before a line of this program runs, and says so its own way.
    begun = "warpsplat" in said or "Traceback" not in said
    # 0: it was just done; minus the signal: Python had not begun, or was ending; a shell says 128 + it.
    if code not in (0, 128 + number, -number) and begun:
        faults.append(f"exit code {code}")
    if "Traceback" in said and begun:
        faults.append("traceback")
    if wait > (LATE + COMPILING if cold else LATE):
        faults.append("late")
    if code == 0 and wait > ENDING:
        faults.append("went on")
    again = start(folder, command, cache)
    said = again.communicate(timeout=600)[1]
    if again.returncode:
        faults.append(f"next run: exit code {again.returncode}")
    if results(folder) != whole[command]:
        faults.append("next run: other results")
    if command != "vectorize":
        faults += [f"next run: {fault}" for fault in noted(folder)]
    known = {*INPUTS[command], *whole[command], "jobs.yaml", NAME}
    faults += [f"next run: left {name}" for name in os.listdir(folder) if name not in known]
    left = _state(before, after, len(whole[command]))
    return Kill(command, cold, number, moment, code, wait, left, tuple(faults))


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
                said = start(Path(scratch), command).communicate()[1]
                span[command] = time.monotonic() - begin
                whole[command] = results(Path(scratch))
                assert len(whole[command]) == len(INPUTS[command]), said
    kills: list[Kill] = []
    while len(kills) < given.count:
        with tempfile.TemporaryDirectory() as scratch:
            kill = kill_once(rng, Path(scratch), whole, span, signals, given.cold)
        if kill:
            kills.append(kill)
            print(kill.line(), flush=True)
    print()
    counts = Counter((k.command, k.number.name, k.code, k.left, bool(k.faults)) for k in kills)
    for (command, name, code, left, is_faulty), count in sorted(counts.items()):
        print(f"{command:10}{name:9} exit {code:4}  {left:6} {'FAULTY' if is_faulty else 'ok':7}{count:4}")
    faulty = sum(bool(k.faults) for k in kills)
    slowest = max((k.wait for k in kills), default=0.0)
    print(f"{len(kills)} runs ended, {faulty} with faults; the longest wait after a signal: {slowest:.2f} s")
    sys.exit(bool(faulty))


if __name__ == "__main__":
    main()
