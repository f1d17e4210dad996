"""Drawings from few big shapes to every speck."""

from __future__ import annotations

import numpy as np

from warpsplat.drawing.constraints import Drawing
from warpsplat.drawing.draft import byte_price
from warpsplat.drawing.tidy import finish_drawing
from warpsplat.drawing.trace.trace import trace
from warpsplat.fit.problem import Run
from warpsplat.fit.settings import make_settings
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray

SPECKS = [(x, y) for y in (8, 40, 72) for x in (10, 34, 58, 82)]
"""Places of dust, each of 2 x 2 pixels."""


def dusty() -> FloatArray:
    """Two big shapes on white, with dust."""
    image = np.ones((96, 96, 3), np.float32)
    image[16:36, 12:84] = 0.8, 0.2, 0.1
    image[48:68, 12:84] = 0.1, 0.3, 0.7
    for x, y in SPECKS:
        image[y : y + 2, x : x + 2] -= 0.25
    return image.clip(0, 1)


def regions(detail: float) -> int:
    """How many outlines a trace of the drawing has."""
    return len(trace(dusty(), price=byte_price(make_settings(detail=detail))).scene.starts) - 1


def test_dust_goes_first_and_nothing_else() -> None:
    counts = [regions(detail) for detail in (0.0, 0.25, 0.5, 0.75, 1.0)]
    assert counts == sorted(counts)
    assert counts[0] == 2
    assert counts[-1] >= 2 + len(SPECKS)


def test_a_run_that_is_over_delivers_the_trace(device: str) -> None:
    traced = trace(dusty())
    run = Run(Backend.on(device), stop=lambda: True)
    finished = finish_drawing(dusty(), Drawing(traced.scene, traced.joints), run)
    assert finished.drawing.scene is traced.scene
