"""Foreign SVGs as scenes: they look the same, or are refused."""

from __future__ import annotations

import numpy as np
import pytest

from tests.svg.foreign import FOREIGN, HEAD
from warpsplat.errors import ImageError
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.svg.read import load_scene
from warpsplat.svg.viewer import on_white, render_svg
from warpsplat.svg.write import write_svg


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
    assert psnr(on_white(render_svg(write_svg(scene))), shown) > 38


REFUSED = {
    "hello": "cannot be rendered",
    HEAD + 'width="40" height="30"/>': "draws no",
    HEAD + 'width="40" height="40"><path d="M0 0H9V9Z"/></svg>': "proportions",
}


@pytest.mark.parametrize("text", REFUSED)
def test_refused(text: str) -> None:
    with pytest.raises(ImageError, match=REFUSED[text]) as caught:
        load_scene(text, 40, 30, "a.svg")
    assert str(caught.value).startswith("a.svg: ")


def test_a_view_box_beyond_all_numbers() -> None:
    text = f'{HEAD}width="32" height="24" viewBox="1e308 0 1 5"><path d="M1 1h9v9z"/></svg>'
    with pytest.raises(ImageError, match="viewBox lies farther"):
        load_scene(text, 32, 24, "a.svg")
