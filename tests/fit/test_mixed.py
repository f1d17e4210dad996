"""Fills and strokes in one run: of each what removes more error."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

from tests.fit.pictures import empty_scene
from tests.runs import vectorize
from warpsplat.errors import UsageError
from warpsplat.fit.density import densify
from warpsplat.fit.settings import make_settings
from warpsplat.fit.streaks import Streaks
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Kind

BAR = cv2.RotatedRect((40.0, 30.0), (50.0, 4.0), 30.0)


def bar_and_disc() -> FloatArray:
    image = np.zeros((64, 96, 3), np.float32)
    cv2.line(image, (18, 18), (62, 42), (1.0, 1.0, 1.0), 4)
    cv2.circle(image, (80, 48), 10, (1.0, 0.2, 0.2), -1)
    return image


def streaks_of(mask: np.ndarray) -> Streaks:
    row, column = np.nonzero(mask)
    return Streaks.of(row, column, np.ones(len(row), np.intp), 2)


def test_a_bar_is_measured() -> None:
    mask = np.zeros((64, 96), np.uint8)
    cv2.fillPoly(mask, [np.round(BAR.points()).astype(np.int32)], 1)
    found = streaks_of(mask)
    np.testing.assert_allclose(found.centres[0], (40.5, 30.5), atol=1)
    assert np.degrees(found.angles[0]) == pytest.approx(30, abs=2)
    assert found.lengths[0] == pytest.approx(50, rel=0.06)
    assert found.widths[0] == pytest.approx(4.5, rel=0.2)
    assert found.shares[0] > 0.9
    assert found.stand_for(np.array([0.05], np.float32))[0]


def test_an_arc_is_no_bar() -> None:
    """A straight stroke over it would cover what it is not."""
    mask = np.zeros((64, 96), np.uint8)
    cv2.ellipse(mask, (48, 32), (28, 28), 0, 0, 180, 1, 3)
    assert not streaks_of(mask).stand_for(np.array([0.02], np.float32))[0]


def test_a_bar_gets_a_stroke_and_a_disc_a_fill() -> None:
    image = bar_and_disc()
    black = np.zeros_like(image)
    rng = np.random.default_rng(0)
    for mixed in (True, False):
        settings = make_settings(mixed=mixed)
        scene = empty_scene(settings, image)
        added = densify(settings, scene, image, black, 2, rng)
        x = np.array([added.points_of(i)[:, 0].mean() for i in range(2)])
        kinds = added.kind[np.argsort(x)].tolist()
        assert kinds == [Kind.STROKE if mixed else Kind.FILL, Kind.FILL]


def test_a_run_has_both_kinds(device: str) -> None:
    settings = make_settings(mixed=True, curves=8, iterations=40, background="#000000")
    result = vectorize(bar_and_disc(), settings, Backend.on(device))
    assert set(result.scene.kind) == {Kind.FILL, Kind.STROKE}
    assert np.isfinite(result.scene.points).all()
    assert result.score
    assert result.score.psnr > 15, "20 to 22 dB over five seeds"


def test_what_does_not_go_together() -> None:
    for given in ({"kind": Kind.STROKE}, {"renderer": "splat"}):
        with pytest.raises(UsageError, match="mixed and"):
            make_settings(mixed=True, **given)
