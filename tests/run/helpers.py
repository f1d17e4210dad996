"""Short fits to a small photograph, and pictures of them."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from typing import Any

import numpy as np

import warpsplat
from tests.fit.pictures import picture
from tests.scenes import random_scene
from warpsplat.scene import FloatArray, Kind, Scene
from warpsplat.svg.write import write_svg

PICTURE = picture(48, 36)
CLEAR = np.concatenate([PICTURE, np.ones_like(PICTURE[..., :1])], axis=2)
CLEAR[:12, :20] = 0

Make = Callable[..., warpsplat.Result]
Both = tuple[Any, Any]
"""A loss and its gradient."""


def slopes(image: FloatArray, target: FloatArray) -> Both:
    """Mean square of the differences of neighbours in a row, which even colours do not change."""
    across = np.diff(image - target, axis=1)
    gradient = np.zeros_like(image)
    gradient[:, 1:] += 2 * across / across.size
    gradient[:, :-1] -= 2 * across / across.size
    return np.square(across).mean(), gradient


def fitted(loss: Any = None, **given: Any) -> warpsplat.Result:
    common = {"image": PICTURE, "curves": 10, "iterations": 56, "seed": 1, "loss": loss}
    # A loss function asks for a photograph itself.
    common |= {} if loss else {"subject": "photo"}
    return warpsplat.vectorize(**{**common, "device": "cpu", "threads": 1, **given})


def refined(scene: Scene | None = None, **given: Any) -> warpsplat.Result:
    text = write_svg(scene or random_scene(Kind.FILL, 6, 48, 36, seed=3))
    usual = {"image": PICTURE, "iterations": 56, "device": "cpu", "threads": 1}
    return warpsplat.refine(text, **{**usual, **given})


def after(count: int) -> Callable[[], bool]:
    """Return a ``stop`` that is true after ``count`` steps."""
    steps = itertools.count(1)
    return lambda: next(steps) >= count
