"""Forms: control points as functions of few values, their adjoint, and their elements."""

from __future__ import annotations

import re
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import warp as wp

import warpsplat
from tests.fit.pictures import picture
from tests.scenes import FORMS, forms_scene, random_scene, with_gradients
from warpsplat.errors import UsageError
from warpsplat.fit.settings import make_settings
from warpsplat.forms import form_of
from warpsplat.metrics import score_svg
from warpsplat.rendering.backend import Backend
from warpsplat.rendering.forms import record_gather, record_place
from warpsplat.rendering.parameters import Parameters
from warpsplat.rendering.renderer import render
from warpsplat.scene import Basis, Kind, Scene
from warpsplat.scene.geometry import areas
from warpsplat.svg.read import load_kept
from warpsplat.svg.write import rounded, write_svg

NAMES = ("triangle", "rectangle", "ellipse", "circle", "polygon:6", "line")
PICTURE = picture()


def single(which: int) -> Scene:
    """Return one shape of a form."""
    return forms_scene(seed=which).take(np.array([which]))


def reference(scene: Scene, values: np.ndarray) -> np.ndarray:
    """Return a shape's control points in float64."""
    form = form_of(Basis(int(scene.basis[0])).name)
    return form.outline(values[None].astype(np.float64), bool(scene.closed[0]))[0]


@pytest.mark.parametrize("which", range(len(FORMS)))
def test_control_points_and_adjoint(which: int, device: str) -> None:
    """Against the same functions in float64 and their central differences."""
    scene = single(which)
    backend = Backend.on(device)
    parameters = Parameters(scene, backend)
    program = backend.program()
    record_place(program, parameters)
    record_gather(program, parameters)
    grad = np.random.default_rng(which).normal(size=(parameters.point_count, 2))
    parameters.arrays["points_grad"].assign(wp.array(grad.astype(np.float32), dtype=wp.vec2, device=device))
    program.run()
    values = scene.points.astype(np.float64)
    np.testing.assert_allclose(parameters.arrays["points"].numpy(), reference(scene, values), atol=2e-5)
    np.testing.assert_allclose(scene.drawn().points, reference(scene, values), atol=2e-5)
    expected, step = np.zeros_like(values), 1e-5
    for place in np.ndindex(*values.shape):
        moved = np.zeros_like(values)
        moved[place] = step
        change = reference(scene, values + moved) - reference(scene, values - moved)
        expected[place] = (change * grad).sum() / (2 * step)
    found = parameters.gradients()["points"]
    np.testing.assert_allclose(found, expected, rtol=1e-4, atol=1e-4)
    assert np.abs(expected).max() > 0.1


@pytest.mark.parametrize("which", range(len(FORMS)))
def test_the_image_is_that_of_the_outlines(which: int, device: str) -> None:
    scene = single(which)
    backend = Backend.on(device)
    np.testing.assert_allclose(
        render(scene, backend=backend), render(scene.drawn(), backend=backend), atol=1e-4
    )
    np.testing.assert_allclose(areas(scene), areas(scene.drawn()), rtol=1e-5)


@pytest.mark.parametrize("per_pixel", [1.0, 4.0, 100.0])
@pytest.mark.parametrize("seed", range(6))
def test_elements_are_rounded_once_and_come_back(per_pixel: float, seed: int) -> None:
    """What is rounded is written as it is, and read as the same forms."""
    scene = rounded(forms_scene(80, 72, seed=seed), per_pixel)
    again = rounded(scene, per_pixel)
    np.testing.assert_allclose(again.points, scene.points, atol=1e-4)
    text = write_svg(scene, per_pixel=per_pixel)
    assert write_svg(again, per_pixel=per_pixel) == text
    assert "<path" not in text
    read = load_kept(text, 80, 72, "a.svg", forms=True).scene
    round_ones = np.where(read.basis == Basis.CIRCLE, scene.basis, read.basis)  # ellipses may be circles
    np.testing.assert_array_equal(round_ones, scene.basis)
    np.testing.assert_allclose(render(read), render(scene), atol=0.02)
    assert write_svg(rounded(read, per_pixel), per_pixel=per_pixel) == text
    assert not load_kept(text, 80, 72, "a.svg").scene.forms(), "curves, unless asked"


def test_gradients_of_turned_elements() -> None:
    """The file shows what the scene does, as it does where outlines are curves."""
    scene = with_gradients(forms_scene(64, 48))
    images = [
        score_svg(write_svg(each, per_pixel=100.0), render(scene)).psnr for each in (scene, scene.drawn())
    ]
    assert images[0] > images[1] - 0.1


@pytest.mark.parametrize(
    ("element", "expected"),
    [
        ('<circle cx="9" cy="9" r="5"/>', "CIRCLE"),
        ('<circle cx="9" cy="9" r="5" transform="scale(2 1)"/>', "CUBIC"),
        ('<ellipse cx="9" cy="9" rx="5" ry="3" transform="translate(9)rotate(30)scale(1.5)"/>', "ELLIPSE"),
        ('<rect x="3" y="4" width="9" height="7" transform="rotate(9)"/>', "RECTANGLE"),
        ('<rect x="3" y="4" width="9" height="7" transform="skewX(9)"/>', "CUBIC"),
        ('<rect x="3" y="4" width="9" height="7" rx="2"/>', "CUBIC"),
        ('<rect x="3" y="4" width="9" height="7" fill="none" stroke="red"/>', "RECTANGLE"),
        ('<rect x="3" y="4" width="9" height="7" stroke="red"/>', "CUBIC"),
        ('<polygon points="3 4 9 9 2 20" transform="skewX(9)"/>', "POLYGON"),
        ('<polyline points="3 4 9 9 2 20" fill="none" stroke="red"/>', "POLYGON"),
        ('<line x1="3" y1="4" x2="9" y2="9" stroke="red"/>', "POLYGON"),
        ('<path d="M3 4L9 9 2 20z"/>', "CUBIC"),
    ],
)
def test_which_elements_are_forms(element: str, expected: str) -> None:
    """Those that a form can hold; a path with fill and stroke is two shapes of the same points."""
    text = f'<svg xmlns="http://www.w3.org/2000/svg" width="40" height="36">{element}</svg>'
    scene = load_kept(text, 40, 36, "a.svg", forms=True).scene
    assert {Basis(basis).name for basis in scene.basis.tolist()} == {expected}
    np.testing.assert_allclose(render(scene), render(load_kept(text, 40, 36, "a.svg").scene), atol=1e-3)


ELEMENTS = {
    **{"triangle": "polygon", "rectangle": "rect", "ellipse": "(ellipse|circle)", "circle": "circle"},
    **{"polygon:6": "polygon", "line": "line"},
}


def fitted(shape: str, **given: Any) -> warpsplat.Result:
    common = {"curves": 9, "iterations": 60, "subject": "photo", "device": "cpu", "threads": 1}
    return warpsplat.vectorize(PICTURE, shape=shape, **common | given)


@pytest.mark.parametrize("shape", NAMES)
def test_a_run(shape: str) -> None:
    """Growth, replacement and rounding leave shapes of the form; the file has native elements only."""
    result = fitted(shape)
    assert result.score and result.score.psnr > score_svg(fitted(shape, iterations=1).svg, PICTURE).psnr + 1
    elements = re.findall(r"<(\w+)", result.svg.partition("<rect width")[2])
    assert sum(bool(re.fullmatch(ELEMENTS[shape], name)) for name in elements) == 9
    assert set(elements) <= {"g", *re.sub(r"[()]", "", ELEMENTS[shape]).split("|")}
    assert fitted(shape).svg == result.svg
    refined = warpsplat.refine(result.svg, PICTURE, iterations=60, device="cpu", threads=1)
    assert refined.score and refined.before and refined.score.psnr >= refined.before
    assert "<path" not in refined.svg


@pytest.mark.parametrize(
    "options", [{"paint": "linear"}, {"levels": "3,9"}, {"colors": 4}, {"max_bytes": 600}]
)
def test_with_other_options(options: dict[str, Any]) -> None:
    result = fitted("ellipse", **{"curves": None} | options)
    assert "<path" not in result.svg and result.score and result.score.psnr > 10


def test_refining_a_file_of_curves_and_forms() -> None:
    scene = forms_scene(64, 48).append(random_scene(Kind.FILL, 2, 64, 48))
    target = render(scene)
    moved = replace(scene, points=scene.points + np.float32(0.7))
    result = warpsplat.refine(write_svg(moved), target, iterations=80, device="cpu", threads=1)
    assert result.before and result.score and result.score.psnr > result.before + 3
    assert result.svg.count("<path") == 2


@pytest.mark.parametrize(
    ("given", "cause"),
    [
        ({"shape": "ellipse", "curves": "50"}, "curves must be"),
        ({"shape": "square"}, "shape must be one of curve, "),
        ({"shape": "polygon:2"}, "3 to 64 corners"),
        ({"shape": "ellipse", "open": True}, "shape ellipse and open cannot be combined"),
        ({"shape": "line", "closed": True}, "shape line and closed cannot be combined"),
        ({"shape": "circle", "mixed": True}, "mixed and shape circle"),
        ({"shape": "circle", "subject": "drawing"}, "subject drawing and shape circle cannot be combined"),
        ({"basis": "circle"}, "basis must be one of cubic, spline"),
    ],
)
def test_refusals(given: dict[str, Any], cause: str) -> None:
    with pytest.raises(UsageError, match=cause):
        make_settings(**given)


def test_scenes_that_no_form_has() -> None:
    scene = forms_scene()
    circle = single(list(Basis).index(Basis.CIRCLE) - 2)
    with pytest.raises(ValueError, match="cannot have 2 control points"):
        replace(circle, basis=np.array([Basis.ELLIPSE], np.int32))
    with pytest.raises(ValueError, match="control points"):
        replace(scene.take(np.arange(1)), starts=np.array([0, 2, 5], np.int32), closed=np.ones(2, np.int32))
