"""Colours, few or many: palettes, ramps fitted to the error, gradients where they are worth their bytes."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from tests.fit.pictures import picture, step_for
from tests.runs import vectorize
from tests.scenes import random_scene, with_stops
from tests.svg.foreign import load_scene
from warpsplat.errors import UsageError
from warpsplat.fit.options import parse_palette
from warpsplat.fit.paints import choose_paints, with_ramps, without_gradients
from warpsplat.fit.palette import best_colors
from warpsplat.fit.ramps import RampSolver
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import psnr
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.renderer import render
from warpsplat.run.options import settings_from
from warpsplat.run.result import Result
from warpsplat.scene import Basis, Canvas, FloatArray, Kind, Paint, Scene
from warpsplat.svg.viewer import on_white, render_own

COLOR = re.compile(r'(?:fill|stroke)="(#[0-9a-f]{3,6})"')


def square_of(color: list[float], opacity: float) -> Scene:
    points = np.array([[[8, 8], [24, 8], [24, 24], [8, 24]]], np.float32)
    ground = Canvas(64, 48, np.zeros(3, np.float32))
    return Scene.uniform(
        Kind.FILL, ground, points, Basis.SPLINE, colors=np.array([color]), opacities=np.array([opacity])
    )


@pytest.mark.parametrize("kind", Kind)
@pytest.mark.parametrize(
    "given",
    [{"colors": 4}, {"palette": "#000,#fc2,#284,#48c"}, {"opaque": True}],
    ids=["4", "palette", "any"],
)
def test_files_are_opaque_and_have_no_other_colours(
    device: str, kind: Kind, given: dict[str, object]
) -> None:
    settings = make_settings(kind=kind, curves=20, iterations=60, **given)
    result = vectorize(picture(), settings, Backend.on(device))
    found = set(COLOR.findall(result.svg))
    assert found if "opaque" in given else 0 < len(found) <= 4
    assert "palette" not in given or found <= {"#000", "#fc2", "#284", "#48c"}
    assert "opacity" not in result.svg
    assert (result.scene.opacities > 0.99).all()
    assert result.score
    assert result.score.psnr > 12


@pytest.mark.parametrize("transparent", [False, True])
@pytest.mark.parametrize("opacity", [1.0, 0.5])
def test_the_error_is_least_at_the_best_colour(opacity: float, *, transparent: bool) -> None:
    """For a single shape: in each channel it grows as much on one side as on the other."""
    scene, target = square_of([0.2, 0.9, 0.4], opacity), picture()
    if transparent:
        scene = replace(scene, canvas=replace(scene.canvas, background=None))
        target = np.concatenate([0.7 * target, np.full_like(target[..., :1], 0.7)], axis=2)
    step = step_for(scene, target)
    best = best_colors(step, scene)

    def error(colors: FloatArray) -> float:
        step.state.parameters.assign(replace(scene, colors=colors))
        step.render()
        return step.objective.value()

    least = error(best)
    for channel in range(3):
        off = np.zeros((1, 3), np.float32)
        off[0, channel] = 0.05
        around = error(best + off), error(best - off)
        assert min(around) > least
        assert around[0] == pytest.approx(around[1], rel=1e-3)


def test_palettes_as_texts(tmp_path: Path) -> None:
    assert parse_palette("#F00, lime\n#f00, Red") == ("#ff0000", "#00ff00")
    for bad in ("rad", "#12", "", "#ggg"):
        with pytest.raises(UsageError, match="palette must be colours"):
            parse_palette(bad)
    file = tmp_path / "colors.txt"
    file.write_text("#fff\n#010203\n")
    assert settings_from({"palette": str(file)}).palette == ("#ffffff", "#010203")
    assert settings_from({"palette": "black,white"}).palette == ("#000000", "#ffffff")
    with pytest.raises(UsageError, match="No such file"):
        settings_from({"palette": str(tmp_path / "none")})


def sky() -> FloatArray:
    """From dark blue to yellow."""
    t = np.broadcast_to(np.linspace(0, 1, 64, dtype=np.float32)[:, None, None], (64, 80, 1))
    ends = np.array([[0.1, 0.2, 0.9], [1.0, 0.9, 0.2]], np.float32)
    return (1 - t) * ends[0] + t * ends[1]


NAMESPACE = 'xmlns="http://www.w3.org/2000/svg"'


def stripes(grey: int) -> Scene:
    """The upper half of an image in this grey, the lower half in as many stripes as make a usual file."""
    tall = [(0, 32, grey), *((32 + 2 * i, 2, 51 * (i % 2)) for i in range(16))]
    rects = (f'<rect x="-20" y="{y}" width="120" height="{h}" fill="rgb({g},{g},{g})"/>' for y, h, g in tall)
    return load_scene(f'<svg viewBox="0 0 80 64" {NAMESPACE}>{"".join(rects)}</svg>', 80, 64, "stripes")[0]


def run(image: FloatArray, device: str, **options: object) -> Result:
    settings = make_settings("draft", **{"curves": 12, "iterations": 160} | options)
    return vectorize(image, settings, Backend.on(device))


def test_auto_paints_a_sky_with_ramps(device: str) -> None:
    flat, auto = (run(sky(), device, paint=paint) for paint in ("flat", "auto"))
    assert flat.score and auto.score
    assert (flat.scene.paint == Paint.FLAT).all()
    assert (auto.scene.paint != Paint.FLAT).any()
    assert "Gradient" not in flat.svg
    assert auto.score.psnr > flat.score.psnr + 1, "over five seeds 8 to 12 dB more"


@pytest.mark.parametrize("ramp", [0.0, 0.3])
def test_auto_paints_flat_what_is_flat(device: str, ramp: float) -> None:
    """Shapes in their places, one of them in a wrong colour, or where the target brightens to the right."""
    settings = make_settings("draft", paint="auto", curves=17)
    scene = stripes(128)
    target = render(stripes(128 if ramp else 179), backend=Backend.on(device)).copy()
    target[:32] += np.float32(ramp) * np.linspace(-1, 1, 80, dtype=np.float32)[:, None]
    step = step_for(scene, target, device, settings)
    step.render()
    choose_paints(step)
    assert (step.state.scene().paint != Paint.FLAT).tolist() == [ramp > 0] + [False] * 16


@pytest.mark.parametrize("kind", [Paint.LINEAR, Paint.RADIAL])
def test_one_kind(device: str, kind: Paint) -> None:
    """The file is read back, and a viewer shows it as we do."""
    result = run(picture(), device, paint=kind.name.lower(), iterations=80)
    scene = result.scene
    assert set(scene.paint.tolist()) <= {Paint.FLAT, kind}
    assert (scene.paint == kind).any()
    assert result.svg.count(f"<{kind.name.lower()}Gradient ") > 0
    again, _ = load_scene(result.svg, 64, 48, "run")
    assert (np.bincount(again.paint, minlength=3) == np.bincount(scene.paint, minlength=3)).all()
    # One circle each: no matrix.
    assert "matrix" not in result.svg
    shown = on_white(render_own(result.svg))
    assert psnr(255 * render(again, backend=Backend.on(device)), shown) > 35, "42 to 47 dB over five seeds"


SIZE = 48


def solver_of(scene: Scene, target: FloatArray, device: str) -> RampSolver:
    step = step_for(scene, target, device)
    step.renderer.forward_complete()
    return RampSolver(step)


def error(scene: Scene, target: FloatArray, device: str) -> float:
    difference = render(scene, backend=Backend.on(device)).astype(np.float64) - target
    if difference.shape[2] == 4:
        black, white = difference[..., :3], difference[..., :3] - difference[..., 3:]
        return float((black**2 + white**2).mean() / 2)
    return float((difference**2).mean())


@pytest.mark.parametrize("clear", [False, True])
def test_gains_are_decreases_of_the_error(device: str, clear: bool) -> None:
    """Beyond the best flat colour, for translucent shapes behind others."""
    scene = random_scene(Kind.FILL, 5, SIZE, SIZE, seed=2)
    scene = replace(
        scene,
        canvas=Canvas(SIZE, SIZE, None if clear else scene.canvas.background),
        colors=0.35 + np.float32(0.3) * scene.colors,
    )
    image = render(scene, backend=Backend.on(device))
    y, x = np.mgrid[:SIZE, :SIZE] + 0.5
    # So little that no stop leaves [0, 1], and beyond the ends of a ramp next to nothing is seen.
    wave = 0.05 * np.stack([x / SIZE, y / SIZE, np.hypot(x, y) / SIZE], axis=2)
    target = image.copy()
    target[..., :3] += wave.astype(np.float32) * (image[..., 3:] if clear else 1)
    solver = solver_of(scene, target, device)
    seen = 0
    for kind, ramps in ((Paint.LINEAR, solver.linear()), (Paint.RADIAL, solver.radial(0.0))):
        counted = np.flatnonzero(ramps.gain > 0.05 * ramps.gain.max())
        for shape in counted:
            own = np.arange(len(scene)) == shape
            flat = without_gradients(scene, own, solver.flat)
            bent = with_ramps(scene, own, np.full(len(scene), kind, np.int32), ramps)
            fall = error(flat, target, device) - error(bent, target, device)
            # Ends that a shape hides in part take up to a quarter off, over five scenes.
            assert fall == pytest.approx(ramps.gain[shape], rel=0.5)
        seen += len(counted)
    assert seen > 2


def test_flattening_increases_the_error_as_predicted(device: str) -> None:
    scene = with_stops(random_scene(Kind.FILL, 5, SIZE, SIZE, seed=3), seed=4)
    scene.stop_opacities[:] = 1
    target = np.random.default_rng(0).uniform(0.3, 0.7, (SIZE, SIZE, 3)).astype(np.float32)
    solver = solver_of(scene, target, device)
    before = error(scene, target, device)
    bent = np.flatnonzero(scene.paint != Paint.FLAT)
    for shape in bent:
        flat = without_gradients(scene, np.arange(len(scene)) == shape, solver.flat)
        assert error(flat, target, device) - before == pytest.approx(solver.flattening[shape], rel=0.02)
    assert (solver.flattening[bent] != 0).all()
