"""``--animate`` and ``--preview`` on the command line."""

from __future__ import annotations

import os
import re
from pathlib import Path

import pytest
from PIL import Image

from tests.cli.helpers import QUICK, one_line, run
from warpsplat.cli import signals
from warpsplat.motion import preview
from warpsplat.svg.viewer import render_own

SHORT = [*QUICK[:2], "--iterations", "40", *QUICK[4:]]


def test_an_animation_does_not_change_the_file(
    image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Nor the figures; with a preview as well."""
    plain, shown, film = tmp_path / "a.svg", tmp_path / "b.svg", tmp_path / "b.gif"
    assert run("vectorize", image, "-o", plain, *SHORT) == 0
    figures = capsys.readouterr().out
    more = ["--animate", film, "--animate-width", "40", "--preview=blocks"]
    assert run("vectorize", image, "-o", shown, *SHORT, *more) == 0
    captured = capsys.readouterr()
    assert shown.read_bytes() == plain.read_bytes()
    seconds = re.compile(r", [\d.]+ s$")
    assert seconds.sub("", captured.out.strip()) == seconds.sub("", figures.strip().replace("a.svg", "b.svg"))
    said = [line for line in captured.err.splitlines() if "▀" not in line]
    assert said == [f"warpsplat: {film}: animation of the training, {film.stat().st_size:,} bytes"]
    with Image.open(film) as opened:
        assert opened.width == 40 and getattr(opened, "n_frames", 1) > 3


def test_traced_images_show_the_drawing(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Even if the training is requested, as there is none."""
    image, film = tmp_path / "cells.png", tmp_path / "a.svg"
    cells = Image.effect_noise((6, 5), 90).point(lambda level: 255 * (level > 128))
    cells.resize((48, 40), Image.Resampling.NEAREST).save(image)
    for more in ([], ["--animate-what", "training"]):
        output = tmp_path / "b.svg"
        options = ["--subject", "pixel", "--device", "cpu", "--animate", film, *more]
        assert run("vectorize", image, "-o", output, *options) == 0
        captured = capsys.readouterr()
        lines = captured.err.strip().splitlines()
        assert re.search(r"a\.svg: animation of the drawing, [\d,]+ bytes$", lines[-1])
        assert len(lines) == 1 + bool(more)
        assert 'class="wf"' in film.read_text()
        assert render_own(film.read_text()).tobytes() == render_own(output.read_text()).tobytes()


def test_refine(image: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    svg, film = tmp_path / "a.svg", tmp_path / "b.webp"
    assert run("vectorize", image, "-o", svg, *QUICK) == 0
    options = ["--iterations", "40", "--device", "cpu", "--animate", film, "--preview=kitty"]
    assert run("refine", svg, image, "-o", tmp_path / "b.svg", *options) == 0
    captured = capsys.readouterr()
    assert "animation of the training" in captured.err and "\x1b_Ga=T" in captured.err
    with Image.open(film) as opened:
        assert opened.format == "WEBP" and getattr(opened, "n_frames", 1) > 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--animate", "a.avi"], "a.avi: not an animation format; the name must end in {endings}"),
        (["--animate", "-"], "an animation cannot be written to the standard output: give --animate FILE"),
        (["--animate", "a.svg"], "a.svg: is another file of this run; give another name"),
        (["--animate", "there.gif/a.gif"], "there.gif/a.gif: {here}/there.gif is not a folder"),
        (["--animate", "a.gif", "--animate-width", "9"], "an animation is 16 to 2048 px wide, not 9"),
        (["--animate-what", "drawing"], "--animate-what and --animate-width need --animate FILE"),
        (["--animate", "there.gif"], "there.gif: exists and was not written by warpsplat; {overwrite}"),
        (["photo.png", "--animate", "a.gif"], "--animate takes one image"),
        (["photo.png", "--preview"], "--preview takes one image"),
    ],
)
def test_errors_come_before_the_run(
    options: list[str],
    message: str,
    image: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(image.parent)
    Path("there.gif").write_bytes(b"GIF89a of somebody else")
    before = sorted(image.parent.iterdir())
    assert run("vectorize", image.name, "-o", "a.svg", *options) == 2
    words = {"endings": ".svg, .gif, .webp or .mp4", "overwrite": "--overwrite replaces it"}
    message = message.format(here=image.parent, **words)
    assert one_line(capsys.readouterr().err) == f"warpsplat: {message}"
    assert sorted(image.parent.iterdir()) == before


def test_notice_without_a_terminal(
    image: Path, tmp_path: Path, capfdbinary: pytest.CaptureFixture[bytes]
) -> None:
    """An image may follow the flag; stdout has only the SVG."""
    assert run("vectorize", "--preview", image, "-o", "-", *QUICK) == 0
    captured = capfdbinary.readouterr()
    assert captured.err.startswith(
        b"warpsplat: --preview: stderr is not a terminal that shows pictures; --preview=blocks prints them\n"
    )
    assert captured.out.startswith(b"<svg") and captured.err.count(b"\n") == 2


def test_an_encoding_without_half_blocks(
    image: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(preview, "HALF", "\udc80")
    assert run("vectorize", image, "-o", tmp_path / "a.svg", *QUICK, "--preview=blocks") == 0
    assert "has no half blocks" in one_line(capsys.readouterr().err)


@pytest.mark.parametrize("terminal", [True, False])
def test_a_second_signal_restores_the_cursor(terminal: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """The progress bar hides it."""
    written: list[tuple[int, bytes]] = []
    monkeypatch.setattr(os, "isatty", lambda handle: terminal)
    monkeypatch.setattr(os, "write", lambda handle, text: written.append((handle, text)))
    monkeypatch.setattr(signals, "_exit", lambda code: None)
    signals._end(2)
    assert written == [(2, b"\x1b[?25h" * terminal + b"\nwarpsplat: interrupted\n")]
