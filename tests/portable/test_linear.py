"""Products, decompositions, interpolation: near NumPy's, and pinned to the bit."""

from __future__ import annotations

import hashlib

import numpy as np
import pytest

from warpsplat.portable import linear
from warpsplat.portable.sequences import convolve, interp

RANDOM = np.random.default_rng(1)
STACK = RANDOM.uniform(-3, 3, size=(5, 4, 4))
TALL = RANDOM.uniform(-3, 3, size=(6, 7, 3))


def test_products() -> None:
    stacks = ((5, 3, 4), (4, 2)), ((5, 1, 3, 4), (2, 4, 2)), ((2, 99), (99, 2))
    for shapes in (((4,), (4,)), ((3, 4), (4,)), ((4,), (4, 3)), *stacks):
        a, b = (RANDOM.uniform(-3, 3, size=shape) for shape in shapes)
        product = linear.product(a, b)
        assert np.shape(product) == np.shape(a @ b)
        assert np.allclose(product, a @ b, rtol=1e-12, atol=1e-12)
    with pytest.raises(ValueError, match="have no product"):
        linear.product(np.ones((2, 3)), np.ones((2, 3)))


def test_systems() -> None:
    right = RANDOM.uniform(-3, 3, size=(5, 4, 2))
    assert np.allclose(linear.solve(STACK, right), np.linalg.solve(STACK, right), rtol=1e-10)
    assert np.allclose(linear.solve(STACK[0], right[0, :, 0]), np.linalg.solve(STACK[0], right[0, :, 0]))
    assert np.allclose(linear.determinant(STACK), np.linalg.det(STACK))


def test_a_singular_system_is_an_error() -> None:
    with pytest.raises(np.linalg.LinAlgError):
        linear.solve(np.zeros((2, 2)), np.ones(2))
    with pytest.raises(np.linalg.LinAlgError):
        linear.cholesky(-np.eye(2))


@pytest.mark.parametrize(
    "matrix",
    [
        TALL,
        TALL.swapaxes(1, 2),
        TALL[0],
        np.outer([1, 2, 3.0], [1, 2.0]),
        np.zeros((3, 2)),
        np.full((2, 2), 3.0),
        np.array([[1, 1e-160], [1, 1e-170]]),
    ],
    ids=["tall", "wide", "one", "of rank 1", "zero", "equal", "of all sizes"],
)
def test_singular_values(matrix: np.ndarray) -> None:
    left, values, right = linear.svd(matrix)
    assert np.allclose(linear.product(left * values[..., None, :], right), matrix)
    assert np.allclose(values, np.linalg.svd(matrix, compute_uv=False))


def test_symmetric_matrices() -> None:
    positive = STACK @ STACK.swapaxes(1, 2)
    assert np.allclose(linear.cholesky(positive), np.linalg.cholesky(positive))
    special = [np.diag([3.0, 1]), np.diag([1.0, 3]), np.eye(2), np.zeros((2, 2))]
    pairs = np.concatenate([positive[:, :2, :2], special])
    values, vectors = linear.eigh(pairs)
    assert np.allclose(values, np.linalg.eigh(pairs)[0])
    assert np.allclose(pairs @ vectors, vectors * values[:, None, :])
    assert np.allclose(vectors.swapaxes(1, 2) @ vectors, np.eye(2))


def test_the_direction_of_points() -> None:
    along = np.array([0.6, -0.8])
    points = 5 + np.linspace(-3, 9, 20)[:, None] * along + 1e-3 * RANDOM.uniform(-3, 3, size=(20, 2))
    assert abs(abs(linear.principal_direction(points) @ along) - 1) < 1e-6


def test_interpolation() -> None:
    places, values = np.sort(RANDOM.uniform(0, 10, 20)), RANDOM.uniform(-3, 3, size=20)
    x = np.concatenate([RANDOM.uniform(-1, 11, 100), places])
    assert np.allclose(interp(x, places, values), np.interp(x, places, values))
    assert np.array_equal(interp(places, places, values), values)
    assert interp([1, 2], [1, 1, 2, 2], [0, 5, 6, 7]).tolist() == [5, 7]
    assert interp(0.25, [0, 1], [2, 4]) == 2.5
    assert interp([0.0, 9.0], [3], [7]).tolist() == [7, 7]


def test_convolution() -> None:
    signal, kernel = RANDOM.uniform(-3, 3, size=50), RANDOM.uniform(-3, 3, size=7)
    assert np.allclose(convolve(signal, kernel), np.convolve(signal, kernel, "valid"))


def test_pinned_bits() -> None:
    made = [
        linear.product(STACK, STACK),
        linear.product(TALL.reshape(-1, 126), TALL.reshape(126, -1)),
        linear.solve(STACK, STACK[::-1]),
        linear.determinant(STACK),
        linear.principal_direction(TALL[0, :, :2]),
        *linear.svd(TALL),
        *linear.eigh(STACK[:, :2, :2] + STACK[:, :2, :2].swapaxes(1, 2)),
        interp(STACK, np.arange(-4, 5), STACK.ravel()[:9]),
        convolve(STACK.ravel(), TALL[0, 0]),
    ]
    digest = hashlib.sha256(b"".join(np.asarray(each, "<f8").tobytes() for each in made)).hexdigest()
    assert digest[:16] == "c4885c1ac6768cae"
