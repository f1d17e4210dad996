"""Elementary functions of kernels: near the truth, and the same bits everywhere."""

from __future__ import annotations

import ast
import hashlib
import math
from collections.abc import Callable

import numpy as np
import pytest
import warp as wp

from tests.kernels import trials
from tests.kernels.modules import kernel_folders
from warpsplat.kernels import pixels

ANGLES = np.linspace(-20, 20, 4001).astype(np.float32)
AGES = np.arange(0, 3000, 7, dtype=np.int32)

LIBRARY_CALLS = {
    *("acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh"),
    *("cos", "cosh", "sin", "sinh", "tan", "tanh", "exp", "exp2", "pow", "cbrt"),
    *("erf", "erfc", "erfcinv", "erfinv", "log", "log10", "log1p", "log2", "randn"),
}
"""Functions of Warp that are the C library's on a CPU."""


def run(kernel: wp.Kernel, values: np.ndarray, device: str, dtype: type = wp.float32) -> np.ndarray:
    """Results of a kernel that maps ``values``, in float64."""
    out = wp.zeros(len(values), dtype, device=device)
    wp.launch(kernel, len(values), [wp.array(values, device=device)], [out], device=device)
    return np.asarray(out.numpy(), np.float64)


def test_sine_and_cosine(device: str) -> None:
    made = run(trials.sines_and_cosines, ANGLES, device, wp.vec2)
    exact = np.stack([np.sin(ANGLES.astype(np.float64)), np.cos(ANGLES.astype(np.float64))], axis=1)
    assert np.abs(made - exact).max() < 4e-7


def test_angles(device: str) -> None:
    turned = np.linspace(-math.pi, math.pi, 4001)[1:-1].astype(np.float32)
    made = run(trials.angles_of_directions, turned, device)
    assert np.abs(made - turned).max() < 1e-6


def test_the_angle_of_axes(device: str) -> None:
    x = np.array([1, 0, -1, 0, 0], np.float32)
    y = np.array([0, 1, 0, -1, 0], np.float32)
    out = wp.zeros(5, wp.float32, device=device)
    wp.launch(
        trials.angles, 5, [wp.array(x, device=device), wp.array(y, device=device)], [out], device=device
    )
    assert out.numpy().tolist() == np.float32([0, math.pi / 2, math.pi, -math.pi / 2, 0]).tolist()


def test_whole_powers(device: str) -> None:
    made = run(trials.powers, AGES, device)
    exact = float(np.float32(0.999)) ** AGES
    assert np.abs(made / exact - 1).max() < 1e-7


PINNED: dict[str, tuple[Callable[[], np.ndarray], str]] = {
    "sines_and_cosines": (lambda: run(trials.sines_and_cosines, ANGLES, "cpu", wp.vec2), "756791f9eb1f0e79"),
    "angles": (lambda: run(trials.angles_of_directions, ANGLES[2000:2600], "cpu"), "6fad64080bf0ba65"),
    "powers": (lambda: run(trials.powers, AGES, "cpu"), "ba8a9a6b03682436"),
}


@pytest.mark.parametrize("name", PINNED)
def test_the_same_bits_as_ever(name: str) -> None:
    make, expected = PINNED[name]
    assert hashlib.sha256(make().astype("<f4").tobytes()).hexdigest()[:16] == expected


def library_calls(source: str) -> list[str]:
    """Functions of Warp in ``source`` that a CPU takes from the C library."""
    nodes = ast.walk(ast.parse(source))
    return [
        node.attr
        for node in nodes
        if isinstance(node, ast.Attribute)
        and isinstance(node.value, ast.Name)
        and node.value.id == "wp"
        and node.attr in LIBRARY_CALLS
    ]


def test_no_kernel_calls_the_c_library() -> None:
    assert library_calls("a = wp.sin(x)\nb = wp.sqrt(x)\n") == ["sin"]
    files = [path for folder in kernel_folders() for path in folder.rglob("*.py")]
    assert len(files) > 20
    found = {path: library_calls(path.read_text(encoding="utf-8")) for path in files}
    assert not {path: calls for path, calls in found.items() if calls}


def test_modules_are_installed_under_the_package() -> None:
    assert pixels.tiles_to_pixels.module.name == "warpsplat.kernels.pixels"
