"""Soft Gaussians: against float64, the paths that stand for them, and strokes that become two."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import torch

from tests.fit.pictures import picture, step_for
from tests.helpers import adjoint, relative_error, renderer_for
from tests.paper.helpers import soft_image
from tests.scenes import canvas, disc, mixed_scene, points_by_shape, random_scene, with_gradients
from warpsplat.fit.densification import densify
from warpsplat.fit.settings import make_settings
from warpsplat.paper.as_paths import as_paths
from warpsplat.paper.models import GaussianModel
from warpsplat.paper.split import opacities_by_third, split
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.scene import FloatArray, Kind, Scene

FILL, STROKE = Kind.FILL, Kind.STROKE
SOFT = GaussianModel()
CASES = [(FILL, 2, 1.0, True), (STROKE, 1, 1.0, True), (STROKE, 4, 1.0, True)]
CASES += [(FILL, 4, 0.6, True), (STROKE, 3, 1.7, True), (FILL, 2, 1.0, False), (STROKE, 3, 1.0, False)]


def faded(scene: Scene, seed: int = 5) -> Scene:
    """With strokes whose thirds differ in opacity."""
    rng = np.random.default_rng(seed)
    fades = np.where(scene.kind[:, None] == STROKE, rng.uniform(-0.35, 0.04, (len(scene), 3)), 0)
    return replace(scene, fades=fades.astype(np.float32))


def compare(scene: Scene, device: str, scale: float, model: GaussianModel, lanes: int | None = None) -> None:
    """Image and all gradients against the reference, for a random gradient of the image."""
    renderer = renderer_for(scene, device, scale, model=model, lanes=lanes)
    p, image = soft_image(scene, renderer, model.softness, detach=not model.through_scales)
    # The cut makes single pixels differ where float32 and float64 decide differently.
    np.testing.assert_allclose(renderer.read_image(), image.detach().numpy(), atol=2e-2)
    assert np.abs(renderer.read_image() - image.detach().numpy()).mean() < 5e-6
    weights = np.random.default_rng(1).normal(size=(*image.shape,))
    (image * torch.tensor(weights)).sum().backward()
    rows = np.flatnonzero(scene.kind == STROKE)
    for name, found in adjoint(renderer, weights.astype(np.float32)).items():
        gradient = p[name].grad
        want = np.zeros(found.shape) if gradient is None else gradient.numpy()
        # Fills have no widths and fades, so that nothing reads those gradients.
        picked = rows if name in ("fades", "widths") else slice(None)
        got, want = found[picked], want[picked]
        assert not want.size or relative_error(got, want) < 2e-3, name


@pytest.mark.parametrize(("kind", "cubics", "scale", "through_scales"), CASES)
def test_image_and_gradients(
    device: str, kind: Kind, cubics: int, scale: float, through_scales: bool
) -> None:
    scene = faded(random_scene(kind, beziers=cubics, seed=3))
    compare(scene, device, scale, GaussianModel(through_scales=through_scales))


@pytest.mark.parametrize("lanes", [1, 64])
def test_fills_and_strokes_of_different_lengths(device: str, lanes: int) -> None:
    compare(faded(mixed_scene(splines=False)), device, 1.0, GaussianModel(0.4, 1.2), lanes)


def test_gradients_of_clamped_opacities_point_inwards(device: str) -> None:
    scene = random_scene(STROKE, 1, seed=2)
    over = replace(scene, fades=np.array([[1.5, 0, 0]], np.float32))
    renderer = renderer_for(over, device, model=SOFT)
    background = scene.canvas.background
    assert background is not None
    gradients = []
    for sign in (1, -1):
        renderer.forward()
        renderer.write_image_grad(sign * (renderer.read_image() - background))
        renderer.backward()
        gradients.append(renderer.parameters.gradients()["fades"][0])
    shrinks = gradients[0]
    assert (shrinks > 0).all(), "less of the stroke is what the first gradient asks for"
    assert gradients[1][0] == 0, "it cannot be more than opaque"
    np.testing.assert_allclose(gradients[1][1:], -shrinks[1:], rtol=1e-5)


def test_gradients_are_refused(device: str) -> None:
    with pytest.raises(ValueError, match="flat colours, no gradients"):
        renderer_for(with_gradients(random_scene(FILL)), device, model=SOFT)


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


def with_fades(scene: Scene, *fades: tuple[float, float, float]) -> Scene:
    opaque = np.full(len(scene), 0.9, np.float32)
    return replace(scene, opacities=opaque, fades=np.array(fades, np.float32))


def test_split_strokes_are_their_visible_ends(device: str) -> None:
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
