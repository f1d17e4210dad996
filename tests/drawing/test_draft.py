"""Drafts of drawings are their traces, made without Warp."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

import warpsplat
from tests import ROOT
from tests.drawing.test_thin import flag
from tests.drawing.trace.drawings import LOGO, draw
from tests.runs import scored

PROGRAM = """
import sys
import warpsplat
result = warpsplat.vectorize(sys.argv[1], quality="draft", output=sys.argv[2])
print(result.subject, "warp" in sys.modules, result.score.psnr)
"""


def draft(image: np.ndarray, **options: Any) -> warpsplat.Result:
    return warpsplat.vectorize(np.round(255 * image).astype(np.uint8), quality="draft", **options)


@pytest.mark.parametrize("subject", ["drawing", "pixel"])
def test_warp_is_not_imported(tmp_path: Path, subject: str) -> None:
    """Which takes longer than tracing a logo; figures are there all the same."""
    image = draw(f'<rect width="96" height="96" fill="#fff"/>{LOGO}')
    if subject == "pixel":
        image = np.repeat(np.repeat(np.round(2 * image[4::8, 4::8]) / 2, 8, axis=0), 8, axis=1)
    Image.fromarray(np.round(255 * image[..., :3]).astype(np.uint8)).save(tmp_path / "a.png")
    command = [sys.executable, "-c", PROGRAM, "a.png", "a.svg"]
    done = subprocess.run(
        command, cwd=tmp_path, env={"PYTHONPATH": str(ROOT)}, capture_output=True, text=True, check=True
    )
    found, has_warp, psnr = done.stdout.split()
    assert (found, has_warp) == (subject, "False")
    assert float(psnr) > 33
    assert (tmp_path / "a.svg").read_text().startswith("<svg")


def test_figures_few_bytes_few_colours_and_few_rows() -> None:
    whole = draft(draw(LOGO), subject="drawing")
    found = whole.as_dict()
    assert found["psnr"] > 33
    assert (found["render_psnr"], found["estimated_psnr"], found["iterations"]) == (None, None, 0)
    most = scored(whole).bytes - 60
    small = draft(draw(LOGO), subject="drawing", max_bytes=most)
    assert len(whole.scene) > len(small.scene) > 1
    assert scored(small).bytes <= most
    colors = draft(draw(LOGO), subject="drawing", palette="#2457a8,#ffffff").scene.colors
    assert {tuple(each) for each in np.round(255 * colors).astype(int)} == {(36, 87, 168), (255, 255, 255)}
    assert scored(draft(flag(60, 2), subject="drawing")).psnr == np.inf
