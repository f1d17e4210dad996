"""Ink and paper told apart."""

from __future__ import annotations

import numpy as np
import pytest

from tests.drawing.trace.line_art import CROSS, drawn
from warpsplat.drawing.strokes.ink import find_ink


def test_cover_is_the_inked_share_of_each_pixel() -> None:
    image = drawn(CROSS)
    ink = find_ink(image)
    assert ink.paper == pytest.approx(1)
    assert np.abs(ink.cover - (1 - image[..., 0])).max() < 0.1
    assert (ink.mask == (image[..., 0] < 0.5)).mean() > 0.99


def test_unevenly_lit_noisy_paper_is_paper() -> None:
    rng = np.random.default_rng(0)
    clean = drawn(CROSS)
    light = np.linspace(0.55, 0.9, clean.shape[1])[None, :, None]
    image = np.clip(clean * light + rng.normal(0, 0.02, clean.shape), 0, 1).astype(np.float32)
    wrong = find_ink(image).mask != (clean[..., 0] < 0.5)
    assert wrong.mean() < 0.02


def test_light_ink_on_dark_paper() -> None:
    clean = drawn(CROSS)
    ink = find_ink(1 - clean)
    assert (ink.mask == (clean[..., 0] < 0.5)).mean() > 0.99
    assert ink.paper == pytest.approx(0)


def test_clear_paper_has_no_colour() -> None:
    cover = 1 - drawn(CROSS)[..., :1]
    image = np.concatenate([0 * cover, 0 * cover, 0 * cover, cover], axis=2)
    ink = find_ink(image)
    assert ink.paper is None
    assert (ink.mask == (cover[..., 0] > 0.5)).mean() > 0.99


def test_what_is_coloured_in_is_paper_too() -> None:
    rng = np.random.default_rng(0)
    image = drawn('<path d="M0 0H60V72H0Z" fill="#6bf" stroke="none"/>' + CROSS)
    crayon = (image[..., 2] > 0.9) & (image[..., 0] < 0.6)
    image[crayon] += rng.uniform(-0.3, 0.2, (int(crayon.sum()), 1)).astype(np.float32) * (1, 0.5, 0)
    ink = find_ink(np.clip(image, 0, 1).astype(np.float32))
    black = drawn(CROSS)[..., 0] < 0.5
    assert ink.mask[black].mean() > 0.9
    assert ink.mask[~black].mean() < 0.05
