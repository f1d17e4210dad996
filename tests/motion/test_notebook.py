"""The picture that grows in a notebook."""

from __future__ import annotations

import base64
import io
import re
import sys
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
from PIL import Image

import warpsplat
from warpsplat.motion import notebook


@pytest.fixture
def shown(monkeypatch: pytest.MonkeyPatch) -> list[tuple[str, str]]:
    """What a run shows: how, and the HTML."""
    calls: list[tuple[str, str]] = []
    handle = SimpleNamespace(
        display=lambda html: calls.append(("display", html)),
        update=lambda html: calls.append(("update", html)),
    )
    display = ModuleType("IPython.display")
    display.__dict__.update(HTML=str, DisplayHandle=lambda: handle)
    monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.setattr(notebook, "INTERVAL", 0.0)
    return calls


def test_the_picture_grows(shown: list[tuple[str, str]]) -> None:
    pixels = np.random.default_rng(0).uniform(0, 1, (24, 32, 3))
    warpsplat.vectorize(pixels, 4, subject="photo", iterations=40, device="cpu", callback=warpsplat.Live())
    assert [how for how, _ in shown] == ["display"] + (len(shown) - 1) * ["update"]
    shares = [float(re.findall(r'<progress value="([\d.]+)"', html)[0]) for _, html in shown]
    assert len(shares) > 2
    assert shares == sorted(shares)
    assert re.search(r"step \d+ of 40, \d+\.\d dB, \d+ shapes", shown[-1][1])
    pictures = [re.findall(r'base64,([^"]*)" width="32"', html)[0] for _, html in shown]
    assert len(set(pictures)) > 2
    with Image.open(io.BytesIO(base64.b64decode(pictures[-1]))) as image:
        assert image.size == (32, 24)


def test_a_drawing_shows_its_course(shown: list[tuple[str, str]]) -> None:
    pixels = np.zeros((24, 32, 3))
    pixels[6:18, 8:20] = 1
    warpsplat.vectorize(pixels, subject="drawing", device="cpu", callback=warpsplat.Live())
    assert all("<progress" in html for _, html in shown)


def test_without_ipython_one_line_says_what_to_do(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "IPython.display", None)
    with pytest.raises(
        ImportError, match=r"^warpsplat.Live needs IPython: pip install warpsplat\[notebook\]$"
    ):
        warpsplat.Live()
