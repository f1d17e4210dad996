"""Each wrong use of the library is refused in one line that says what is wrong."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
import pytest
import torch

import warpsplat
from tests.scenes import mixed_scene, random_scene
from warpsplat.errors import ResourceError, UsageError
from warpsplat.scene import Canvas, Kind
from warpsplat.torch import Module, SceneTensors, render

pytestmark = pytest.mark.usefixtures("single_precision")

SCENE, SPLINES = random_scene(Kind.FILL), mixed_scene(seed=1)
LARGE = random_scene(Kind.FILL, width=500, height=450)
PIXELS = np.zeros((36, 40, 3))


# The default type of torch is that of the references while tests are collected.
zeros, ones, full = (partial(make, dtype=torch.float32) for make in (torch.zeros, torch.ones, torch.full))


def drawn(**options: Any) -> Callable[[], object]:
    return lambda: render(SceneTensors(SPLINES, {}), **options)


def valued(**values: Any) -> Callable[[], object]:
    return lambda: render(SceneTensors(SCENE, values))


WRONG: list[tuple[type[Exception], str, Callable[[], Any]]] = [
    # Values
    (ValueError, "no attribute 'colour'; there are points, ", valued(colour=zeros(4))),
    (ValueError, r"colors has shape \(3,\), not \(4, 3\)", valued(colors=zeros(3))),
    (TypeError, "colors is torch.float16, not torch.float32", valued(colors=zeros(4, 3).half())),
    (TypeError, "colors is a ndarray, not a torch.Tensor", valued(colors=np.zeros((4, 3), np.float32))),
    (ValueError, "^colors: numbers that are not finite", valued(colors=full((4, 3), torch.nan))),
    (ValueError, "focus has no gradient here", valued(focus=zeros(4, 3, requires_grad=True))),
    (ValueError, "colors is on meta", valued(opacities=ones(4), colors=zeros(4, 3, device="meta"))),
    (UsageError, "tensors are on meta, neither on the CPU", valued(opacities=ones(4, device="meta"))),
    # Sizes
    (UsageError, "width must be a whole number from 1 to .*, not 0", drawn(width=0)),
    (UsageError, "40x72 px do not have the proportions of 40x36", drawn(width=40, height=72)),
    (UsageError, "scenes of several sizes or devices", lambda: render([SCENE, LARGE])),
    (ResourceError, "300000x270000 px would take about 3888.0 GB", lambda: render(LARGE, 300_000)),
    (ResourceError, "300000x270000 px would take about 3888.0 GB", lambda: warpsplat.render(LARGE, 300_000)),
    (ValueError, "a canvas of 0x64 px has no pixel", lambda: Canvas(0, 64, None)),
    # Options
    (UsageError, "renderer must be one of exact.*, not 'fast'", drawn(renderer="fast")),
    (UsageError, "threads must be a whole number from 1, not -1", drawn(threads=-1)),
    # Things that are no scenes
    (UsageError, "no scene to render", lambda: render([])),
    (TypeError, r"as in module\(\); render takes its tensors\(\)", lambda: render(Module(SPLINES))),
    (TypeError, "takes SceneTensors or a Scene, or a list of them, not str", lambda: render("<svg")),
    (TypeError, "or a list of them, not int", lambda: render([SPLINES, 3])),  # type: ignore[list-item]
    (TypeError, "not str: warpsplat.load_svg reads one", lambda: SceneTensors.of("<svg/>")),
    (TypeError, "the layout is a str, not a Scene", lambda: SceneTensors("<svg/>", {})),
    (TypeError, r"not SceneTensors: give its scene\(\)", lambda: warpsplat.save_svg(SceneTensors(SCENE, {}))),
    (TypeError, "a Scene is needed, not Result", lambda: warpsplat.save_svg(warpsplat.vectorize(PIXELS))),
    (TypeError, "is its text, a path, bytes or a file, not NoneType", lambda: warpsplat.render(None)),
    (TypeError, "an image is a path, .*, not Tensor", lambda: warpsplat.vectorize(zeros(36, 40, 3))),
]
"""Error, pattern of its message, use."""


@pytest.mark.parametrize(("kind", "message", "use"), WRONG, ids=[message for _, message, _ in WRONG])
def test_one_line_says_what_is_wrong(kind: type[Exception], message: str, use: Callable[[], Any]) -> None:
    with pytest.raises(kind, match=message) as raised:
        use()
    assert "\n" not in str(raised.value)
    assert len(str(raised.value)) < 200
