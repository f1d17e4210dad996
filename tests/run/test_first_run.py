"""A first run: all kernels are announced before one is needed, so that they are compiled together."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.runs import vectorize
from warpsplat.drawing import kernels
from warpsplat.fit.settings import make_settings
from warpsplat.rendering import kernel_cache, program, renderer
from warpsplat.rendering.backend import Backend
from warpsplat.scene import FloatArray, Kind


@pytest.fixture
def modules(monkeypatch: pytest.MonkeyPatch) -> tuple[list[str], list[str]]:
    """The modules that a run announces before it compiles the first, and those that it loads."""
    announced, loaded = list[str](), list[str]()
    is_open = [True]

    def noted(function: Callable[..., None], names: list[str], *, closes: bool) -> Callable[..., None]:
        def call(*arguments: Any) -> None:
            if closes:
                is_open[0] = False
            if is_open[0] or names is loaded:
                names.extend(kernel.module.name for kernel in arguments[:1])
            function(*arguments)

        return call

    for place in (program, renderer, kernels):
        monkeypatch.setattr(place, "expect", noted(kernel_cache.expect, announced, closes=False))
    monkeypatch.setattr(program, "load", noted(kernel_cache.load, loaded, closes=True))
    monkeypatch.setattr(kernels, "compile_expected", noted(kernel_cache.compile_expected, [], closes=True))
    return announced, loaded


def flag() -> FloatArray:
    image = np.ones((64, 64, 3), np.float32)
    image[10:40, 10:40] = (1, 0, 0)
    image[30:55, 30:50] = (0, 0, 1)
    return image


@pytest.mark.parametrize("given", [{"kind": Kind.FILL}, {"kind": Kind.STROKE}, {"subject": "drawing"}])
def test_a_run_announces_all_its_kernels(given: dict[str, Any], modules: tuple[list[str], list[str]]) -> None:
    """Those of a drawing before it is traced."""
    fit = {} if "subject" in given else {"curves": 6, "iterations": 60, "density": {"interval": 20}}
    vectorize(flag(), make_settings(**fit, **given), Backend.on("cpu", 2))
    announced, loaded = modules
    assert set(loaded) == set(announced)
