"""Options are declared once: flags, keys of batch files, keywords and documentation are made from that."""

from __future__ import annotations

import inspect
import runpy
from pathlib import Path

import click
import pytest

import warpsplat
from tests import ROOT
from warpsplat.cli.vectorize import command
from warpsplat.errors import UsageError
from warpsplat.fit.options import Option
from warpsplat.run import options
from warpsplat.run.options import OPTIONS, RESEARCH_KEYS, settings_from

MADE = runpy.run_path(str(ROOT / "docs" / "option_tables.py"))


@pytest.mark.parametrize("option", OPTIONS, ids=lambda o: o.name)
def test_flags_keys_keywords_and_rows(option: Option) -> None:
    flags = {name: p for p in command.params if isinstance(p, click.Option) for name in p.opts}
    flag = flags[f"--{option.name}"]
    assert option.value is not None or command.make_context("vectorize", ["a.png"]).params[flag.name] is None
    assert (flag.help or "").startswith(option.help)
    assert option.keyword in inspect.signature(warpsplat.vectorize).parameters
    assert f"<code>--{option.name}" in MADE["tables"]("options")


def test_what_is_made_is_current() -> None:
    assert MADE["TYPED"].read_text("utf-8") == MADE["typed_options"](), "python docs/option_tables.py"
    rows = MADE["tables"]("research")
    assert all(
        f"| <code>{key}</code> |" in rows for key in (*RESEARCH_KEYS, "rates", "density", "density.stop")
    )


def test_a_palette_is_read_up_to_its_limit(tmp_path: Path) -> None:
    path = tmp_path / "colors.txt"
    path.write_text("#ff0000 " * (options.PALETTE_BYTES // 8))
    assert len(settings_from({"palette": str(path)}).palette) == 1
    with path.open("a") as file:
        file.write("#00ff00")
    with pytest.raises(UsageError, match=f"has more than {options.PALETTE_BYTES} bytes"):
        settings_from({"palette": str(path)})


@pytest.mark.skipif(not Path("/dev/zero").exists(), reason="the system has no device without an end")
def test_a_palette_without_an_end_is_refused() -> None:
    with pytest.raises(UsageError, match="/dev/zero: has more than"):
        settings_from({"palette": "/dev/zero"})
