"""Strokes that fade in the middle become two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from tests.fit.pictures import picture, step_for
from tests.scenes import mixed_scene, points_by_shape, random_scene
from warpsplat.fit.densification import densify
from warpsplat.fit.settings import make_settings
from warpsplat.paper.split import MIN_FADE, faded, opacities_by_third, split
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import Kind, Scene


def with_fades(scene: Scene, *fades: tuple[float, float, float]) -> Scene:
    opaque = np.full(len(scene), 0.9, np.float32)
    return replace(scene, opacities=opaque, fades=np.array(fades, np.float32))


def test_only_a_middle_that_fades_counts() -> None:
    fades = ((0, -MIN_FADE - 0.1, 0), (0, -MIN_FADE + 0.1, 0), (-0.7, -0.7, 0), (0, -0.8, 0))
    np.testing.assert_array_equal(faded(with_fades(random_scene(Kind.STROKE, 4), *fades)), [0, 3])
    mixed = mixed_scene(splines=False)
    assert len(faded(with_fades(mixed, *[(0, -0.8, 0)] * len(mixed)))) == 1, "strokes of three cubics"


def test_the_parts_are_the_ends(device: str) -> None:
    """Drawn as paths: the first and the last cubic of each stroke, in its colour, as opaque as they were."""
    scene = with_fades(random_scene(Kind.STROKE, 2, seed=4), (0.05, -0.8, 0), (0, -0.9, -0.1))
    parts = split(scene, np.arange(2))
    points = points_by_shape(scene)
    cubics = Scene.uniform(
        Kind.STROKE,
        scene.canvas,
        np.stack([points[:, :4], points[:, 6:]], axis=1).reshape(4, 4, 2),
        colors=np.repeat(scene.colors, 2, axis=0),
        opacities=opacities_by_third(scene)[:, [0, 2]].ravel(),
        widths=np.repeat(scene.widths, 2),
    )
    np.testing.assert_allclose(parts.opacities, [0.95, 0.9, 0.9, 0.8], rtol=1e-6)
    drawn, wanted = (render(s, backend=Backend.on(device)) for s in (parts, cubics))
    assert np.abs(drawn - wanted).mean() < 1e-3


def test_densification_splits_and_keeps_the_number(device: str) -> None:
    settings = make_settings(renderer="gaussian", kind=Kind.STROKE, curves=20, iterations=200)
    settings = replace(settings, density=replace(settings.density, start=1, surplus=1))
    scene = with_fades(random_scene(Kind.STROKE, 20, 64, 48, seed=1), *[(0, 0, 0)] * 19, (0, -0.85, 0))
    last = scene.points_of(19)
    step = step_for(scene, picture(), device, settings)
    densify(step, grows=True)
    after = step.state.scene()
    assert len(after) == 20
    starts = np.stack([after.points_of(i)[[0, -1]] for i in range(20)])
    for end in (last[[0, 3]], last[[6, 9]]):
        assert (np.abs(starts - end).max(axis=(1, 2)) < 1e-4).any()
