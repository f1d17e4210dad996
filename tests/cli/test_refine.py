"""``refine`` as a user meets it."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.helpers import one_line, run
from tests.svg.foreign import FOREIGN, HEAD


def test_outputs_and_standard_streams(
    tmp_path: Path, capsysbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (HEAD + FOREIGN["lines"]).encode()
    svg, image = tmp_path / "a.svg", tmp_path / "a.png"
    svg.write_bytes(text)
    Image.new("RGB", (40, 30), "red").save(image)
    quick = ("--iterations", 5, "--device", "cpu")
    assert run("refine", svg, image, "-o", svg, *quick) == 2
    assert svg.read_bytes() == text
    assert run("refine", svg, image, "-o", tmp_path / "b.txt", *quick) == 2
    assert run("refine", "-", "-", "-o", tmp_path / "b.svg", *quick) == 2
    capsysbinary.readouterr()

    class Stdin:
        buffer = io.BytesIO(text)

    monkeypatch.setattr("sys.stdin", Stdin)
    assert run("refine", "-", image, "-o", "-", "--json", *quick) == 0
    captured = capsysbinary.readouterr()
    assert captured.out.startswith(b"<svg")
    assert json.loads(captured.err)["bytes"] == len(captured.out), "the figures give way to the SVG"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "a.svg"]


def test_command(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg, image, output = tmp_path / "a.svg", tmp_path / "a.png", tmp_path / "b.svg"
    svg.write_text(HEAD + FOREIGN["shapes"])
    pixels = np.random.default_rng(0).integers(0, 80, (30, 40, 3), dtype=np.uint8)
    Image.fromarray(pixels).save(image)
    assert run("refine", svg, image, "-o", output, "--iterations", "30", "--json", "--device", "cpu") == 0
    values = json.loads(capsys.readouterr().out)
    assert values["psnr"] > values["psnr_before"] + 1
    assert values["paths"] == 2
    assert output.exists()
    assert run("refine", image, image, "-o", output) == 3
    assert "a.png" in one_line(capsys.readouterr().err)
