"""``eval``: the figures of a file against an image."""

from __future__ import annotations

import json
import sys
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import SimpleNamespace

import pytest

from tests.cli.helpers import QUICK, one_line, run


def test_eval(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output = tmp_path / "a.svg"
    assert run("vectorize", image, "-o", output, "--json", *QUICK) == 0
    made = json.loads(capsys.readouterr().out)
    assert run("eval", image, output, "--json") == 0
    values = json.loads(capsys.readouterr().out)
    assert all(
        values[k] == made[k] for k in ("psnr", "ssim", "ms_ssim", "paths", "nodes", "bytes", "gzip_bytes")
    )
    assert run("eval", image, output) == 0
    assert f"{made['psnr']} dB" in capsys.readouterr().out


@pytest.mark.parametrize("installed", [True, False])
def test_ssimulacra2_where_it_is_installed(
    image: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    monkeypatch: pytest.MonkeyPatch,
    installed: bool,
) -> None:
    """Reports have it; without its package nothing else changes."""
    package = None
    if installed:
        spec = ModuleSpec("ssimulacra2", None)
        package = SimpleNamespace(compute_ssimulacra2=lambda a, b: 61.256, __spec__=spec)
    monkeypatch.setitem(sys.modules, "ssimulacra2", package)
    figure, shown = (61.26, ", SSIMULACRA2 61.3") if installed else (None, "")
    first, second = tmp_path / "a.svg", tmp_path / "b.svg"
    runs = (
        ("vectorize", image, "-o", first, *QUICK),
        ("refine", first, image, "-o", second, "--iterations", "3", "--device", "cpu"),
    )
    for arguments in runs:
        assert run(*arguments) == 0
        line = one_line(capsys.readouterr().out)
        assert ("SSIMULACRA2" in line) == installed
        assert shown in line
        assert run(*arguments, "--json") == 0
        assert json.loads(capsys.readouterr().out)["ssimulacra2"] == figure
    assert run("eval", image, first) == 0
    assert f"ssimulacra2 {figure if installed else '-'}\n" in capsys.readouterr().out
