"""``info`` and ``--version``."""

from __future__ import annotations

import json

import pytest

from tests.cli.helpers import run
from warpsplat import __version__


def test_version(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("--version") == 0
    assert __version__ in capsys.readouterr().out


def test_info(capsys: pytest.CaptureFixture[str]) -> None:
    assert run("info", "--json") == 0
    values = json.loads(capsys.readouterr().out)
    assert values["warpsplat"] == __version__
    assert "cpu" in [d["name"] for d in values["devices"]]
    assert run("info") == 0
    assert "(default)" in capsys.readouterr().out
