"""One home of options: flags, keys of batch files and the docs' table say the same."""

from __future__ import annotations

import re
from pathlib import Path

import click
import pytest

from tests import ROOT
from warpsplat.cli.vectorize import command
from warpsplat.errors import UsageError
from warpsplat.fit.settings import Settings, make_settings
from warpsplat.run import options
from warpsplat.run.options import OPTIONS, Option, settings_from

TABLE = (ROOT / "docs" / "settings.md").read_text(encoding="utf-8")
ROWS = [
    [cell.strip() for cell in line.strip("|").split("|")] for line in TABLE.splitlines() if line[:3] == "| `"
]


@pytest.mark.parametrize("option", OPTIONS, ids=lambda o: o.name)
def test_flags_keys_and_readme(option: Option) -> None:
    flags = {name: p for p in command.params if isinstance(p, click.Option) for name in p.opts}
    flag = flags[f"--{option.name}"]
    assert option.kind is not None or command.make_context("vectorize", ["a.png"]).params[flag.name] is None
    assert option.help.rstrip(".") in (flag.help or "")
    rows = [row for row in ROWS if re.search(rf"`--{option.name}[ `]", row[0])]
    assert len(rows) == 1, "a row of the table"
    if option.default and option.kind is None:
        assert rows[0][2].strip("`") == option.default


@pytest.mark.parametrize("option", OPTIONS, ids=lambda o: o.name)
def test_a_default_is_what_a_run_takes(option: Option) -> None:
    settings = make_settings()
    if option.kind is not None:
        assert (settings.kind == option.kind) == bool(option.default)
    elif option.default and hasattr(settings, option.setting):
        value = getattr(settings, option.setting)
        assert ("auto" if value is None else str(value)) == option.default.partition(";")[0]
    else:
        assert option.name in {"quality", "layered"} or option.setting in Settings.__dataclass_fields__


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
