"""The figures of eval and the objects of --json: the same by every command."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from tests.cli.helpers import MANIFEST, QUICK, Cli, one_line, run


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    cells = np.random.default_rng(0).integers(0, 2, (12, 12, 1), dtype=np.uint8).repeat(3, 2) * 255
    Image.fromarray(cells).save("cells.png")
    noise = np.random.default_rng(0).integers(0, 255, (24, 32, 3), dtype=np.uint8)
    Image.fromarray(noise).save("noise.png")


@pytest.fixture
def printed(capfd: pytest.CaptureFixture[str]) -> Any:
    def printed(*words: object) -> Any:
        capfd.readouterr()
        assert run(*words, "--json") == 0
        return json.loads(capfd.readouterr().out.splitlines()[0], parse_constant=pytest.fail)

    return printed


def test_an_exact_file(printed: Any, cli: Cli) -> None:
    assert run("vectorize", "cells.png", "--subject", "pixel") == 0
    found = [
        printed("vectorize", "cells.png", "--subject", "pixel"),
        printed("eval", "cells.png", "cells.svg"),
        printed("batch", "cells.png", "--subject", "pixel", "-o", "out"),
        printed("batch", "cells.png", "--subject", "pixel", "-o", "out"),  # skipped: from the manifest
        json.loads(Path("out", MANIFEST).read_text().splitlines()[0])["figures"],
    ]
    assert all(each["exact"] is True and each.get("psnr") is None for each in found)
    made = printed("vectorize", "noise.png", *QUICK)
    assert made["exact"] is False and made["psnr"] > 5
    again = printed("refine", "cells.svg", "cells.png", "-o", "b.svg", "--iterations", 1, "--device", "cpu")
    assert (again["psnr_before"], again["psnr"], again["exact"]) == (None, None, True)
    assert cli("eval", "cells.png", "cells.svg").out.splitlines()[0].split() == ["psnr", "exact"]


@pytest.mark.parametrize("command", ["vectorize", "refine", "several", "batch"])
def test_the_device_that_was_used(printed: Any, command: str, device: str) -> None:
    """``auto`` is no device."""
    effort = ["--iterations", 2]
    if command == "refine":
        assert run("vectorize", "noise.png", *QUICK) == 0
        words = ["refine", "noise.svg", "noise.png", "-o", "b.svg", *effort]
    else:
        words = ["batch" if command == "batch" else "vectorize", "noise.png", *effort]
        words += ["--curves", "4,8" if command == "several" else "4"]
    found = printed(*words)
    assert (found[0] if command == "several" else found)["device"] == device


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
