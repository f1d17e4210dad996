"""Uneven light on paper is found and undone; what only looks like it stays."""

from __future__ import annotations

import cv2
import numpy as np
import pytest

import warpsplat
from tests.drawing.trace.drawings import draw
from warpsplat.drawing.illumination import evened, find_illumination, relative
from warpsplat.fit.optics import Optics, parse_optics
from warpsplat.run.options import settings_from
from warpsplat.scene import FloatArray

SIDE = 96
BODY = (
    '<rect width="96" height="96" fill="#f4f1de"/><path d="M22 70L44 24L72 68z" fill="#b0344d"/>'
    '<circle cx="58" cy="36" r="12" fill="#3d5a80"/><path d="M20 78H76" stroke="#222" stroke-width="4"/>'
)

Y, X = np.mgrid[:SIDE, :SIDE] / SIDE - 0.5
LAMP = 0.9 - 0.2 * X - 0.15 * Y * Y
"""Light from the left, which falls off to both ends of the paper."""


def page(light: np.ndarray | float = LAMP, texture: float = 3.0, body: str = BODY) -> FloatArray:
    """A drawing on paper with a texture, in some light, as a camera sees it."""
    image = draw(body, SIDE, SIDE) * 255 * np.atleast_3d(np.asarray(light))
    grain = cv2.GaussianBlur(np.random.default_rng(3).normal(0, 1, (SIDE, SIDE)), (0, 0), 0.8)
    image = image + (texture * grain / grain.std())[..., None]
    return np.asarray(np.round(image).clip(0, 255) / 255, np.float32)


def test_light_on_paper_is_found_and_undone() -> None:
    image = page()
    found = find_illumination(image)
    assert found
    light = relative(found, image)
    np.testing.assert_allclose(light, np.atleast_3d(LAMP / LAMP.max()).repeat(3, axis=2), atol=0.01)
    np.testing.assert_allclose(evened(image, found), page(LAMP.max()), atol=0.04)


@pytest.mark.parametrize(
    "image",
    [
        page(1.0),
        page(texture=0),
        page(0.4 * LAMP),
        page(texture=14.0),
        page(body='<rect width="96" height="96" fill="#3d5a80"/><path d="M22 70L44 24L72 68z" fill="#fff"/>'),
        np.dstack([page(), np.ones((SIDE, SIDE, 1), np.float32)]),
    ],
    ids=["even", "a gradient that was drawn", "dark", "noise", "a dark ground", "opacity"],
)
def test_what_is_no_light_on_paper_stays(image: FloatArray) -> None:
    assert find_illumination(image) is None


def test_a_page_in_uneven_light_is_drawn_as_in_even_light() -> None:
    uneven = warpsplat.vectorize(page(), subject="drawing", quality="draft")
    even = warpsplat.vectorize(page(LAMP.max()), subject="drawing", quality="draft")
    as_it_is = warpsplat.vectorize(page(), subject="drawing", quality="draft", optics="none")
    assert len(uneven.scene) == len(even.scene) < len(as_it_is.scene)
    assert uneven.optics
    assert uneven.score
    assert uneven.optics.illumination
    assert uneven.optics.psnr > uneven.score.psnr + 5
    assert any("unevenly lit" in note for note in uneven.notes)
    assert even.optics is None or even.optics.illumination is None
    # As another page from the same desk.
    again = warpsplat.vectorize(page(), subject="drawing", quality="draft", optics=uneven.optics.as_dict())
    assert again.optics
    assert again.optics.illumination == uneven.optics.illumination


def test_a_gradient_with_grain_stays() -> None:
    """Light would change the shapes on it, too."""
    ground = page(0.9 - 0.2 * X)
    flat = draw(BODY, SIDE, SIDE)
    is_ground = (flat == flat[0, 0]).all(axis=2, keepdims=True)
    image = np.where(is_ground, ground, np.round(flat * 255) / np.float32(255))
    assert find_illumination(image)
    made = warpsplat.vectorize(image, subject="drawing", quality="draft")
    assert made.optics is None or made.optics.illumination is None


def test_illumination_of_images_with_opacity_is_not_undone() -> None:
    image = np.dstack([page(), np.ones((SIDE, SIDE, 1), np.float32)])
    image[:8, :8] = 0
    optics = {"illumination": [[1.0, 0.1, 0.0, 0.0, 0.0, 0.0]] * 3}
    made = warpsplat.vectorize(image, subject="drawing", quality="draft", optics=optics)
    assert made.optics is None or made.optics.illumination is None


def test_illumination_of_a_report() -> None:
    rows = [[1.0, 0.1, 0.0, 0.0, 0.0, -0.2]] * 3
    text = parse_optics({"illumination": rows})
    assert Optics.of(text) == Optics("sRGB", None, tuple(map(tuple, rows)))
    assert settings_from({"optics": {"illumination": rows}}).optics == text
    with pytest.raises(warpsplat.UsageError, match="illumination of optics must be 3 rows of 6 numbers"):
        settings_from({"optics": {"illumination": rows[:2]}})
