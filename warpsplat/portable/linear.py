"""Products and decompositions of small matrices or stacks of them.

Sums run over the inner index in ascending order. Matrices are the last two axes, as in ``np.linalg``.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

Matrices = Any
"""An array of numbers, or nested sequences."""

Result = npt.NDArray[Any]


def product(a: Matrices, b: Matrices) -> Result:
    """Return the matrix product ``a @ b``, with the shapes and types that ``@`` takes and gives."""
    a, b = np.asarray(a), np.asarray(b)
    rows = a[None, :] if a.ndim == 1 else a
    columns = b[:, None] if b.ndim == 1 else b
    inner = rows.shape[-1]
    if inner != columns.shape[-2]:
        raise ValueError(f"shapes {a.shape} and {b.shape} have no product")
    looped = 64  # longest inner index that is summed term by term, rather than by NumPy
    if inner > looped:
        total = (rows[..., :, :, None] * columns[..., None, :, :]).sum(axis=-2)
    else:
        shape = (*np.broadcast_shapes(rows.shape[:-2], columns.shape[:-2]), rows.shape[-2], columns.shape[-1])
        total = np.zeros(shape, np.result_type(rows, columns))
        for k in range(inner):
            total += rows[..., :, k, None] * columns[..., None, k, :]
    if a.ndim == 1:
        total = total[..., 0, :]
    if b.ndim == 1:
        total = total[..., 0]
    return total[()]


def _eliminated(matrix: Matrices, right: Result) -> tuple[Result, Result, Result]:
    """Eliminate the lower triangle of ``matrix`` (..., n, n), in ``right`` (..., n, k) as well.

    By Gaussian elimination with partial pivoting. Return both, and the sign of the row permutation.
    """
    upper = np.array(matrix, np.float64)
    right = np.array(np.broadcast_to(right, upper.shape[:-1] + right.shape[-1:]), np.float64)
    sign = np.ones(upper.shape[:-2])
    for k in range(upper.shape[-1] - 1):
        pivot = k + np.abs(upper[..., k:, k]).argmax(axis=-1)
        sign = np.where(pivot == k, sign, -sign)
        for rows in (upper, right):
            taken = np.take_along_axis(rows, pivot[..., None, None], axis=-2)
            np.put_along_axis(rows, pivot[..., None, None], rows[..., k : k + 1, :], axis=-2)
            rows[..., k : k + 1, :] = taken
        head = upper[..., k, k]
        factors = upper[..., k + 1 :, k] / np.where(head == 0, 1.0, head)[..., None]
        upper[..., k + 1 :, :] -= factors[..., None] * upper[..., k : k + 1, :]
        right[..., k + 1 :, :] -= factors[..., None] * right[..., k : k + 1, :]
    return upper, right, sign


def solve(matrix: Matrices, right: Matrices) -> Result:
    """Return ``x`` of ``matrix @ x = right``, for square matrices and a vector (n,) or matrices (..., n, k).

    Raises:
        np.linalg.LinAlgError: A matrix is singular.
    """
    right = np.asarray(right, np.float64)
    upper, found, _ = _eliminated(matrix, right[:, None] if right.ndim == 1 else right)
    if (np.diagonal(upper, axis1=-2, axis2=-1) == 0).any():
        raise np.linalg.LinAlgError("singular matrix")
    for k in range(upper.shape[-1] - 1, -1, -1):
        found[..., k, :] /= upper[..., k, k, None]
        found[..., :k, :] -= upper[..., :k, k, None] * found[..., k : k + 1, :]
    return found[..., 0] if right.ndim == 1 else found


def determinant(matrix: Matrices) -> Result:
    """Return the determinants of square matrices (..., n, n), shape (...)."""
    upper, _, value = _eliminated(matrix, np.zeros((*np.shape(matrix)[:-1], 0)))
    for k in range(upper.shape[-1]):
        value = value * upper[..., k, k]
    return value[()]


def cholesky(matrix: Matrices) -> Result:
    """Return the lower triangular ``l`` of ``matrix = l @ l.T``, for positive definite matrices (..., n, n).

    Raises:
        np.linalg.LinAlgError: A matrix is not positive definite.
    """
    matrix = np.asarray(matrix, np.float64)
    lower = np.zeros_like(matrix)
    for k in range(matrix.shape[-1]):
        row = lower[..., k, :k]
        square = matrix[..., k, k] - (row * row).sum(axis=-1)
        if not (square > 0).all():
            raise np.linalg.LinAlgError("a matrix is not positive definite")
        lower[..., k, k] = np.sqrt(square)
        rest = matrix[..., k + 1 :, k] - product(lower[..., k + 1 :, :k], row[..., None])[..., 0]
        lower[..., k + 1 :, k] = rest / lower[..., k, k, None]
    return lower


def svd(matrix: Matrices) -> tuple[Result, Result, Result]:
    """Return the thin singular value decomposition of matrices (..., m, n), by one-sided Jacobi rotations.

    Returns:
        ``u`` (..., m, r), values (..., r) from the largest down, ``v`` transposed (..., r, n), where r is the
        smaller of m and n. Columns of ``u`` (of ``v`` where m < n) that belong to a value of 0 are 0.
    """
    matrix = np.array(matrix, np.float64)
    if matrix.shape[-2] < matrix.shape[-1]:
        right, values, left = svd(np.swapaxes(matrix, -2, -1))
        return np.swapaxes(left, -2, -1), values, np.swapaxes(right, -2, -1)
    size = matrix.shape[-1]
    rotation = np.zeros((*matrix.shape[:-2], size, size)) + np.eye(size)
    sweeps = 30  # most rounds of Jacobi rotations; they converge quadratically, within ten
    for _ in range(sweeps):
        done = True
        for p in range(size):
            for q in range(p + 1, size):
                one, two = matrix[..., p], matrix[..., q]
                squares = (one * one).sum(axis=-1), (two * two).sum(axis=-1)
                mixed = (one * two).sum(axis=-1)
                apart = np.abs(mixed) > 1e-16 * np.sqrt(squares[0] * squares[1])
                if not apart.any():
                    continue
                done = False
                ratio = (squares[1] - squares[0]) / (2 * np.where(apart, mixed, 1.0))
                with np.errstate(over="ignore"):  # a column of zeros is not rotated
                    tangent = np.where(ratio < 0, -1.0, 1.0) / (np.abs(ratio) + np.sqrt(1 + ratio * ratio))
                tangent = np.where(apart, tangent, 0.0)
                cosine = (1 / np.sqrt(1 + tangent * tangent))[..., None]
                sine = cosine * tangent[..., None]
                for columns in (matrix, rotation):
                    one, two = columns[..., p].copy(), columns[..., q].copy()
                    columns[..., p] = cosine * one - sine * two
                    columns[..., q] = sine * one + cosine * two
        if done:
            break
    values = np.sqrt((matrix * matrix).sum(axis=-2))
    order = np.argsort(-values, axis=-1, kind="stable")
    values = np.take_along_axis(values, order, axis=-1)
    left = np.take_along_axis(matrix, order[..., None, :], axis=-1)
    left = left / np.where(values == 0, 1.0, values)[..., None, :]
    return left, values, np.swapaxes(np.take_along_axis(rotation, order[..., None, :], axis=-1), -2, -1)


def eigh(matrix: Matrices) -> tuple[Result, Result]:
    """Return eigenvalues, ascending, and unit eigenvectors (columns) of symmetric matrices (..., 2, 2)."""
    matrix = np.asarray(matrix, np.float64)
    a, b, c = matrix[..., 0, 0], matrix[..., 0, 1], matrix[..., 1, 1]
    middle, half = 0.5 * (a + c), 0.5 * (a - c)
    spread = np.sqrt(half * half + b * b)
    values = np.stack([middle - spread, middle + spread], axis=-1)
    # The axis of the larger value, from the row of the matrix that does not cancel.
    x, y = np.where(half >= 0, half + spread, b), np.where(half >= 0, b, spread - half)
    length = np.sqrt(x * x + y * y)
    x = np.where(length == 0, 1.0, x / np.where(length == 0, 1.0, length))
    y = np.where(length == 0, 0.0, y / np.where(length == 0, 1.0, length))
    return values, np.stack([np.stack([-y, x], axis=-1), np.stack([x, y], axis=-1)], axis=-1)


def principal_direction(points: Matrices) -> Result:
    """Return the unit vectors (..., 2) along which points (..., n, 2) spread most about their mean."""
    points = np.asarray(points, np.float64)
    x, y = np.moveaxis(points - points.mean(axis=-2, keepdims=True), -1, 0)
    mixed = (x * y).sum(axis=-1)
    matrix = np.stack([(x * x).sum(axis=-1), mixed, mixed, (y * y).sum(axis=-1)], axis=-1)
    return eigh(matrix.reshape(*mixed.shape, 2, 2))[1][..., :, 1]
