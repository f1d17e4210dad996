"""Strokes are cut where their pen changes, and only there."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.drawings import vectorized
from tests.drawing.trace.line_art import drawn
from tests.runs import scored
from warpsplat.scene import Scene

LINE, CURVE = '<path d="M8 36H88"/>', '<path d="M8 50C30 50 30 20 48 20S66 50 88 50"/>'
RING = '<circle cx="48" cy="36" r="22"/>'


def scene_of(paths: str, device: str, *, is_grey: bool = True) -> tuple[Scene, float]:
    image = drawn(paths)
    result = vectorized(image if is_grey else np.round(image), device, "line")
    return result.scene, scored(result).psnr


@pytest.mark.parametrize("is_grey", [True, False])
@pytest.mark.parametrize(
    ("paths", "widths"),
    [
        (f'{LINE}<path d="M40 36H88" stroke-width="7"/>', [3, 7]),
        ('<path d="M8 36H88" stroke-width="2"/><path d="M32 36H64" stroke-width="6"/>', [2, 2, 6]),
        (f'{CURVE}<path d="M48 20C66 20 66 50 88 50" stroke-width="6"/>', [3, 6]),
        (f'{RING}<path d="M48 14A22 22 0 0 1 48 58" stroke-width="6"/>', [3, 6]),
    ],
)
def test_a_line_of_two_pens_is_a_stroke_of_each(
    paths: str, widths: list[float], is_grey: bool, device: str
) -> None:
    scene, psnr = scene_of(f'{paths}<path d="M8 5H88M8 67H88"/>', device, is_grey=is_grey)
    assert sorted(scene.widths) == pytest.approx(sorted([*widths, 3, 3]), abs=0.3 if is_grey else 0.6)
    assert psnr > 21
    ends = scene.points[np.concatenate([scene.first[:-1], scene.first[1:] - 1])]
    away = np.linalg.norm(ends[:, None] - ends[None], axis=2) + 99 * np.eye(len(ends))
    assert (away.min(axis=1) < 0.1).sum() >= 2, "one begins where the other ends"


@pytest.mark.parametrize("is_grey", [True, False])
@pytest.mark.parametrize(
    "paths",
    [
        f'{LINE}<path d="M44 36H88" stroke-width="4"/>',
        f'{CURVE}<path d="M48 20C66 20 66 50 88 50" stroke-width="4"/>',
        RING,
    ],
)
def test_a_pixel_is_no_other_pen(paths: str, is_grey: bool, device: str) -> None:
    assert len(scene_of(paths, device, is_grey=is_grey)[0]) == 1
