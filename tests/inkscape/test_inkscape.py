"""The extension in Inkscape itself, without a display: GTK's broadway draws windows for a browser."""

from __future__ import annotations

import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from tests.cli.helpers import run
from tests.inkscape.helpers import document, pixels, without_images
from warpsplat.inkscape.command import data_folder

DISPLAY = ":5"
LONGEST = 120
"""Longest wait for Inkscape [s]: it waits itself while it shows a message."""


@pytest.fixture
def display(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Inkscape's settings in a folder of the test, and somewhere for its window to be."""
    server = shutil.which("broadwayd")
    if server is None or shutil.which("inkscape") is None:
        pytest.skip("no Inkscape: apt-get install inkscape libgtk-3-bin")
    (tmp_path / "run").mkdir(mode=0o700)
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "run"))
    monkeypatch.setenv("INKSCAPE_PROFILE_DIR", str(tmp_path / "own ä"))
    monkeypatch.setenv("GDK_BACKEND", "broadway")
    monkeypatch.setenv("BROADWAY_DISPLAY", DISPLAY)
    socket = tmp_path / "run" / "web"
    with subprocess.Popen([server, "--unixsocket", str(socket), DISPLAY]) as process:
        for _ in range(1000):
            if not socket.exists():
                time.sleep(0.01)
        yield
        process.terminate()


@pytest.mark.slow  # 8 s
@pytest.mark.usefixtures("display")
def test_it_vectorizes_what_is_selected(tmp_path: Path) -> None:
    assert run("inkscape") == 0
    assert data_folder() == tmp_path / "own ä"
    source, made = (tmp_path / "ü" / name for name in ("a b.svg", "made.svg"))
    source.parent.mkdir()
    image = '<image id="i" x="20" y="9" width="60" height="60" HREF/>'
    text = document(f'<g transform="rotate(9)">{image}</g>')
    source.write_text(text, "utf-8")
    actions = f"select-by-id:i;org.warpsplat.vectorize.noprefs;export-filename:{made};export-do"
    words = ["inkscape", "--with-gui", "--batch-process", f"--actions={actions}", str(source)]
    subprocess.run(words, timeout=LONGEST, check=True)
    result = made.read_text("utf-8")
    assert result.index('id="i"') < result.index('id="i-vectors"') < result.index("<path")
    there = pixels(text)
    error, all_of_it = (np.abs(pixels(without_images(one)) - there).mean() for one in (result, text))
    assert error < 0.02 * all_of_it  # 0.003; a shift by one unit: 0.05
