"""Elementary functions: near the C library's, exact where they should be, and pinned to the bit."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable

import numpy as np
import pytest

from warpsplat.portable import elementary

RANDOM = np.random.default_rng(0)
WIDE = RANDOM.uniform(-700, 700, 500)
SMALL = RANDOM.uniform(-1, 1, 500)
POSITIVE = np.ldexp(RANDOM.uniform(0.5, 1, 500), RANDOM.integers(-1000, 1000, 500))
PLANE = RANDOM.uniform(-3, 3, (2, 500))
ANGLES = RANDOM.uniform(-1e5, 1e5, 500)

CASES: dict[str, tuple[Callable[..., np.ndarray], Callable[..., float], tuple[np.ndarray, ...], str]] = {
    "exp": (elementary.exp, math.exp, (np.concatenate([WIDE, SMALL]),), "4d5a138d66b28ffb"),
    "log": (elementary.log, math.log, (np.concatenate([POSITIVE, 1 + 0.5 * SMALL]),), "cd24c5d60909935b"),
    "log2": (elementary.log2, math.log2, (POSITIVE,), "0bfa36b96f89b981"),
    "log10": (elementary.log10, math.log10, (POSITIVE,), "ec6dcc50dd073fca"),
    "sin": (elementary.sin, math.sin, (np.concatenate([ANGLES, SMALL]),), "1117ffff73371aac"),
    "cos": (elementary.cos, math.cos, (np.concatenate([ANGLES, SMALL]),), "4fd4107557244f81"),
    "tan": (elementary.tan, math.tan, (np.concatenate([ANGLES, SMALL]),), "fdf54e7590e884e4"),
    "arctan2": (elementary.arctan2, math.atan2, (PLANE[0], PLANE[1]), "535c6b245a6026b5"),
    "power": (elementary.power, math.pow, (np.abs(WIDE), 3 * SMALL), "c6d1c3e509503e95"),
    "hypot": (elementary.hypot, math.hypot, (WIDE, SMALL[RANDOM.permutation(500)]), "4bb15269da3c08bf"),
}
"""Ours, the C library's, arguments, and the digest of our results."""


@pytest.mark.parametrize("name", CASES)
def test_near_the_c_library_and_the_same_bits_as_ever(name: str) -> None:
    ours, theirs, arguments, digest = CASES[name]
    made, expected = ours(*arguments), np.array([theirs(*each) for each in zip(*arguments, strict=True)])
    units = 64 if name == "power" else 16
    assert np.all(np.abs(made - expected) <= units * np.spacing(np.abs(expected)))
    assert hashlib.sha256(np.asarray(made, "<f8").tobytes()).hexdigest()[:16] == digest


def test_values_that_are_exact() -> None:
    assert elementary.exp(0.0) == 1
    assert [elementary.power_of_ten(k) for k in (-5, -1, 0, 3, 22)] == [1e-5, 0.1, 1, 1000, 1e22]
    assert elementary.cos(0.0) == 1
    assert elementary.sin(0.0) == 0
    assert elementary.log(1.0) == 0
    assert elementary.log2(np.ldexp(1.0, np.arange(-1000, 1000))).tolist() == list(range(-1000, 1000))
    assert elementary.power([0, 0, 7, 7], [0, 2, 0, 1]).tolist() == [1, 0, 1, 7]


def test_limits() -> None:
    assert elementary.exp([-1e9, 1e9, -np.inf, np.inf]).tolist() == [0, np.inf, 0, np.inf]
    assert elementary.log([0, np.inf]).tolist() == [-np.inf, np.inf]
    assert np.isnan([elementary.exp(np.nan), elementary.log(-1.0), elementary.log(np.nan)]).all()
    corners = elementary.arctan2([0.0, 0.0, 1, -1, -0.0], [1, -1, 0, 0, -1])
    assert corners.tolist() == [0, math.pi, math.pi / 2, -math.pi / 2, -math.pi]
