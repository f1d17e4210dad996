"""Strokes are cut where their pen changes, and only there."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.drawing.trace.line_art import drawn
from tests.runs import scored, vectorize
from warpsplat.drawing.width_steps import by_stroke, cut_at_steps, rejoined
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.scene import Canvas, Kind, Scene

LINE, CURVE = '<path d="M8 36H88"/>', '<path d="M8 50C30 50 30 20 48 20S66 50 88 50"/>'
RING = '<circle cx="48" cy="36" r="22"/>'


def scene_of(paths: str, device: str, *, is_grey: bool = True) -> tuple[Scene, float]:
    image = drawn(paths)
    result = vectorize(
        image if is_grey else np.round(image), make_settings(subject="line"), Backend.on(device)
    )
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


def test_parts_are_the_stroke_that_was_cut() -> None:
    points = np.array([[8, 10], [20, 10], [30, 30], [40, 30], [60, 30], [70, 10], [88, 10]], np.float32)
    scene = Scene.uniform(Kind.STROKE, Canvas(96, 40, None), points[None])
    scene = replace(scene, widths=np.array([3], np.float32))
    lack = np.zeros((40, 96))
    lack[:, 24:40] = 0.3
    parts, owner = cut_at_steps(scene, lack, 3.0)
    assert owner.tolist() == [0, 0, 0]
    assert parts.widths[1] > parts.widths[0] + 1 and parts.widths[[0, 2]] == pytest.approx(3, abs=0.1)
    assert parts.points_of(1)[0] == pytest.approx(parts.points_of(0)[-1], abs=1e-4)
    assert parts.points_of(1)[[0, -1], 0] == pytest.approx([24, 40], abs=1.5)
    assert parts.points_of(2)[-3:] == pytest.approx(points[-3:], abs=12)
    assert rejoined(parts, owner).points == pytest.approx(parts.points, abs=1e-4)
    assert by_stroke(scene, lack)[0] == pytest.approx(0.3 * 16 * 8, rel=0.3)
    assert len(cut_at_steps(scene, lack, 99.0)[0]) == 1, "not at that price"
