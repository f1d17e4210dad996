"""Pictures of very few rows or columns are traced to what they show."""

from __future__ import annotations

import numpy as np
import pytest

from tests.runs import scored, vectorize
from warpsplat.drawing.thin import BEYOND, THIN_SIDE, continued, cut, margins
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.run.prepare import choose_subject


def ramp(width: int, height: int) -> np.ndarray:
    image = np.full((height, width, 3), 0.5, np.float32)
    image[..., 0] = np.linspace(0, 1, width)
    return image


def flag(width: int, height: int) -> np.ndarray:
    image = np.ones((height, width, 3), np.float32)
    image[:, width // 3 : 2 * width // 3] = (0.8, 0.1, 0.1)
    image[height // 2 :, : width // 3] = 0
    return image


def psnr_of(image: np.ndarray, subject: str, device: str) -> float:
    result = vectorize(image, make_settings(subject=subject), Backend.on(device))
    assert (result.scene.canvas.width, result.scene.canvas.height) == image.shape[1::-1]
    return scored(result).psnr


@pytest.mark.parametrize("size", [(60, 2), (2, 60), (1, 40), (2, 2)])
def test_a_drawing(size: tuple[int, int], device: str) -> None:
    assert psnr_of(flag(*size), "drawing", device) == np.inf


@pytest.mark.parametrize("height", [1, 2])
def test_a_ramp_is_one_gradient(height: int, device: str) -> None:
    result = vectorize(ramp(60, height), make_settings(subject="drawing"), Backend.on(device))
    assert len(result.scene) == 1
    assert scored(result).psnr > 40


def test_what_has_no_regions_is_its_cells(device: str) -> None:
    noise = np.random.default_rng(0).random((2, 20, 3)).astype(np.float32)
    assert psnr_of(noise, "drawing", device) > 60
    assert choose_subject(noise, make_settings())[0].subject == "pixel"


def test_lines_across(device: str) -> None:
    image = np.ones((2, 60, 3), np.float32)
    image[:, 3::14] = 0
    image[:, 4::14] = 0
    assert psnr_of(image, "line", device) > 20


def test_what_is_continued_is_cut_again() -> None:
    image = ramp(30, 3)
    across, down = margins(image, THIN_SIDE)
    assert (across, down) == (0, BEYOND)
    wide = continued(image, across, down)
    assert wide.shape == (3 + 2 * BEYOND, 30, 3) and (wide[:BEYOND] == image[0]).all()
    made = vectorize(wide, make_settings(subject="drawing"), Backend.on("cpu")).scene
    small = cut(made, across, down)
    assert (small.canvas.width, small.canvas.height) == (30, 3)
    np.testing.assert_allclose(small.points, made.points - (0, BEYOND))
