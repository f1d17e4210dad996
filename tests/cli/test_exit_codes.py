"""The table of exit codes: each kind of success, failure and interruption in each command."""

from __future__ import annotations

import errno
import json
import os
import re
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import warp as wp
from PIL import Image

from tests import ROOT, make_image
from tests.cli.helpers import MANIFEST, Cli
from tests.fuzz.corpus import own_svg
from warpsplat.errors import ExitCode

CPU = "--device cpu"
QUICK = f"{CPU} --curves 4 --iterations 4"
REFINE = f"{CPU} --iterations 2"

Patch = Callable[[pytest.MonkeyPatch], None]


def _raising(owner: Any, name: str, error: BaseException) -> Patch:
    """Have a library's function fail."""

    def fail(*_: object, **__: object) -> None:
        raise error

    return lambda patch: patch.setattr(owner, name, fail)


NO_SPACE = _raising(os, "fsync", OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)))
NO_MEMORY = _raising(wp, "launch", MemoryError())
NO_MEMORY_FOR_PIXELS = _raising(Image, "open", MemoryError())
FAULT = _raising(wp, "launch", RuntimeError("a fault\nof two lines"))
FAULT_OF_JSON = _raising(json, "dumps", RuntimeError("a fault\nof two lines"))


def CTRL_C(patch: pytest.MonkeyPatch) -> None:  # noqa: N802 - stands among the others in the table
    """Interrupt the process as soon as it handles pixels."""
    original = np.asarray

    def interrupting(*arguments: Any, **named: Any) -> Any:
        patch.setattr(np, "asarray", original)
        os.kill(os.getpid(), signal.SIGINT)
        return original(*arguments, **named)

    patch.setattr(np, "asarray", interrupting)


TABLE: list[tuple[ExitCode, str, str, Patch | None]] = [
    # exit code, what is wrong, command line, what fails underneath
    (ExitCode.DONE, "nothing", f"vectorize photo.png {QUICK}", None),
    (ExitCode.DONE, "nothing", "batch good.yaml", None),
    (ExitCode.DONE, "nothing", f"refine drawing.svg photo.png -o a.svg {REFINE}", None),
    (ExitCode.DONE, "nothing", "eval photo.png drawing.svg", None),
    (ExitCode.DONE, "nothing", "render drawing.svg -o a.png", None),
    (ExitCode.DONE, "nothing", "bench --curves 4 --size 32x32 --repeats 1", None),
    (ExitCode.DONE, "nothing", "info", None),
    (ExitCode.INTERNAL, "a fault of the program", f"vectorize photo.png {QUICK}", FAULT),
    (ExitCode.INTERNAL, "a fault of the program", f"refine drawing.svg photo.png -o a.svg {REFINE}", FAULT),
    (ExitCode.INTERNAL, "a fault of the program", "eval photo.png drawing.svg --json", FAULT_OF_JSON),
    (ExitCode.INTERNAL, "a fault of the program", "bench --curves 4 --size 32x32", FAULT),
    (ExitCode.INPUT, "no permission for the image", "vectorize photo.png",
     _raising(Path, "open", PermissionError(errno.EACCES, os.strerror(errno.EACCES)))),
    (ExitCode.OUTPUT, "disk full", f"vectorize photo.png {QUICK}", NO_SPACE),
    (ExitCode.OUTPUT, "disk full", f"refine drawing.svg photo.png -o a.svg {REFINE}", NO_SPACE),
    (ExitCode.OUTPUT, "disk full", "render drawing.svg -o a.png", NO_SPACE),
    (ExitCode.SOME_FAILED, "an image of a batch is none", "batch broken.yaml", None),
    (ExitCode.SOME_FAILED, "disk full", "batch good.yaml", NO_SPACE),
    (ExitCode.SOME_FAILED, "no memory for an image of a batch", "batch good.yaml", NO_MEMORY),
    (ExitCode.SOME_FAILED, "a fault of the program in a batch", "batch good.yaml", FAULT),
    (ExitCode.GOAL_MISSED, "target PSNR missed", f"vectorize photo.png {QUICK} --target-psnr 90", None),
    (ExitCode.GOAL_MISSED, "size missed", f"vectorize photo.png {QUICK} --max-bytes 10", None),
    (ExitCode.GOAL_MISSED, "time missed", f"vectorize photo.png {QUICK} --time-budget 1ms", None),
    (ExitCode.GOAL_MISSED, "time missed",
     f"refine drawing.svg photo.png -o a.svg {CPU} --time-budget 1ms", None),
    (ExitCode.GOAL_MISSED, "target PSNR missed", "batch missed.yaml", None),
    (ExitCode.RESOURCES, "no memory", f"vectorize photo.png {QUICK}", NO_MEMORY),
    (ExitCode.RESOURCES, "no memory", f"refine drawing.svg photo.png -o a.svg {REFINE}", NO_MEMORY),
    (ExitCode.RESOURCES, "no memory", "bench --curves 4 --size 32x32", NO_MEMORY),
    (ExitCode.RESOURCES, "no memory for the pixels", f"vectorize photo.png {QUICK}", NO_MEMORY_FOR_PIXELS),
    (ExitCode.RESOURCES, "no memory for the pixels", "eval photo.png drawing.svg", NO_MEMORY_FOR_PIXELS),
    (ExitCode.RESOURCES, "no process to draw in", "render drawing.svg -o a.png",
     _raising(subprocess, "Popen", OSError(errno.EAGAIN, os.strerror(errno.EAGAIN)))),
    (ExitCode.INTERRUPTED, "Ctrl-C", f"vectorize photo.png {QUICK}", CTRL_C),
    (ExitCode.INTERRUPTED, "Ctrl-C", "batch good.yaml", CTRL_C),
    (ExitCode.INTERRUPTED, "Ctrl-C", f"refine drawing.svg photo.png -o a.svg {REFINE}", CTRL_C),
    (ExitCode.INTERRUPTED, "Ctrl-C", "eval photo.png drawing.svg", CTRL_C),
]  # fmt: skip
"""Refused commands: ``test_refusals.py``. Signals at each stage: ``test_stages.py``. Full streams:
``test_limits.py``.
"""


@pytest.fixture(scope="module")
def inputs(tmp_path_factory: pytest.TempPathFactory) -> dict[str, bytes]:
    scratch = tmp_path_factory.mktemp("inputs") / "photo.png"
    make_image(scratch)
    options = "iterations: 4, curves: 4, device: cpu"
    return {
        "photo.png": scratch.read_bytes(),
        "broken.png": b"no image",
        "drawing.svg": own_svg("fill"),
        "good.yaml": f"jobs: [{{images: photo.png, {options}}}]".encode(),
        "broken.yaml": f"jobs: [{{images: [photo.png, broken.png], {options}}}]".encode(),
        "missed.yaml": f"jobs: [{{images: photo.png, target-psnr: 90, {options}}}]".encode(),
    }


@pytest.mark.parametrize(
    ("code", "line", "patch"),
    [pytest.param(c, line, p, id=f"{int(c)}-{line.split()[0]}-{what}") for c, what, line, p in TABLE],
)
def test_exit_code(
    tmp_path: Path, inputs: dict[str, bytes], cli: Cli, code: ExitCode, line: str, patch: Patch | None
) -> None:
    for name, data in inputs.items():
        (tmp_path / name).write_bytes(data)
    with pytest.MonkeyPatch.context() as patched:
        patched.chdir(tmp_path)
        if patch:
            patch(patched)
        said = cli(*line.split(), code=code).err
    assert "Traceback" not in said
    assert ("goal missed: " in said) == (code == ExitCode.GOAL_MISSED)
    if code not in (ExitCode.DONE, ExitCode.SOME_FAILED) and not line.startswith("batch"):
        assert re.fullmatch(r"\n?warpsplat: .*\n", said), "one line on stderr"
    assert {n: (tmp_path / n).read_bytes() for n in inputs} == inputs, "inputs are as they were"
    written = set(os.listdir(tmp_path)) - set(inputs) - {MANIFEST}
    whole = code in (ExitCode.DONE, ExitCode.GOAL_MISSED, ExitCode.SOME_FAILED)
    assert all(whole and Path(name).suffix in (".svg", ".png") for name in written), "nothing is half written"


def test_every_code_is_in_the_table() -> None:
    assert {code for code, *_ in TABLE} == set(ExitCode) - {ExitCode.TERMINATED, ExitCode.USAGE}


def test_the_docs_list_the_codes() -> None:
    page = (ROOT / "docs" / "settings.md").read_text("utf-8")
    section = page.split("## Exit codes")[1].split("\n#")[0]
    listed = [int(number) for number in re.findall(r"^\| (\d+) \|", section, re.MULTILINE)]
    assert listed == sorted(set(ExitCode)), "each code once, in order"


def test_help_lists_the_codes(cli: Cli) -> None:
    text = " ".join(cli("--help").out.split("Exit codes:")[1].split())
    listed = [int(number) for number in re.findall(r"(?:^|, )(\d+) ", text.split(".")[0] + " ")]
    assert listed == sorted(set(ExitCode))
