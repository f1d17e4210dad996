"""Reading foreign SVGs and improving them."""

from __future__ import annotations

import io
import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from tests.scenes import random_scene
from tests.test_cli import one_line, run
from warpsplat.errors import ImageError
from warpsplat.fit.settings import make_settings
from warpsplat.jobs.refine import refine
from warpsplat.metrics import psnr, score_svg
from warpsplat.render.backend import Backend
from warpsplat.render.renderer import render
from warpsplat.scene import Kind
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg

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
    "css": 'width="40" height="30"><style>/* . */.a{fill:red;opacity:.5}#b,path{fill:#0a0}</style>'
    '<g opacity=".6"><path class="a" d="M2 2h30v20z"/></g>'
    '<path id="b" style="fill:hsl(200,50%,50%)" d="M9 9h9v9z"/></svg>',
    "place": 'width="80" height="60" viewBox="10 0 20 30" preserveAspectRatio="xMinYMax">'
    '<circle cx="50%" cy="1e1" r="9"/></svg>',
    "even-odd": 'width="40" height="30">'
    '<path fill-rule="evenodd" d="M2 2h30v20h-30zM5 5v9h9v-9z" fill="#d40"/></svg>',
    "unseen": 'width="40" height="30"><defs><g id="x"><use href="#x"/></g></defs>'
    '<symbol><path d="M0 0h40v30z"/></symbol>'
    '<g display="none"><text/></g><path visibility="hidden" d="M0 0h40v9z"/><path d="M9 3h9v9z"/></svg>',
    "closed stroke": 'width="40" height="30"><path d="M6 6h20v15zm15 15v-5" fill="none" stroke="#a3c" '
    'stroke-width="3" stroke-linejoin="round" stroke-linecap="round"/></svg>',
    "none": 'width="40" height="30"><path d="M0 0H9V9Z" fill="none"/><path d="M9 9H30V20Z"/></svg>',
}


@pytest.mark.parametrize("name", FOREIGN)
def test_foreign_files_look_the_same(name: str) -> None:
    """What resvg shows of the file, against our own renderer on the scene read from it."""
    text = HEAD + FOREIGN[name]
    scene, _ = load_scene(text, 40, 30, name)
    shown = on_white(render_svg(text, width=40, height=30))
    # Strokes: resvg's own anti-aliasing has 16 levels, and much of so small an image is edge.
    assert psnr(render(scene, backend=Backend.on("cpu")).astype(np.float64) * 255, shown) > (
        34 if "stroke" in name else 38
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


ROUND = 'fill="none" stroke="red" stroke-linecap="round" stroke-linejoin="round"'
LOST = {
    f'<path d="M1 1h9v9" {ROUND} stroke-dasharray="2"/>': "dashes",
    '<path d="M1 1h9" fill="none" stroke="red"/>': "butt caps",
    '<path d="M1 1h9v9" fill="none" stroke="red" style="stroke-linecap:square"/>': "square caps",
    '<path d="M1 1h9v9z" fill="none" stroke="red"/>': "miter joins",
    '<g fill-rule="evenodd"><path d="M2 2h30v20h-30zM5 5h9v9h-9z"/></g>': "even-odd",
    '<polygon fill-rule="evenodd" points="20,1 30,28 3,10 37,10 8,28"/>': "even-odd",
    '<path d="M1 1h9v9z" style="mix-blend-mode:multiply"/>': "mix-blend-mode",
    '<g opacity=".5"><path d="M1 1h9v9z"/><path d="M1 1h9v9z"/></g>': "opacity of a group",
    '<symbol id="s"><path d="M1 1h9v9z"/></symbol><use href="#s"/>': "<use>",
    '<switch><path d="M1 1h9v9z"/><path d="M1 1h9v9z"/></switch>': "<switch>",
    '<svg><path d="M1 1h9v9z"/></svg>': "<svg> inside",
    "<text>a</text>": "<text>",
    '<image href="a.png"/>': "<image>",
    '<g style="clip-path:url(#a)"/>': "clip-path",
    '<g mask="url(#a)"/>': "mask",
    '<path filter="url(#a)"/>': "filter",
    '<path d="M1 1h9v9z" fill="url(#a)"/>': "gradient",
    f'<path d="M1 1h9v9" {ROUND} marker-end="url(#a)"/>': "markers",
    f'<path d="M1 1h9v9" {ROUND} vector-effect="non-scaling-stroke"/>': "vector-effect",
    f'<path d="M1 1h9v9" {ROUND} transform="scale(1,2)"/>': "stretches",
    f'<path d="M1 1h9M2 0v9" {ROUND} opacity=".5"/>': "several subpaths",
    '<path d="M1 1h9v9z"><animate attributeName="d"/></path>': "animation",
    "<style>g path{fill:red}</style>": "selector",
    "<style>@media print{path{fill:red}}</style>": "@-rules",
    '<path d="M1 1h9v9z" fill="bogus"/>': "'bogus' is not a colour",
    '<circle cx="1em" cy="5" r="1em"/>': "'1em'",
    '<path d="z"/>': "draws no",
    '<path d="M1 1h9v9zL"/>': "broken",
    '<path d="M1 1h1e30v9z"/>': "farther than",
    f'<path d="M1 1h9v9" {ROUND} stroke-width="1e30"/>': "farther than",
    '<path d="M1 1h9e999v9z"/>': "farther than",
    10 * '<g transform="scale(1e40)">' + '<path d="M1 1h9v9z"/>' + 10 * "</g>": "farther than",
    '<path d="M1 1h9v9z" transform="spin(5)"/>': "transform",
    '<path d="M1 1h9v9z" visibility=";"/>': "visibility",
    "<style>.a{fi 9:red;fill:red}</style>": "broken",
}


@pytest.mark.parametrize("body", LOST)
def test_what_would_be_lost_is_named(body: str) -> None:
    with pytest.raises(ImageError) as caught:
        load_scene(f'{HEAD}width="40" height="30">{body}</svg>', 40, 30, "a.svg")
    assert str(caught.value).startswith("a.svg: ")
    assert LOST[body] in one_line(str(caught.value))


@pytest.mark.parametrize(
    "size", ['width="nan" height="nan"', 'width="a" height="b" viewBox="nan nan nan nan"', ""]
)
def test_sizes_that_are_no_numbers(size: str) -> None:
    with pytest.raises(ImageError, match="neither its size"):
        load_scene(f'{HEAD}{size}><path d="M1 1h9v9z"/></svg>', 40, 30, "a.svg")


def test_path_data_as_the_viewer_reads_it() -> None:
    """Every command, absolute and relative, smooth ones after others, arcs of all flags."""
    rng = np.random.default_rng(5)
    sizes = {"l": 2, "h": 1, "v": 1, "c": 6, "s": 4, "q": 4, "t": 2, "z": 0, "m": 2, "a": 7}
    for _ in range(12):
        data = "M20 15"
        for command in rng.choice([*sizes], 8):
            relative = rng.random() < 0.5
            v = [f"{x:.1f}" for x in rng.uniform(*((-15, 15) if relative else (3, 27)), sizes[command])]
            if command == "a":
                v[:5] = [
                    *(f"{x:.1f}" for x in rng.uniform(2, 20, 3)),
                    *(str(x) for x in rng.integers(0, 2, 2)),
                ]
            data += (command if relative else command.upper()) + " ".join(v)
        text = f'{HEAD}width="40" height="30"><path {ROUND} stroke-width="2" d="{data}"/></svg>'
        scene, _ = load_scene(text, 40, 30, data)
        assert psnr(on_white(render_svg(write_svg(scene, precision=4))), on_white(render_svg(text))) > 36, (
            data
        )


def test_hostile_path_data_is_read_in_linear_time() -> None:
    for data in (
        "M0 0" + "z" * 200_000,
        "M0 0h9" + "S1 1 2 2" * 50_000,
        "M" + " " * 500_000,
        "M" + "1" * 500_000,
    ):
        with pytest.raises(ImageError):
            load_scene(f'{HEAD}width="40" height="30"><path d="{data}"/><text/></svg>', 40, 30, "a.svg")


def test_nothing_is_added(device: str) -> None:
    """A file without a background gets none; one with a background keeps it."""
    target = np.full((30, 40, 3), 0.4, np.float32)
    for behind in ("", '<rect width="40" height="30" fill="#ccc"/>'):
        text = f'{HEAD}width="40" height="30">{behind}<path d="M5 5H35V25Z" fill="red"/></svg>'
        result, before = refine(text, target, make_settings(iterations=10), Backend.on(device), name="a.svg")
        assert result.score and result.score.psnr > before
        assert result.svg.count("<rect") == (1 if behind else 0)
        assert result.score.psnr == pytest.approx(score_svg(result.svg, target).psnr)


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


def test_refining_raises_the_psnr_and_keeps_the_paths(device: str) -> None:
    scene = random_scene(Kind.FILL, count=6, width=48, height=40, seed=2)
    target = render(scene, backend=Backend.on(device))
    rng = np.random.default_rng(0)
    moved = replace(scene, points=scene.points + rng.normal(0, 1, scene.points.shape).astype(np.float32))
    text = write_svg(moved)
    result, before = refine(text, target, make_settings(iterations=120), Backend.on(device), name="a.svg")
    assert result.score
    assert result.score.psnr > before + 4
    assert result.score.paths == 6
    assert result.score.nodes <= 6 * 6


def test_paths_of_different_lengths_stay_as_long(device: str) -> None:
    text = (
        HEAD
        + 'width="40" height="30"><path d="M5 5H35V25Z"/>'
        + ('<path d="M9 9h2v2h2v2h2v2h2v2h-10z" fill="red"/></svg>')
    )
    target = np.full((30, 40, 3), 0.4, np.float32)
    result, _ = refine(text, target, make_settings(iterations=10), Backend.on(device), name="a.svg")
    assert result.score
    assert result.score.nodes <= 20


def test_no_improvement_changes_nothing(device: str) -> None:
    text = HEAD + FOREIGN["lines"]
    target = (on_white(render_svg(text)) / 255).astype(np.float32)
    result, _ = refine(text, target, make_settings(iterations=5), Backend.on(device), name="a.svg")
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
