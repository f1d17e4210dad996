"""``info`` and ``--version``."""

from __future__ import annotations

from tests.cli.helpers import Cli
from warpsplat import __version__


def test_version(cli: Cli) -> None:
    assert __version__ in cli("--version").out


def test_info(cli: Cli) -> None:
    values = cli("info", "--json").values
    assert values["warpsplat"] == __version__
    assert "cpu" in [d["name"] for d in values["devices"]]
    assert "(default)" in cli("info").out
