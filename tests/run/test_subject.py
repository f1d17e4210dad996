"""Which subject an image is taken for, and what becomes of options without effect on it."""

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
from warpsplat.errors import UsageError
from warpsplat.fit.export import finished
from warpsplat.fit.problem import Fit, Problem, Run
from warpsplat.fit.settings import make_settings
from warpsplat.metrics import psnr_of_file
from warpsplat.run import prepare
from warpsplat.run.prepare import choose_subject
from warpsplat.run.second_look import other_subject
from warpsplat.scene import FloatArray

CELLS = np.kron(np.random.default_rng(0).integers(0, 2, (12, 12, 1)), np.ones((8, 8, 3))).astype(np.float32)

IMAGES = {"drawing": draw(ground("#fff") + LOGO)[..., :3], "photo": photograph(96), "pixel": CELLS}


def eight_bits(image: FloatArray) -> np.ndarray:
    return np.round(255 * image).astype(np.uint8)


@pytest.mark.parametrize("shown", IMAGES)
def test_default_options_need_no_note(shown: str) -> None:
    settings, why, notes = choose_subject(
        IMAGES[shown], make_settings("draft" if shown == "drawing" else "balanced")
    )
    assert (settings.subject, notes) == (shown, ()) and why


@pytest.mark.parametrize("shown", ["drawing", "pixel"])
@pytest.mark.parametrize(
    ("given", "called"),
    [
        ({"open": True}, "open"),
        ({"shape": "ellipse"}, "shape ellipse"),
        ({"mixed": True}, "mixed"),
        ({"renderer": "splat"}, "renderer splat"),
        ({"layered": True}, "layered"),
        ({"levels": "8,16"}, "levels"),
        ({"target_psnr": 30.0}, "target-psnr"),
    ],
)
def test_options_that_ask_for_a_fit(shown: str, given: dict[str, Any], called: str) -> None:
    settings, _, notes = choose_subject(IMAGES[shown], make_settings(**given))
    assert settings.subject == "photo"
    (note,) = notes
    assert f"but {called} asks for fitted shapes" in note and "without it the image would be traced" in note
    _, _, notes = choose_subject(IMAGES[shown], make_settings("draft", iterations=9, **given))
    assert len(notes) == 1, "what a quality stands for was not asked for by name"
    _, why, notes = choose_subject(IMAGES["photo"], make_settings(**given))
    assert why and not notes


@pytest.mark.parametrize(
    ("shown", "given", "called"),
    [
        ("drawing", {"loss": "edges"}, "loss edges has"),
        ("drawing", {"quality": "high"}, "quality high has"),
        ("drawing", {"iterations": 300, "quality": "draft"}, "iterations has"),
        ("drawing", {"seed": 3, "opaque": True}, "opaque and seed have"),
        ("photo", {"detail": 0.8}, "detail has"),
        ("photo", {"symbols": True, "strokes": True, "detail": 0.2}, "detail, symbols and strokes have"),
        (
            "pixel",
            {"quality": "draft", "curves": 50, "paint": "auto"},
            "curves, paint auto and quality draft have",
        ),
    ],
)
def test_options_without_effect_leave_the_subject(shown: str, given: dict[str, Any], called: str) -> None:
    settings, _, notes = choose_subject(IMAGES[shown], make_settings(**given))
    assert settings.subject == shown
    (note,) = notes
    assert note.startswith(f"{called} no effect on a ")


@pytest.mark.parametrize(
    ("shown", "given"),
    [
        ("drawing", {"max_bytes": 900}),
        ("drawing", {"paint": "flat", "detail": 0.8, "curves": 30}),
        ("drawing", {"colors": 4}),
        ("photo", {"paint": "auto", "loss": "ssim", "quality": "high", "seed": 2, "opaque": True}),
    ],
)
def test_options_with_an_effect_need_no_note(shown: str, given: dict[str, Any]) -> None:
    settings, _, notes = choose_subject(IMAGES[shown], make_settings(**given))
    assert (settings.subject, notes) == (shown, ())


def test_a_subject_that_is_given_is_not_changed() -> None:
    with pytest.raises(UsageError, match=r"loss edges cannot be combined; loss edges needs subject photo$"):
        make_settings(subject="drawing", loss="edges")
    with pytest.raises(UsageError, match=r"symbols needs subject drawing$"):
        make_settings(subject="photo", symbols=True)
    settings = make_settings(subject="drawing", quality="high")
    assert choose_subject(IMAGES["drawing"], settings)[1:] == (
        "",
        ("quality high has no effect on a drawing",),
    )


def test_results_have_the_notes() -> None:
    image = eight_bits(IMAGES["drawing"])
    plain = warpsplat.vectorize(image, quality="draft")
    made = warpsplat.vectorize(image, quality="draft", loss="edges", importance=image)
    assert made.svg == plain.svg and not plain.notes
    assert made.notes == (
        "loss edges has no effect on a drawing",
        "importance has no effect on a drawing",
    )
    assert made.as_dict()["notes"] == [*made.notes]


def test_a_loss_of_your_own_asks_for_a_fit() -> None:
    made = warpsplat.vectorize(
        eight_bits(IMAGES["drawing"]),
        4,
        iterations=2,
        loss=lambda image: (float((image**2).sum()), 2 * image),
        device="cpu",
    )
    assert made.subject == "photo" and "a loss function asks for fitted shapes" in made.notes[0]


def test_an_image_of_which_nothing_is_seen_is_noted() -> None:
    (note,) = warpsplat.vectorize(np.zeros((24, 24, 4), np.uint8)).notes
    assert note.startswith("every pixel is fully transparent")


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


def test_a_drawing_without_background_is_fitted_and_scored_as_a_photograph(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    given = {"background": "none", **FEW}
    asked = warpsplat.vectorize(soft_stroke(), subject="photo", **given)
    monkeypatch.setattr(prepare, "guess_subject", lambda target: Guess("drawing", "it was drawn"))
    found = warpsplat.vectorize(soft_stroke(), **given)
    assert found.subject == "photo"
    assert found.svg == asked.svg and found.score == asked.score


@pytest.mark.parametrize(
    "given", [{"colors": 2}, {"max_bytes": 400}, {"detail": 0.0}, {"subject": "drawing"}]
)
def test_requested_subjects_and_options_of_drawings_are_kept(
    given: dict[str, Any], monkeypatch: pytest.MonkeyPatch
) -> None:
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
