"""The paths that stand for soft Gaussians."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from tests.scenes import canvas, disc
from warpsplat.paper.as_paths import as_paths
from warpsplat.paper.models import GaussianModel
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray, Kind, Scene

SOFT = GaussianModel()


def line(width: float, opacity: float, fades: tuple[float, float, float] = (0, 0, 0)) -> Scene:
    """A white stroke on black."""
    points = np.stack([np.linspace(14, 82, 10), np.full(10, 24.3)], axis=1)[None]
    dark = replace(canvas(96, 48), background=np.zeros(3, np.float32))
    values = {"opacities": [opacity], "widths": [width], "fades": [fades]}
    arrays = {name: np.array(x, np.float32) for name, x in values.items()}
    return Scene.uniform(Kind.STROKE, dark, points, colors=np.ones((1, 3), np.float32), **arrays)


def seen(scene: Scene, device: str, *, soft: bool) -> FloatArray:
    backend = Backend.on(device)
    shown = render(scene, model=SOFT, backend=backend) if soft else render(scene, backend=backend)
    return shown[..., 0]


@pytest.mark.parametrize("width", [2.0, 9.0])
@pytest.mark.parametrize("opacity", [0.15, 0.6, 0.99])
def test_a_stroke_keeps_its_mass_and_its_contrast(device: str, width: float, opacity: float) -> None:
    scene = line(width, opacity)
    middle = slice(30, 66)
    soft = seen(scene, device, soft=True)[:, middle]
    path = seen(as_paths(scene, SOFT.softness), device, soft=False)[:, middle]
    # Of a narrow stroke, the least softness makes Gaussians overlap more along the row.
    wrong = 0.07 if width > 5 else 0.12
    assert path.sum() == pytest.approx(soft.sum(), rel=wrong)
    assert np.square(path).sum() == pytest.approx(np.square(soft).sum(), rel=2 * wrong)


def test_fades_are_taken_in_the_mean() -> None:
    even = as_paths(line(6, 0.8), SOFT.softness)
    uneven = as_paths(line(6, 0.8, (0, -0.5, 0)), SOFT.softness)
    assert (uneven.fades == 0).all()
    assert 0.75 * even.opacities[0] < uneven.opacities[0] < even.opacities[0]


@pytest.mark.parametrize("opacity", [0.1, 0.5, 0.98])
def test_a_fill_is_as_opaque_as_its_middle(device: str, opacity: float) -> None:
    scene = replace(disc(20, 56, 28.2), opacities=np.full(1, opacity, np.float32))
    inner = slice(20, 36)
    soft = seen(scene, device, soft=True)[inner, inner]
    path = as_paths(scene, SOFT.softness)
    assert path.opacities[0] == pytest.approx(soft.mean(), abs=0.06)


@pytest.mark.parametrize("turned", [False, True])
@pytest.mark.parametrize("radius", [5, 15])
def test_a_fill_keeps_its_mass(device: str, radius: int, turned: bool) -> None:
    """Its soft edges lie outside of its outline, and so does the path; whichever way the outline runs."""
    scene = disc(radius, 2 * radius + 16, radius + 8.2)
    if turned:
        scene = replace(scene, points=np.roll(scene.points[::-1], 1, axis=0))
    soft = seen(scene, device, soft=True).sum()
    assert seen(scene, device, soft=False).sum() < 0.9 * soft
    path = seen(as_paths(scene, SOFT.softness), device, soft=False).sum()
    assert path == pytest.approx(soft, rel=0.06)
