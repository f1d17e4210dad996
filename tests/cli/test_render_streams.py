"""``render`` and ``eval``: streams, devices, thin pictures."""

from __future__ import annotations

import io
import json
from pathlib import Path

import pytest
from PIL import Image

from tests.cli.helpers import one_line, run
from tests.svg.foreign import HEAD, PATH, SMALL


def test_thin_pictures_take_no_more_than_they_are(tmp_path: Path) -> None:
    svg = tmp_path / "a.svg"
    svg.write_text(f'{HEAD}width="1" height="60000">{PATH}</svg>')
    assert run("render", svg, "-o", tmp_path / "a.png") == 0
    with Image.open(tmp_path / "a.png") as picture:
        assert picture.size == (1, 60000)


def test_outputs_that_are_no_png(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg, other = tmp_path / "a.svg", tmp_path / "b.jpg"
    svg.write_text(f"{SMALL}</svg>")
    assert run("render", svg, "-o", other) == 2
    assert ".png" in one_line(capsys.readouterr().err)
    assert not other.exists()


def test_standard_streams(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsysbinary: pytest.CaptureFixture[bytes]
) -> None:
    class Stdin:
        buffer = io.BytesIO(f"{SMALL}{PATH}</svg>".encode())

    image = tmp_path / "a.png"
    Image.new("RGB", (40, 30)).save(image)
    monkeypatch.setattr("sys.stdin", Stdin)
    assert run("render", "-", "-o", "-") == 0
    assert Image.open(io.BytesIO(capsysbinary.readouterr().out)).size == (40, 30)
    Stdin.buffer.seek(0)
    assert run("eval", image, "-", "--json") == 0
    assert json.loads(capsysbinary.readouterr().out)["paths"] == 1
    Stdin.buffer = io.BytesIO(b"hello")
    assert run("render", "-", "-o", "-") == 3
    assert b"standard input" in capsysbinary.readouterr().err
    assert run("eval", "-", "-") == 2


def test_an_endless_device_is_not_read(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if not Path("/dev/zero").exists():
        pytest.skip("no such device here")
    assert run("render", "/dev/zero", "-o", tmp_path / "a.png") == 3
    assert "device" in one_line(capsys.readouterr().err)
