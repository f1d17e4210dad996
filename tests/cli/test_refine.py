"""``refine`` as a user meets it."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.cli.helpers import Cli, one_line, run
from tests.fuzz.corpus import own_svg
from tests.svg.foreign import FOREIGN, HEAD


def test_outputs_and_standard_streams(
    tmp_path: Path, capsysbinary: pytest.CaptureFixture[bytes], monkeypatch: pytest.MonkeyPatch
) -> None:
    text = (HEAD + FOREIGN["lines"]).encode()
    svg, image = tmp_path / "a.svg", tmp_path / "a.png"
    svg.write_bytes(text)
    Image.new("RGB", (40, 30), "red").save(image)
    quick = ("--iterations", 5, "--device", "cpu")

    class Stdin:
        buffer = io.BytesIO(text)

    monkeypatch.setattr("sys.stdin", Stdin)
    assert run("refine", "-", image, "-o", "-", "--json", *quick) == 0
    captured = capsysbinary.readouterr()
    assert captured.out.startswith(b"<svg")
    assert json.loads(captured.err)["bytes"] == len(captured.out), "the figures give way to the SVG"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.png", "a.svg"]


KEPT = '<filter id="f"><feOffset dx="1"/></filter><path d="M5 5h20v9z" filter="url(#f)"/>'


def test_kept_elements_are_named(tmp_path: Path, cli: Cli) -> None:
    svg, image, output = tmp_path / "a.svg", tmp_path / "a.png", tmp_path / "b.svg"
    svg.write_text(f'{HEAD}width="40" height="30"><path d="M2 2h30v20z" fill="red"/>{KEPT}</svg>')
    Image.new("RGB", (40, 30), "grey").save(image)
    arguments = ("refine", svg, image, "-o", output, "--iterations", "5", "--device", "cpu")
    assert "filter" in cli(*arguments, code=3).line
    captured = cli(*arguments, "--keep", "--json")
    values = json.loads(captured.out)
    assert values["psnr"] > values["psnr_before"]
    assert values["kept"] == "<path> (filter)"
    assert one_line(captured.err).endswith("a.svg: kept as it is: <path> (filter)")
    assert KEPT.partition("</filter>")[2] in output.read_text()
    assert cli(*arguments, "--keep", "-q").err == ""
    svg.write_text(f'{HEAD}width="40" height="30">{KEPT}</svg>')
    assert "contains no path to refine: <path> (filter)" in cli(*arguments, "--keep", code=3).line


def test_a_name_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("in").mkdir()
    Path("in/a.svg").write_bytes(own_svg("fill"))
    Image.fromarray(np.full((24, 32, 3), 200, np.uint8)).save("a.png")
    words = ("refine", "in/a.svg", "a.png", "--iterations", 1, "--device", "cpu", "-q")
    assert run(*words) == 0
    assert Path("a-refined.svg").exists() and not Path("in/a-refined.svg").exists()
    Path("a-refined.svg").write_text("<svg/>")
    assert run(*words) == 2, "another's file"
