"""Exact coverage against a viewer's pictures of many times the size, reduced by area: next to the truth.

At the pictures' own size resvg's are no measure of thin lines, which it draws by a rule of its own, nor of
dashes along curves, whose lengths it takes from coarse pieces: both are 30 to 35 dB from the truth there.
"""

from __future__ import annotations

import numpy as np
import pytest

import warpsplat
from warpsplat.scene import FloatArray

FINER = 16
HEAD = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 96 96" fill="none" stroke="green">'
TRIANGLE = '<polygon points="10 20 80 88 15 74" {}/>'
CIRCLE = '<circle cx="48" cy="48" r="36" stroke-width="6" stroke-dasharray="10 20" {}/>'
LINE = '<path d="M8 20 88 70 20 84" stroke-width="3" stroke-dasharray="7 5" {}/>'


def psnr(a: FloatArray, b: FloatArray) -> float:
    """On black and on white, the lower one; both are premultiplied."""
    papers = [a[..., :3] - b[..., :3] + paper * (b[..., 3:] - a[..., 3:]) for paper in (0, 1)]
    return float(min(-10 * np.log10(np.square(error, dtype=np.float64).mean()) for error in papers))


def truth(svg: str) -> FloatArray:
    """Return a viewer's picture, reduced."""
    large = warpsplat.render(svg, renderer="viewer", scale=FINER)
    height, width = (side // FINER for side in large.shape[:2])
    return np.asarray(large.reshape(height, FINER, width, FINER, 4).mean(axis=(1, 3)), np.float32)


@pytest.mark.parametrize(
    ("body", "right", "wrong", "least"),
    [
        (TRIANGLE, "", 'stroke-width="1.05"', 60),
        (TRIANGLE, 'stroke-width="4"', 'stroke-width="4" stroke-linejoin="bevel"', 55),
        (LINE, "", 'stroke-dashoffset="0.1"', 60),
        (LINE, 'stroke-dashoffset="2.5"', 'stroke-dashoffset="2.6"', 60),
        (LINE, 'stroke-dashoffset="-2.5"', 'stroke-dashoffset="-2.4"', 60),
        (CIRCLE, "", 'stroke-dashoffset=".3"', 38),
        (CIRCLE, 'stroke-dashoffset="20%"', 'stroke-dashoffset="19.5"', 38),
        (CIRCLE, 'stroke-dashoffset="-15"', 'stroke-dashoffset="-14.7"', 38),
        (CIRCLE, 'stroke-dashoffset="1.5mm"', 'stroke-dashoffset="5.97"', 38),
    ],
)
def test_what_is_exact_is_nearer_to_the_truth_than_a_viewer(
    device: str, body: str, right: str, wrong: str, least: float
) -> None:
    """Hairlines and dashes; where they are a little elsewhere, it shows."""
    svg = f"{HEAD}{body.format(right)}</svg>"
    wanted, shown = truth(svg), warpsplat.render(svg, renderer="exact", device=device)
    viewer = warpsplat.render(svg, renderer="viewer")
    assert psnr(shown, wanted) > max(least, psnr(viewer, wanted) + 3)
    other = warpsplat.render(f"{HEAD}{body.format(wrong)}</svg>", renderer="exact", device=device)
    assert psnr(other, wanted) < least
