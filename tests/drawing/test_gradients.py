"""``paint`` of drawings: which gradients they may have."""

from __future__ import annotations

import numpy as np
import pytest

import warpsplat
from tests.drawing.trace.drawings import draw, ground
from warpsplat.fit.settings import Painting

SHADED = (
    '<linearGradient id="a"><stop stop-color="#f40"/><stop offset="1" stop-color="#fd0"/></linearGradient>'
    '<radialGradient id="b"><stop stop-color="#fff"/><stop offset="1" stop-color="#06c"/></radialGradient>'
)
IMAGE = np.round(
    255
    * draw(
        f'{ground("#fff")}{SHADED}<rect x="6" y="6" width="84" height="36" fill="url(#a)"/>'
        '<circle cx="48" cy="68" r="22" fill="url(#b)"/>'
    )[..., :3]
).astype(np.uint8)


def made(paint: Painting | None) -> warpsplat.Result:
    return warpsplat.vectorize(IMAGE, quality="draft", subject="drawing", paint=paint)


@pytest.mark.parametrize(
    ("paint", "kinds"),
    [("flat", ()), ("linear", ("linear",)), ("radial", ("radial",)), ("auto", ("linear", "radial"))],
)
def test_only_the_gradients_that_are_allowed(paint: Painting, kinds: tuple[str, ...]) -> None:
    result = made(paint)
    assert not [note for note in result.notes if "paint" in note]
    assert [kind for kind in ("linear", "radial") if f"<{kind}Gradient" in result.svg] == [*kinds]


def test_shading_without_gradients_is_bands_and_gradients_are_usual() -> None:
    flat, usual = made("flat"), made("auto")
    assert len(flat.scene) > len(usual.scene)
    assert flat.score and flat.score.psnr > 25
    assert made(None).svg == usual.svg
