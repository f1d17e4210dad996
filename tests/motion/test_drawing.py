"""The order of drawing, as frames and as style sheets."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from warpsplat.motion import drawing
from warpsplat.svg.viewer import on_white, render_own

TWO_STROKES = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="48" height="36" viewBox="0 0 480 360"><!--warpsplat-->\n'
    '<rect width="480" height="360" fill="#fff"/><g fill="none" stroke="#000" stroke-width="20">'
    '<path d="M40 100h300"/><path d="M40 200h100"/></g><path d="M40 300h100v40h-100z"/></svg>\n'
)


def test_strokes_grow_one_after_the_other() -> None:
    """Times are proportional to lengths; a fill takes as long as the mean stroke."""
    film = drawing.film(TWO_STROKES, Path("a.webp"), 48, 3.0, own=True)
    frames = [on_white(picture) for picture, _ in film]
    # Columns of dark pixels in the rows of the two strokes and of the fill.
    found = np.array([(frame[[10, 20, 31], :, 0] < 128).sum(axis=1) for frame in frames])
    assert np.all(np.diff(found, axis=0) >= 0)
    assert found[-1] == pytest.approx([30, 10, 10], abs=1)
    # Of three equal times, the strokes have two, 3:1.
    assert found[len(found) // 2 - 1] == pytest.approx([30, 0, 0], abs=1)
    assert found[round(len(found) / 4), 0] == pytest.approx(15, abs=2.5)
    assert np.array_equal(frames[-1], on_white(render_own(TWO_STROKES)))
    assert (frames[0] > 250).mean() > 0.98, "the background is there from the beginning"


def test_foreign_files_are_drawn_with_limits(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpsplat.motion.films.render_own", None)
    frames = list(drawing.film(TWO_STROKES, Path("a.gif"), 24, 0.16, own=False))
    assert [picture.size for picture, _ in frames] == [(24, 18)] * 3


def test_the_svg_shows_the_file_where_nothing_is_animated() -> None:
    text = drawing.animated_svg(TWO_STROKES, 3.0)
    assert np.array_equal(np.asarray(render_own(text)), np.asarray(render_own(TWO_STROKES)))
    assert 'style="animation-delay:0s;animation-duration:1.5s;--l:300px" class="ws"' in text
    assert 'style="animation-delay:1.5s;animation-duration:.5s;--l:100px" class="ws"' in text
    assert 'style="animation-delay:2s" class="wf"' in text
    assert "<script" not in text and "prefers-reduced-motion" in text


def test_own_styles_and_classes_stay() -> None:
    other = (
        '<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" '
        'width="9" height="9">'
        '<defs><path id="a" d="M0 0h9"/></defs>'
        '<use xlink:href="#a" class="x" style="stroke:red;"/>'
        '<path d="M0 5h9" style="fill:none;stroke:red" stroke-dasharray="1 2"/></svg>'
    )
    text = drawing.animated_svg(other, 1.0)
    assert 'class="x wf" style="stroke:red;animation-delay:0s"' in text
    assert 'style="fill:none;stroke:red;animation-delay:.5s" stroke-dasharray="1 2" class="wf"' in text
    assert '<path id="a" d="M0 0h9" />' in text, "not drawn where it stands"
    assert np.array_equal(np.asarray(render_own(text)), np.asarray(render_own(other)))


def test_lengths() -> None:
    assert drawing.path_length("M0 0h30v40") == pytest.approx(70)
    circle = "M10 0a10 10 0 1 1-20 0a10 10 0 1 1 20 0z"
    assert drawing.path_length(circle) == pytest.approx(2 * np.pi * 10, rel=0.01)
    assert drawing.path_length("M0 0h3M0 9h5") == pytest.approx(5), "dashes restart at each subpath"
    assert drawing.path_length("") == 0
