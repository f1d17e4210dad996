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
    for bad in (image, tmp_path / "none.svg"):
        assert run("eval", image, bad) == 3
        assert bad.name in one_line(capsys.readouterr().err)
