"""Fills that a round pen draws become strokes, others stay fills."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.drawings import vectorized
from tests.drawing.trace.line_art import drawn
from tests.runs import scored
from warpsplat.run.result import Result
from warpsplat.scene import Kind

HOOK = '<path d="M14 58V30a16 16 0 0 1 32 0v14" stroke-width="7"/>'
RING = '<circle cx="70" cy="24" r="12" stroke-width="5" stroke="#d62828"/>'
BLOCK = '<path d="M60 46h24v16h-24z" fill="#1d3557" stroke="none"/>'
WEDGE = '<path d="M10 12L80 8L80 20z" fill="#000" stroke="none"/>'
BLUNT = '<path d="M14 36H84" stroke-width="12" stroke-linecap="butt"/>'


def strokes_of(paths: str, device: str) -> Result:
    return vectorized(drawn(paths), device, strokes=True)


def test_lines_become_strokes_and_areas_stay_fills(device: str) -> None:
    result = strokes_of(HOOK + RING + BLOCK, device)
    scene = result.scene
    is_stroke = scene.kind == Kind.STROKE
    assert is_stroke.sum() == 2
    np.testing.assert_allclose(np.sort(scene.widths[is_stroke]), [5, 7], atol=0.15)
    assert result.svg.count('stroke-linecap="round"') == 1
    assert result.svg.count("<rect") == 2  # the ground and the block
    assert scored(result).psnr > 35


@pytest.mark.parametrize("paths", [WEDGE, BLUNT, BLOCK])
def test_what_no_round_pen_draws_stays_a_fill(paths: str, device: str) -> None:
    assert (strokes_of(paths, device).scene.kind == Kind.FILL).all()


def test_one_path_may_be_partly_strokes(device: str) -> None:
    """The rest keeps its colour and its place."""
    result = strokes_of('<path d="M12 14H84"/>' + BLOCK.replace("#1d3557", "#000"), device)
    scene = result.scene
    assert scene.kind.tolist() == [Kind.FILL, Kind.STROKE]
    np.testing.assert_array_equal(scene.colors[0], scene.colors[1])
    assert set(scene.points_of(1)[:, 1].tolist()) == {14.0}
