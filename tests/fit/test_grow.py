"""New shapes where the error is, as fills or strokes."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest

from tests.fit.pictures import empty_scene
from tests.runs import vectorize
from warpsplat.fit.grow import ERROR_LEVELS, candidates, new_shapes
from warpsplat.fit.importance import pixel_weights
from warpsplat.fit.settings import make_settings
from warpsplat.portable import filters
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Kind
from warpsplat.scene.geometry import areas


@pytest.mark.parametrize("kind", list(Kind))
@pytest.mark.parametrize("weighted", [False, True])
def test_new_shapes_come_where_the_weighted_error_is(kind: Kind, weighted: bool) -> None:
    target = np.full((60, 80, 3), 0.5, np.float32)
    image = target.copy()
    target[10:22, 50:62] = [1.0, 0.0, 0.0]
    target[40:52, 10:22] = [0.8, 0.2, 0.2]
    mask = (np.arange(60) >= 30).astype(np.float32)[:, None].repeat(80, axis=1)
    settings = make_settings(kind=kind)
    scene = empty_scene(settings, target)
    scene = replace(scene, canvas=replace(scene.canvas, width=160, height=120))
    error = np.square(image - target).sum(axis=2) * (pixel_weights(target, mask, 0.0) if weighted else 1)
    added = new_shapes(settings, scene, target, error, 1, np.random.default_rng(0))
    assert len(added) == 1
    np.testing.assert_allclose(added.points.mean(axis=0), [32, 92] if weighted else [112, 32], atol=5)
    assert 200 < areas(added)[0] < 1000, "the square has 24 x 24 canvas units"
    np.testing.assert_allclose(added.colors[0], [0.8, 0.2, 0.2] if weighted else [1, 0, 0], atol=0.05)


def test_a_candidate_is_the_deepest_pixel_of_its_component() -> None:
    error = filters.gaussian_blur(np.random.default_rng(2).random((40, 60), np.float32), 1.0)
    top = float(np.quantile(error, 0.995))
    wanted = []
    for level in range(1, ERROR_LEVELS):
        mask = (error >= top * level / ERROR_LEVELS).astype(np.uint8)
        depth = filters.distance(np.pad(mask, 1))[1:-1, 1:-1]
        count, labels = cv2.connectedComponents(mask, connectivity=4)
        for label in range(1, count):
            row, column = np.argwhere((labels == label) & (depth == depth[labels == label].max()))[-1]
            wanted.append((column + 0.5, row + 0.5, depth[row, column], error[labels == label].sum()))
    found = candidates(error, mixed=False)
    assert len(wanted) > 20
    places = np.column_stack([found.centres, found.radii])
    np.testing.assert_array_equal(places, np.array(wanted)[:, :3].astype(np.float32))
    assert (found.masses <= 1.001 * np.array(wanted)[:, 3]).all()


def bar_and_disc() -> FloatArray:
    image = np.zeros((64, 96, 3), np.float32)
    cv2.line(image, (18, 18), (62, 42), (1.0, 1.0, 1.0), 4)
    cv2.circle(image, (80, 48), 10, (1.0, 0.2, 0.2), -1)
    return image


def test_a_mixed_run_has_both_kinds(device: str) -> None:
    settings = make_settings(mixed=True, curves=8, iterations=40, background="#000000")
    result = vectorize(bar_and_disc(), settings, Backend.on(device))
    assert set(result.scene.kind) == {Kind.FILL, Kind.STROKE}
    assert np.isfinite(result.scene.points).all()
    assert result.score
    assert result.score.psnr > 15, "20 to 22 dB over five seeds"
