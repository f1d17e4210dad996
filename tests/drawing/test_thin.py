"""Pictures of very few rows or columns are traced to what they show."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.drawings import vectorized
from tests.runs import scored
from warpsplat.fit.settings import make_settings
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
    result = vectorized(image, device, subject)
    assert (result.scene.canvas.width, result.scene.canvas.height) == image.shape[1::-1]
    return scored(result).psnr


@pytest.mark.parametrize("size", [(60, 2), (2, 60), (1, 40), (2, 2)])
def test_a_drawing(size: tuple[int, int], device: str) -> None:
    assert psnr_of(flag(*size), "drawing", device) == np.inf


@pytest.mark.parametrize("height", [1, 2])
def test_a_ramp_is_one_gradient(height: int, device: str) -> None:
    result = vectorized(ramp(60, height), device)
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
