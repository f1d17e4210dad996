"""Compare a step of two installs, or on two devices: short rounds of each in turn, each a process."""

from __future__ import annotations

import contextlib
import json
import os
import platform
import re
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import warpsplat
from warpsplat.errors import UsageError, counted, shown

LABELS = {"step": "step", "forward_backward": "forward + backward", "through_torch": "through PyTorch"}
"""Names of times in the table, besides those of stages."""

HERE = str(Path(warpsplat.__file__).resolve().parent.parent)
"""Folder that this process imports warpsplat from."""


@dataclass(frozen=True)
class Side:
    """A warpsplat and the device that it runs on."""

    python: str
    """Path of the interpreter."""
    folder: str | None
    """Folder that it imports warpsplat from; None: as installed."""
    device: str

    def run(self, *arguments: str) -> dict[str, Any]:
        """Return what a command prints as JSON; raise ``UsageError`` if it fails."""
        environment = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
        if self.folder is not None:
            environment["PYTHONPATH"] = self.folder
        command = [self.python, "-m", "warpsplat", *arguments, "--json"]
        try:
            with tempfile.TemporaryDirectory() as elsewhere:  # python -m looks in the working folder first
                done = subprocess.run(
                    command, env=environment, cwd=elsewhere, capture_output=True, text=True, check=False
                )
            if not done.returncode:
                return dict(json.loads(done.stdout))
            said = done.stderr.strip().splitlines()[-1:] or [f"exit status {done.returncode}"]
        except (OSError, ValueError) as error:
            said = [str(error)]
        raise UsageError(f"{self.folder or self.python}: {said[0]}")

    def described(self) -> dict[str, Any]:
        """Return what is run: paths and versions."""
        info = self.run("info")
        versions = {name: info[name] for name in ("warpsplat", "warp", "python")}
        return {"python": self.python, "folder": self.folder, "versions": versions}


def sides(against: str, device: str) -> tuple[Side, Side]:
    """Return this warpsplat on ``device``, and what it is compared with.

    ``against``: another device; a folder with another copy of warpsplat; or another Python, for its own.
    Anything else raises ``UsageError``.
    """
    this = Side(sys.executable, HERE, device)
    if re.fullmatch(r"cpu|cuda(:\d+)?", against):
        return this, Side(sys.executable, HERE, against)
    if (Path(against) / "warpsplat" / "__init__.py").is_file():
        return this, Side(sys.executable, str(Path(against).resolve()), device)
    found = shutil.which(against)
    if found is None:
        raise UsageError(
            f"{shown(against)} is no device (cpu, cuda:N), no folder with a warpsplat in it and no Python"
        )
    return this, Side(os.path.abspath(found), None, device)  # a link into a virtual environment stays one


def compare(both: Sequence[Side], options: Sequence[str], rounds: int) -> dict[str, Any]:
    """Time ``rounds`` rounds of each side with ``options`` of bench; who begins changes from round to round.

    Returns ``sides``: versions, device, and ``times`` [ms]: median, lowest, highest of the rounds' medians;
    and ``ratios``: the same of the second side's time over the first one's in the same round.
    """
    found: list[list[dict[str, Any]]] = [[], []]
    for number in range(rounds):
        for i in (0, 1) if number % 2 == 0 else (1, 0):
            found[i].append(both[i].run("bench", *options, "--device", both[i].device))
    medians = [[_medians(values) for values in own] for own in found]
    names = [name for name in medians[0][0] if name in medians[1][0]]
    described = [
        {
            **side.described(),
            **{name: own[0][name] for name in ("device", "device_name", "threads")},
            "times": {name: _spread([values[name] for values in each]) for name in names},
        }
        for side, own, each in zip(both, found, medians, strict=True)
    ]
    ratios = {
        name: _spread([other[name] / this[name] for this, other in zip(*medians, strict=True)])
        for name in names
    }
    scene = {name: found[0][0][name] for name in ("kind", "shapes", "width", "height", "opacity", "renderer")}
    return {**scene, "processor": processor(), "rounds": rounds, "sides": described, "ratios": ratios}


def processor() -> str:
    """Return the name of this machine's processor, or of its kind where the system does not say."""
    with contextlib.suppress(OSError):  # not Linux
        names = re.findall(r"model name\s*: (.+)", Path("/proc/cpuinfo").read_text())
        return str(names[0]) if names else platform.machine()
    return platform.processor() or platform.machine()


def _medians(values: dict[str, Any]) -> dict[str, float]:
    """Return the medians of what ``bench`` timed, those that are not too short for its clock."""
    times = {"step": values["step"], "forward_backward": values["forward_backward"], **values["stages"]}
    if "through_torch" in values:
        times["through_torch"] = values["through_torch"]["torch"]
    return {name: spread["median"] for name, spread in times.items() if spread["median"] > 0}


def _spread(values: Sequence[float]) -> dict[str, float]:
    found = {"median": statistics.median(values), "low": min(values), "high": max(values)}
    return {name: round(value, 3) for name, value in found.items()}


def table(values: dict[str, Any]) -> str:
    """Return the results of ``compare`` as text."""
    this, other = values["sides"]
    lines = [
        f"{values['kind']}, {counted(values['shapes'], 'shape')}, {values['width']}x{values['height']} px, "
        f"opacity {values['opacity']:g}, {values['renderer']} renderer; {values['rounds']} rounds of each "
        f"in turn on {values['processor']}"
    ]
    for name, side in (("this", this), ("other", other)):
        versions = side["versions"]
        where = side["folder"] or side["python"]
        device = (
            f"cpu, {counted(side['threads'], 'thread')}"
            if side["device"] == "cpu"
            else f"{side['device']} ({side['device_name']})"
        )
        lines.append(
            f"{name + ':':7}warpsplat {versions['warpsplat']} of {where}, Warp {versions['warp']}, "
            f"Python {versions['python']}; {device}"
        )
    lines.append(f"{'':20}{'this':>9}{'low':>9}{'high':>9}{'other':>11}{'low':>9}{'high':>9}  ms")
    lines[-1] += f"{'ratio':>9}{'low':>7}{'high':>7}"
    for name, ratio in values["ratios"].items():
        one, two = (side["times"][name] for side in (this, other))
        numbers = "".join(f"{one[key]:9.2f}" for key in ("median", "low", "high"))
        numbers += "  " + "".join(f"{two[key]:9.2f}" for key in ("median", "low", "high"))
        ratios = f"{ratio['median']:9.2f}{ratio['low']:7.2f}{ratio['high']:7.2f}"
        lines.append(f"{LABELS.get(name, '  ' + name):20}{numbers}    {ratios}")
    step = values["ratios"]["step"]
    apart = step["low"] > 1 or step["high"] < 1
    verdict = f"a step of the other takes {step['median']:.2f} times as long"
    lines.append(verdict + ("" if apart else ", but in some rounds it is the other way round"))
    return "\n".join(lines)
