"""Images of a few pixels: each becomes a file, or is refused in one line."""

from __future__ import annotations

import contextlib
import itertools

import numpy as np
import pytest

import warpsplat
from warpsplat.errors import ImageError
from warpsplat.fit.settings import Subject

SIZES = [(2, 2), (2, 3), (3, 2), (3, 3), (7, 2), (2, 12), (4, 5)]

IMAGES = {
    (shape, content): pixels
    for height, width in SIZES
    for shape in ((height, width), (height, width, 3), (height, width, 4))
    for content, pixels in (
        ("noise", np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)),
        ("flat", np.full(shape, 77, np.uint8)),
    )
}


@pytest.mark.parametrize(
    ("subject", "content"), [*itertools.product(("auto", "drawing", "pixel"), ("noise", "flat"))]
)
def test_there_is_a_file(subject: Subject, content: str) -> None:
    for (shape, shown), image in IMAGES.items():
        if shown == content:
            made = warpsplat.vectorize(image, subject=subject, quality="draft")
            assert made.svg.startswith("<svg") and made.score, shape


def test_line_art_may_have_no_lines() -> None:
    for image in IMAGES.values():
        with contextlib.suppress(ImageError):
            assert warpsplat.vectorize(image, subject="line", quality="draft").score
