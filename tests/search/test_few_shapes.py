"""Files of a few shapes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import disc, random_scene
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, Kind
from warpsplat.search.candidate import smaller
from warpsplat.search.few_shapes import FEW, OPACITY, fit_background, for_few
from warpsplat.svg.write import path_sizes


def test_settings_of_few_shapes() -> None:
    few = for_few(make_settings(curves=10))
    assert few.opacity == OPACITY and few.spline_points < make_settings().spline_points
    assert for_few(make_settings(curves=FEW + 1)) == make_settings(curves=FEW + 1)
    strokes = for_few(make_settings(curves=10, kind=Kind.STROKE))
    assert strokes.opacity == make_settings().opacity
    assert strokes.fine_pixels == few.fine_pixels
    assert for_few(make_settings(curves=10, opaque=True)).opacity == make_settings().opacity


def test_the_ground_is_what_shows_between_shapes(device: str) -> None:
    backend = Backend.on(device)
    scene = disc(10, 30, 15)
    wanted = np.array([0.2, 0.6, 0.8], np.float32)
    on_wanted = replace(scene, canvas=replace(scene.canvas, background=wanted))
    image = render(on_wanted, backend=backend)
    found = fit_background(scene, image, backend).canvas.background
    assert found is not None
    np.testing.assert_allclose(found, wanted, atol=0.51 / 255)
    assert scene.canvas.background is not None
    assert np.abs(scene.canvas.background - wanted).max() > 0.1, "it was another one"


@pytest.mark.parametrize("excess", [10, 60, 200])
def test_what_is_less_than_a_shape_goes_by_points(excess: float) -> None:
    scene = random_scene(Kind.FILL, count=6, basis=Basis.SPLINE)
    sizes = path_sizes(scene, 1.0)
    seen = np.arange(1, 7, dtype=np.float32)
    left = smaller(scene, seen, sizes, excess)
    gone = sizes.sum() - path_sizes(left, 1.0).sum()
    assert 0 < gone < excess + sizes.mean() / 3
    assert len(scene) - len(left) == (np.cumsum(sizes) <= excess).sum()


def test_of_cubics_a_whole_shape_goes() -> None:
    scene = random_scene(Kind.FILL, count=6)
    left = smaller(scene, np.arange(1, 7, dtype=np.float32), path_sizes(scene, 1.0), 1.0)
    assert len(left) == 5
