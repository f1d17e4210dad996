"""Runs of the command line, in this process or another."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable
from typing import Any, NamedTuple

import pytest

from warpsplat.cli.main import main

MANIFEST = "warpsplat-manifest.jsonl"
"""File that batches keep their notes in."""

QUICK = ["--curves", "8", "--iterations", "12", "--device", "cpu"]


def run(*arguments: object) -> int:
    """Exit code of the command line in this process."""
    with pytest.raises(SystemExit) as caught:
        main([str(a) for a in arguments])
    return int(caught.value.code or 0)


class Said(NamedTuple):
    """What a command printed."""

    out: str
    err: str

    @property
    def line(self) -> str:
        """The only line on the standard error."""
        return one_line(self.err)

    @property
    def values(self) -> Any:
        """The object of ``--json``."""
        return json.loads(self.out)


Cli = Callable[..., Said]
"""The fixture ``cli``: runs the command line in this process, which must end with ``code``."""


def one_line(text: str) -> str:
    lines = text.strip().splitlines()
    assert len(lines) == 1, text
    assert "Traceback" not in text
    return lines[0]


def python(
    *arguments: object, given: bytes = b"", folder: str | None = None, **environment: str
) -> subprocess.CompletedProcess[bytes]:
    """Run Python in a process of its own."""
    command, more = [sys.executable, *map(str, arguments)], os.environ | environment
    return subprocess.run(
        command, input=given, cwd=folder, env=more, capture_output=True, timeout=120, check=False
    )
