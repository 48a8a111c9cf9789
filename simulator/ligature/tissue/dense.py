"""Small dense linear algebra for compiled code: the same bits wherever it runs, which BLAS does not promise."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel

Array = NDArray[np.float64]


@kernel
def cholesky(A: Array, n: int) -> bool:
    """Replace the lower triangle of the leading ``n`` rows of ``A`` by its factor L, A = L Lᵀ.

    Returns False, with ``A`` partly overwritten, where A is not positive definite.
    """
    for j in range(n):
        pivot = A[j, j]
        if not pivot > 0.0:
            return False
        root = math.sqrt(pivot)
        A[j, j] = root
        for i in range(j + 1, n):
            A[i, j] /= root
        for i in range(j + 1, n):
            s = A[i, j]
            for k in range(j + 1, i + 1):
                A[i, k] -= s * A[k, j]
    return True


@kernel
def solve_cholesky(L: Array, n: int, b: Array) -> None:
    """Replace the leading ``n`` values of ``b`` by the solution of L Lᵀ x = b."""
    for i in range(n):
        s = b[i]
        for k in range(i):
            s -= L[i, k] * b[k]
        b[i] = s / L[i, i]
    for i in range(n - 1, -1, -1):
        s = b[i] / L[i, i]
        b[i] = s
        for k in range(i):
            b[k] -= s * L[i, k]


@kernel
def invert(A: Array, inverse: Array) -> bool:
    """Invert the symmetric positive definite ``A`` (n, n), whose lower triangle is used up.

    Returns False where A is not positive definite. Rows are updated whole, so that the inner loops are vectors.
    """
    n = A.shape[0]
    for i in range(n):
        for j in range(n):
            inverse[i, j] = 0.0
        inverse[i, i] = 1.0
    # L Lᵀ = A row by row of the transposed factor, kept in the upper triangle.
    for j in range(n):
        for i in range(j):
            A[i, j] = A[j, i]
    for j in range(n):
        pivot = A[j, j]
        if not pivot > 0.0:
            return False
        scale = 1.0 / pivot
        for i in range(j + 1, n):
            s = A[j, i] * scale
            if s != 0.0:
                for k in range(i, n):
                    A[i, k] -= s * A[j, k]
                for k in range(j + 1):
                    inverse[i, k] -= s * inverse[j, k]
    # Now U x = y, with U the pivots' rows: A = Lᵤ U, Lᵤ of unit diagonal.
    for j in range(n - 1, -1, -1):
        for i in range(j + 1, n):
            s = A[j, i]
            if s != 0.0:
                for k in range(n):
                    inverse[j, k] -= s * inverse[i, k]
        scale = 1.0 / A[j, j]
        for k in range(n):
            inverse[j, k] *= scale
    for j in range(n):
        for i in range(j):
            mean = 0.5 * (inverse[i, j] + inverse[j, i])
            inverse[i, j] = mean
            inverse[j, i] = mean
    return True


@kernel
def subtract_product(U: Array, V: Array, out: Array) -> None:
    """out -= U V for U (m, w), V (w, n): four rows of V at a time."""
    m, w = U.shape
    n = V.shape[1]
    for i in range(m):
        k = 0
        while k + 4 <= w:
            a, b, c, d = U[i, k], U[i, k + 1], U[i, k + 2], U[i, k + 3]
            for j in range(n):
                out[i, j] -= a * V[k, j] + b * V[k + 1, j] + c * V[k + 2, j] + d * V[k + 3, j]
            k += 4
        while k < w:
            a = U[i, k]
            for j in range(n):
                out[i, j] -= a * V[k, j]
            k += 1


@inlined
def times(R: Array, v: Array, out: Array) -> None:
    """out = R v, all of three rows."""
    x, y, z = v[0], v[1], v[2]
    for k in range(3):
        out[k] = R[k, 0] * x + R[k, 1] * y + R[k, 2] * z


@inlined
def times_transposed(R: Array, v: Array, out: Array) -> None:
    """out = Rᵀ v, all of three rows."""
    x, y, z = v[0], v[1], v[2]
    for k in range(3):
        out[k] = R[0, k] * x + R[1, k] * y + R[2, k] * z
