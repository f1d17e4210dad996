"""Quality by the number of shapes."""

from __future__ import annotations

import numpy as np
import pytest

from tests.fit.pictures import picture
from warpsplat.fit.settings import make_settings
from warpsplat.fit.survey import expected_gain, lost_detail, survey, worth_by
from warpsplat.rendering.backend import Backend


def test_a_parabola_and_a_power_are_found_again() -> None:
    shapes = [20, 40, 100, 300, 900]
    x = np.log2(shapes)
    worth = worth_by(shapes, (10 + 3 * x - 0.1 * x * x).tolist(), [100 * n for n in shapes], 1024)
    assert worth.misfit == pytest.approx(0, abs=1e-6)
    assert float(worth.psnr(64)) == pytest.approx(10 + 18 - 3.6)
    assert float(worth.size(50)) == pytest.approx(0.92 * 5000)


def test_one_measurement_is_a_level() -> None:
    worth = worth_by([16], [25.0], [2000], 16)
    assert float(worth.psnr(16)) == pytest.approx(25)
    assert float(worth.size(16)) == pytest.approx(0.92 * 2000)


@pytest.mark.parametrize("psnr", [22.0, 28.0])
def test_it_goes_through_what_was_probed(psnr: float) -> None:
    """With less quality than the reduced image promised, details stay lost; with more, errors are smaller."""
    plain = worth_by([20, 100, 1000], [20.0, 25, 30], [2000, 10_000, 100_000], 1024)
    worth = plain.through(100, psnr, 0.0)
    assert float(worth.psnr(100)) == pytest.approx(psnr)
    gain, before = (float(one.psnr(1000) - one.psnr(100)) for one in (worth, plain))
    assert gain == pytest.approx(before) if psnr > 25 else gain < before
    assert float(plain.through(100, psnr, 1e-3).psnr(100)) < psnr


def test_what_is_hard_to_draw_gains_less() -> None:
    assert expected_gain(25.0, 0.0) == pytest.approx(1)
    assert expected_gain(29.3, 0.0) == pytest.approx(2)
    assert expected_gain(29.3, 4.0) == pytest.approx(1)
    assert expected_gain(60.0, -1.0) == 5


def test_detail_that_the_finest_size_lacks() -> None:
    image = np.random.default_rng(0).random((32, 32, 3), dtype=np.float32)
    assert lost_detail(image, make_settings()) == 0
    assert lost_detail(image, make_settings(fine_pixels=256, coarse_pixels=256)) > 0.03


def test_survey(monkeypatch: pytest.MonkeyPatch) -> None:
    """More shapes are better and larger; what is asked to stop stops."""
    monkeypatch.setattr("warpsplat.fit.survey.STEPS", 60)
    monkeypatch.setattr("warpsplat.fit.survey.INTERVAL", 10)
    image, backend = picture(), Backend.on("cpu", 1)
    work: list[float] = []
    worth = survey(image, make_settings(), backend, report=lambda now: work.append(now.work))
    assert worth is not None
    assert worth.most == 64 * 48 // 8
    assert float(worth.psnr(200)) > float(worth.psnr(50)) + 1
    assert float(worth.size(200)) > 2 * float(worth.size(50))
    assert work == sorted(work) and work[-1] == pytest.approx(1, abs=0.05)
    assert survey(image, make_settings(), backend, stop=lambda: True) is None
