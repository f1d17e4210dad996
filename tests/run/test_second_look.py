"""A subject whose file shows much less of an image than a file of that size could is not kept."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest

import warpsplat
from tests.drawing.trace.drawings import LOGO, draw, ground, photograph
from warpsplat.drawing.draft import draw_pixels
from warpsplat.drawing.draw import draw_regions
from warpsplat.drawing.trace.subject import Guess
from warpsplat.fit.export import finished
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import psnr_of_file
from warpsplat.run import prepare
from warpsplat.run.second_look import other_subject
from warpsplat.scene import FloatArray

FEW: dict[str, Any] = {"quality": "draft", "iterations": 5, "device": "cpu"}


def soft_stroke() -> FloatArray:
    """Blurred beyond all edges: a drawing of it has a few steps."""
    image = np.ones((96, 96), np.float32)
    cv2.ellipse(image, (48, 48), (26, 20), 0, 0, 300, 0, 7)
    return np.repeat(cv2.GaussianBlur(image, (0, 0), 5)[..., None], 3, axis=2).astype(np.float32)


def problem(image: FloatArray, **given: Any) -> Problem:
    return Problem(image, make_settings("draft", **given))


def noisy_cells(image: FloatArray, shown: FloatArray) -> tuple[Fit, Problem]:
    """The cells of one image as the file of another."""
    posed = problem(image, subject="pixel")
    return draw_pixels(replace(posed, target=shown), Run(None)), posed


def test_cells_of_something_else_are_not_kept() -> None:
    image = draw(ground("#fff") + LOGO)[..., :3]
    cells = np.kron(np.random.default_rng(0).integers(0, 2, (48, 48, 1)), np.ones((2, 2, 3))).astype(
        np.float32
    )
    made, posed = noisy_cells(image, cells)
    assert other_subject(made, posed) == "drawing"
    same, _ = noisy_cells(image, image)
    assert other_subject(same, posed) is None


def test_a_drawing_that_shows_little_is_fitted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepare, "guess_subject", lambda target: Guess("drawing", "it was drawn"))
    result = warpsplat.vectorize(soft_stroke(), **FEW)
    assert result.subject == "photo"
    assert result.why == "as a drawing it would show too little of the image"


@pytest.mark.parametrize(
    "given", [{"colors": 2}, {"max_bytes": 400}, {"detail": 0.0}, {"subject": "drawing"}]
)
def test_what_was_asked_for_is_kept(given: dict[str, Any], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(prepare, "guess_subject", lambda target: Guess("drawing", "it was drawn"))
    assert warpsplat.vectorize(soft_stroke(), quality="draft", device="cpu", **given).subject == "drawing"


def test_a_drawing_that_shows_enough_is_kept() -> None:
    result = warpsplat.vectorize(draw(ground("#fff") + LOGO)[..., :3], **FEW)
    assert result.subject == "drawing" and "flat" in result.why


def test_photographs_get_no_second_look() -> None:
    image = photograph(48)
    made = Fit(prepare.starting_scene(image, 4), 4.0, 10.0, 10.0, 1, interrupted=False)
    assert other_subject(made, problem(image, subject="photo")) is None


def test_a_sharp_drawing_of_a_blurred_picture_is_kept() -> None:
    """It shows less of it than a thumbnail would, but all of it through the blur."""
    lines = np.ones((96, 96), np.float32)
    for start, end in np.random.default_rng(1).integers(6, 90, (12, 2, 2)).tolist():
        cv2.line(lines, start, end, 0, 4, cv2.LINE_AA)
    blurred = np.repeat(cv2.GaussianBlur(lines, (0, 0), 1.2)[..., None], 3, axis=2).astype(np.float32)
    posed = problem(blurred, subject="drawing")
    made = draw_regions(posed, Run(None))
    assert psnr_of_file(finished(made.scene, posed.settings, made.per_pixel), blurred) < 20
    assert other_subject(made, posed) is None
