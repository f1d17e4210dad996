"""A CUDA device without a GPU: Warp's runtime sees ``cuda:0``, and what its host code does wrong is found.

The functions of Warp's native library that have to do with CUDA are replaced (``driver.py``); of its Python
nothing is. Device memory is a region of the process that host code cannot touch (``memory.py``). Work is done
only when something waits for it, in the order that streams and events ask for and no other, so that a missing
wait shows (``streams.py``). Kernels are those of the CPU. What a GPU answers with an error is answered with
that error; what it would let pass, and is wrong, is a broken rule (``rules.py``).

Not modelled: threads of a kernel that run at the same time, the compiler of device code, devices that see
each other's memory, indexed arrays, forks in a capture.

    python -m tests.fake_cuda -m warpsplat vectorize photo.jpg --device cuda:0
    pytest --device fake-cuda tests/rendering
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import asdict, dataclass, replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

from tests import ROOT

NAME = "fake-cuda"
"""Name of the device for ``pytest --device``."""

VERSIONS = ("1.19.",)
"""Versions of Warp whose native functions are replaced here: they are not a public interface."""

SUPPORTED = sys.platform == "linux" and version("warp-lang").startswith(VERSIONS)

VARIABLE = "WARPSPLAT_FAKE_CUDA"
"""Environment variable with the options, as JSON; processes that find it have the devices."""


@dataclass
class Options:
    """How the devices are, and what of them fails."""

    devices: int = 1
    memory: int = 2 << 30
    """Bytes that can be allocated on each."""
    arch: int = 90
    """Compute capability, as in sm_90."""
    driver: int = 0
    """Version of the driver as CUDA counts, such as 12020; 0: that of Warp's toolkit."""
    pools: bool = True
    """Whether there are memory pools, which stream-ordered allocation needs."""
    fail: str = ""
    """Failure to inject: context, compile, load, capture, graph, or the N-th launch and all that follow it,
    at once (``launch:N``) or when something waits for it (``sync:N``)."""
    protect: bool = True
    """Whether host code that touches device memory is ended (SIGSEGV)."""
    log: str = ""
    """File to which broken rules are added."""


options = Options(**json.loads(os.environ.get(VARIABLE, "{}")))
"""Those of this process. What fails, and how much memory there is, may change at any time."""


def environment(chosen: Options) -> dict[str, str]:
    """Return the environment of a process that has the devices, as those that it starts have."""
    paths = [str(ROOT / "tests/fake_cuda/site"), str(ROOT), os.environ.get("PYTHONPATH", "")]
    return {
        **os.environ,
        VARIABLE: json.dumps(asdict(chosen)),
        "PYTHONPATH": os.pathsep.join(filter(None, paths)),
        "PYTHONFAULTHANDLER": "1",
    }


def run(
    *arguments: str, cwd: Path | str | None = None, check: bool = True, **chosen: Any
) -> subprocess.CompletedProcess[str]:
    """Run Python with ``arguments`` in a process that has the devices of ``Options(**chosen)``.

    Where the test device is not supported, the test is skipped.

    Raises:
        AssertionError: a rule was broken, and ``check``.
    """
    if not SUPPORTED:
        import pytest

        pytest.skip(f"the test device knows Warp {VERSIONS[0]}x on Linux")
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder, "broken")
        environ = environment(replace(Options(**chosen), log=str(log)))
        done = subprocess.run(
            [sys.executable, *arguments], capture_output=True, text=True, env=environ, cwd=cwd, check=False
        )
        broken = log.read_text() if log.exists() else ""
    assert not (check and broken), broken + done.stderr
    return done
