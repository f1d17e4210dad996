"""Reading foreign SVGs and improving them."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import warp as wp
from PIL import Image

from tests.scenes import random_scene
from tests.test_cli import one_line, run
from warpsplat.config import make_settings
from warpsplat.errors import ImageError
from warpsplat.metrics import psnr
from warpsplat.refine import load_scene, refine
from warpsplat.render import render
from warpsplat.svg import write_svg
from warpsplat.viewer import on_white, render_svg

HEAD = '<svg xmlns="http://www.w3.org/2000/svg" '
FOREIGN = {
    "lines": 'width="40" height="30"><path d="M5 5H35V25L5 20Z" fill="#f00"/></svg>',
    "hole": 'width="40" height="30"><path d="M2 2H38V28H2ZM10 8V20H30V8Z" fill="blue"/></svg>',
    "transform": 'width="40" height="30"><g transform="translate(4,2) scale(2)">'
    '<path d="M0 0l10 0q4 5 0 10z" style="fill:#0a0;fill-opacity:.5"/></g></svg>',
    "shapes": 'viewBox="0 0 80 60"><rect width="80" height="60" fill="#ddd"/>'
    '<circle cx="30" cy="30" r="20" fill="rgb(200,10,60)"/><ellipse cx="60" cy="20" rx="9" ry="5"/></svg>',
    "arc": 'width="40" height="30"><path d="M10 15A8 8 0 0 1 26 15zM3 3h5v5h-5" fill="#123456"/></svg>',
    "strokes": 'width="40" height="30"><path d="M3 5C10 30 20-10 37 20" fill="none" stroke="#808" '
    'stroke-width="4" stroke-linecap="round" stroke-linejoin="round"/></svg>',
    "none": 'width="40" height="30"><path d="M0 0H9V9Z" fill="none"/><path d="M9 9H30V20Z"/></svg>',
}


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_files_look_the_same(name: str) -> None:
    """What resvg shows of the file, against our own renderer on the scene read from it."""
    text = HEAD + FOREIGN[name]
    scene, _ = load_scene(text, 40, 30, name)
    shown = on_white(render_svg(text, width=40, height=30))
    # Strokes: resvg's own anti-aliasing has 16 levels, and much of so small an image is edge.
    assert psnr(render(scene, device="cpu").astype(np.float64) * 255, shown) > (
        34 if name == "strokes" else 38
    )
    assert psnr(on_white(render_svg(write_svg(scene, precision=3))), shown) > 38


REFUSED = {
    "hello": "cannot be rendered",
    HEAD + 'width="40" height="30"/>': "draws no",
    HEAD + 'width="40" height="40"><path d="M0 0H9V9Z"/></svg>': "proportions",
    HEAD + 'width="40" height="30"><path d="M0 0H9V9Z"/><path d="M0 0H9" fill="none" stroke="red" '
    'stroke-linecap="round"/></svg>': "both",
    HEAD + 'width="40" height="30"><path d="M0 0H9V9Z" stroke="red"/></svg>': "both",
}


@pytest.mark.parametrize("text", REFUSED)
def test_refused(text: str) -> None:
    with pytest.raises(ImageError, match=REFUSED[text]) as caught:
        load_scene(text, 40, 30, "a.svg")
    assert str(caught.value).startswith("a.svg: ")


def test_refining_raises_the_psnr_and_keeps_the_paths(device: str) -> None:
    scene = random_scene("closed", count=6, width=48, height=40, seed=2)
    target = render(scene, device=device)
    rng = np.random.default_rng(0)
    moved = replace(scene, points=scene.points + rng.normal(0, 1, scene.points.shape).astype(np.float32))
    text = write_svg(moved)
    result, before = refine(text, target, make_settings(iterations=120), wp.get_device(device), name="a.svg")
    assert result.score
    assert result.score.psnr > before + 4
    assert result.score.paths == 6
    assert result.score.nodes <= 6 * 6


def test_padding_is_not_exported(device: str) -> None:
    text = (
        HEAD
        + 'width="40" height="30"><path d="M5 5H35V25Z"/>'
        + ('<path d="M9 9h2v2h2v2h2v2h2v2h-10z" fill="red"/></svg>')
    )
    target = np.full((30, 40, 3), 0.4, np.float32)
    result, _ = refine(text, target, make_settings(iterations=10), wp.get_device(device), name="a.svg")
    assert result.score
    assert result.score.nodes <= 20


def test_no_improvement_changes_nothing(device: str) -> None:
    text = HEAD + FOREIGN["lines"]
    target = (on_white(render_svg(text)) / 255).astype(np.float32)
    result, _ = refine(text, target, make_settings(iterations=5), wp.get_device(device), name="a.svg")
    assert result.svg == text


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
