"""The normal distribution by which rows are placed, and counts that 32 bits do not hold."""

from __future__ import annotations

import hashlib
import math

import numpy as np
import warp as wp

from tests.kernels.test_elementary import run
from warpsplat.kernels import constants
from warpsplat.paper.constants import COUNT_MAX
from warpsplat.paper.kernels.strips import bounded_product, normal_quantile, normal_tail

wp.set_module_options(constants.MODULE_OPTIONS)  # others would need their own precompiled headers

TAILS = (np.linspace(3e-4, 0.7, 500) ** 2).astype(np.float32)
DEVIATIONS = np.linspace(0, 5.4, 1000).astype(np.float32)


@wp.kernel
def normal_tails(x: wp.array[wp.float32], out: wp.array[wp.float32]):  # type: ignore[no-untyped-def]
    i = wp.tid()
    out[i] = normal_tail(x[i])  # type: ignore[index]


@wp.kernel
def normal_quantiles(x: wp.array[wp.float32], out: wp.array[wp.float32]):  # type: ignore[no-untyped-def]
    i = wp.tid()
    out[i] = normal_quantile(x[i])  # type: ignore[index]


def digest(values: np.ndarray) -> str:
    return hashlib.sha256(values.astype("<f4").tobytes()).hexdigest()[:16]


def test_the_normal_distribution() -> None:
    made = run(normal_tails, DEVIATIONS, "cpu")
    exact = np.array([0.5 * math.erfc(z / math.sqrt(2)) for z in DEVIATIONS.astype(np.float64)])
    assert np.abs(made - exact).max() < 2e-7
    assert np.abs(made / exact - 1).max() < 4e-6
    assert (np.diff(made) <= 1e-7).all()
    assert digest(made) == "37eedcb99077d630"


def test_quantiles_are_the_inverse() -> None:
    quantiles = run(normal_quantiles, TAILS, "cpu")
    back = run(normal_tails, quantiles.astype(np.float32), "cpu")
    assert np.abs(back / TAILS - 1).max() < 1e-5
    assert digest(quantiles) == "88120ddf5e997572"


def test_counts_do_not_wrap() -> None:
    pairs = [(3, 4), (2**20, 2**20), (2**31 - 1, 2**31 - 1), (-(2**31), 5), (0, 9)]
    assert [bounded_product(a, b) for a, b in pairs] == [12, COUNT_MAX, COUNT_MAX, 0, 0]
