"""Weights of pixels by masks and texture, and their effect on a run."""

from __future__ import annotations

import numpy as np
import pytest

from tests.fit.pictures import picture
from warpsplat.fit.importance import BLACK_WEIGHT, TEXTURE_NOISE, pixel_weights, weights_at
from warpsplat.fit.loop import fit
from warpsplat.fit.problem import Problem, Run
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render


@pytest.mark.parametrize("size", [(12, 8), (6, 4), (24, 16), (18, 12), (7, 5)])
def test_weights_are_linear_in_the_grey_of_any_size(size: tuple[int, int]) -> None:
    mask = np.zeros((8, 12), np.float32)
    mask[:4] = 1
    weights = pixel_weights(np.zeros((size[1], size[0], 3), np.float32), mask, 0.0)
    assert weights is not None
    assert weights.shape == size[::-1]
    assert weights[-1, 0] == pytest.approx(BLACK_WEIGHT * weights[0, 0], rel=1e-5)
    image = np.zeros((4, 6, 3), np.float32)
    assert pixel_weights(image, None, 0.0) is None
    for grey in (0.0, 0.5, 1.0):  # of all pixels alike
        even = pixel_weights(image, np.full((8, 12), grey, np.float32), 0.0)
        assert even is not None and (weights_at(even, 6, 4) == 1).all()


def test_texture_counts_less_by_a_power_of_its_variance() -> None:
    noise = np.random.default_rng(0).normal(0, 1, (120, 240, 1))
    noise[:, :120] *= 0.04
    noise[:, 120:] *= 0.16
    image = np.repeat(0.5 + noise, 3, 2).astype(np.float32)
    weights = pixel_weights(image, None, 0.3)
    assert weights is not None
    left, right = (weights[30:90, columns].mean() for columns in (slice(30, 90), slice(150, 210)))
    variances = [deviation**2 + TEXTURE_NOISE**2 for deviation in (0.04, 0.16)]
    assert left / right == pytest.approx((variances[1] / variances[0]) ** 0.3, rel=0.05)
    masked = pixel_weights(image, np.full((12, 24), 0.5, np.float32), 0.3)
    assert masked is not None
    np.testing.assert_allclose(weights_at(masked, 240, 120), weights_at(weights, 240, 120), rtol=1e-5)


def test_a_run_comes_nearer_where_the_mask_is_white(device: str) -> None:
    target = picture()
    height, width = target.shape[:2]
    mask = np.zeros((height, width), np.float32)
    mask[:, : width // 2] = 1
    settings = make_settings(curves=12, iterations=60, coarse_pixels=1000, texture=0.0)
    shares = []
    for importance in (mask, 1 - mask):
        scene = fit(Problem(target, settings, importance), Run(Backend.on(device))).scene
        squares = (render(scene, backend=Backend.on(device)) - target) ** 2
        shares.append(squares[mask == 1].sum() / squares.sum())
    # Of the error, the left half has 0.10 to 0.18 or 0.79 to 0.90, over five seeds.
    assert shares[0] < 0.4
    assert shares[1] > 0.5
