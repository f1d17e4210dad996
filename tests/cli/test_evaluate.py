"""``eval``: the figures of a file against an image."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.cli.helpers import QUICK, Cli, one_line, run


def test_eval(image: Path, tmp_path: Path, cli: Cli) -> None:
    output = tmp_path / "a.svg"
    made = cli("vectorize", image, "-o", output, "--json", *QUICK).values
    values = cli("eval", image, output, "--json").values
    assert all(
        values[k] == made[k] for k in ("psnr", "ssim", "ms_ssim", "paths", "nodes", "bytes", "gzip_bytes")
    )
    assert f"{made['psnr']} dB" in cli("eval", image, output).out


def test_reports_have_ssimulacra2(
    image: Path, tmp_path: Path, capfd: pytest.CaptureFixture[str], cli: Cli
) -> None:
    first, second = tmp_path / "a.svg", tmp_path / "b.svg"
    runs = (
        ("vectorize", image, "-o", first, *QUICK),
        ("refine", first, image, "-o", second, "--iterations", "3", "--device", "cpu"),
    )
    for arguments in runs:
        line = one_line(cli(*arguments).out)
        assert run(*arguments, "--json") == 0
        assert f", SSIMULACRA2 {json.loads(capfd.readouterr().out)['ssimulacra2']:.1f}" in line
    assert "ssimulacra2 " in cli("eval", image, first).out
