"""``eval``: the figures of a file against an image."""

from __future__ import annotations

import json
from pathlib import Path

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


def test_reports_have_ssimulacra2(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    first, second = tmp_path / "a.svg", tmp_path / "b.svg"
    runs = (
        ("vectorize", image, "-o", first, *QUICK),
        ("refine", first, image, "-o", second, "--iterations", "3", "--device", "cpu"),
    )
    for arguments in runs:
        assert run(*arguments) == 0
        line = one_line(capsys.readouterr().out)
        assert run(*arguments, "--json") == 0
        assert f", SSIMULACRA2 {json.loads(capsys.readouterr().out)['ssimulacra2']:.1f}" in line
    assert run("eval", image, first) == 0
    assert "ssimulacra2 " in capsys.readouterr().out
