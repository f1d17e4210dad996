"""Smooth quadratics in the fewest characters."""

from __future__ import annotations

import itertools

import numpy as np
import pytest

from warpsplat.svg.commands import Pair, minus, row, shortest_smooth
from warpsplat.svg.paths import cubics


def outline(seed: int, count: int) -> tuple[list[Pair], Pair]:
    """Joints and the first control point, some of them outside of the canvas."""
    points = np.random.default_rng(seed).integers(-20, 110, (count + 1, 2)).tolist()
    first, *joints = [(x, y) for x, y in points]
    return joints, first


def every_text(joints: list[Pair], control: Pair) -> list[str]:
    """The outline in each choice of relative and absolute commands."""
    texts = []
    for relative in itertools.product((True, False), repeat=len(joints) - 1):
        text, last = f"M{row(joints[0], False)}", ""
        for i, is_relative in enumerate(relative):
            before, end = joints[i : i + 2]
            letter = ("Q" if i == 0 else "T").lower() if is_relative else ("Q" if i == 0 else "T")
            points = [control, end] if i == 0 else [end]
            numbers = [x for point in points for x in (minus(point, before) if is_relative else point)]
            text += row(numbers, True) if letter == last else letter + row(numbers, False)
            last = letter
        texts.append(text)
    return texts


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("count", [2, 6])
def test_no_choice_of_commands_is_shorter(seed: int, count: int) -> None:
    joints, control = outline(seed, count)
    texts = every_text(joints, control)
    data = shortest_smooth(joints, control)
    assert data in texts
    assert len(data) == min(map(len, texts))
    plain = texts[0]
    shown, wanted = (cubics(text, keep_dots=True)[0].points for text in (data, plain))
    np.testing.assert_allclose(shown, wanted, atol=1e-9)


def test_absolute_commands_are_used() -> None:
    """Somewhere, or the test above says little."""
    assert any("T" in shortest_smooth(*outline(seed, 6)) for seed in range(6))
