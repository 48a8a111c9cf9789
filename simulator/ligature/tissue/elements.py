"""Matrices of one box-shaped hexahedron of isotropic elastic material, in metres and newtons.

A cell has eight corners; corner ``i + 2 j + 4 k`` lies at (i, j, k) of the unit cell. Its 24 unknowns are the
displacements of the corners in that order, x, y and z of each together.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

CORNERS: Array = np.array([[i, j, k] for k in (0, 1) for j in (0, 1) for i in (0, 1)], dtype=np.float64)
"""Corners of the unit cell, (8, 3)."""

_GAUSS = 0.5 + 0.5 * (2.0 * CORNERS - 1.0) / np.sqrt(3.0)


def gradients(size: Array, at: Array) -> Array:
    """Gradients (8, 3) in 1/m of the trilinear shape functions of a box of edges ``size`` (3,) m.

    ``at`` (3,) is in the unit cell.
    """
    value = np.where(CORNERS > 0.5, at, 1.0 - at)
    slope = np.where(CORNERS > 0.5, 1.0, -1.0) / size
    out = np.empty((8, 3))
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        out[:, a] = slope[:, a] * value[:, b] * value[:, c]
    return out


def _strain_rows(grad: Array) -> Array:
    """Engineering strain (xx, yy, zz, yz, zx, xy) of displacements with these gradients (n, 3): (6, 3 n)."""
    n = len(grad)
    B = np.zeros((6, n, 3))
    for a in range(3):
        b, c = (a + 1) % 3, (a + 2) % 3
        B[a, :, a] = grad[:, a]
        B[3 + a, :, b] = grad[:, c]
        B[3 + a, :, c] = grad[:, b]
    return B.reshape(6, 3 * n)


def lame(youngs: float, poisson: float) -> tuple[float, float]:
    """Lamé's constants (λ, μ) in Pa."""
    return youngs * poisson / ((1 + poisson) * (1 - 2 * poisson)), youngs / (2 * (1 + poisson))


def elasticity(youngs: float, poisson: float) -> Array:
    """Hooke's law (6, 6) in Pa for the strains of `stiffness`."""
    first, shear = lame(youngs, poisson)
    D = np.zeros((6, 6))
    D[:3, :3] = first
    D[np.arange(6), np.arange(6)] += [2 * shear] * 3 + [shear] * 3
    return D


def stiffness(size: Array, youngs: float, poisson: float) -> Array:
    """Stiffness (24, 24) N/m of a box with edges ``size`` (3,) m, integrated at 2 x 2 x 2 points.

    The change of volume is averaged over the cell (the B-bar method: Hughes, Int. J. Numer. Meth. Eng. 15, 1980,
    1413), so that nearly incompressible material does not lock.
    """
    D = elasticity(youngs, poisson)
    points = [_strain_rows(gradients(size, at)) for at in _GAUSS]
    mean = sum(B[:3].sum(axis=0) for B in points) / 8.0
    K = np.zeros((24, 24))
    for B in points:
        B[:3] += (mean - B[:3].sum(axis=0)) / 3.0
        K += B.T @ D @ B
    return K * (float(np.prod(size)) / 8.0)


def skew_stiffness(size: Array, youngs: float, poisson: float) -> Array:
    """Resistance (24, 24) N/m to local rotation: 2 μ times the square of the skew part of the gradient."""
    shear = lame(youngs, poisson)[1]
    K = np.zeros((24, 24))
    for at in _GAUSS:
        grad = gradients(size, at)
        W = np.zeros((3, 8, 3))
        for a in range(3):
            b, c = (a + 1) % 3, (a + 2) % 3
            W[a, :, c] = 0.5 * grad[:, b]
            W[a, :, b] = -0.5 * grad[:, c]
        W = W.reshape(3, 24)
        K += W.T @ W
    # The skew part has each of its three values twice.
    return K * (2.0 * 2.0 * shear * float(np.prod(size)) / 8.0)


def blocks(K: Array) -> Array:
    """The stiffness (24, 24) of a box between patterns of its corners: eight blocks (8, 3, 3), its only values.

    Block p couples component a of the pattern p xor 2ᵃ with b of p xor 2ᵇ. The sign of pattern m at corner k is the
    product of -1 for each bit of m that k lacks; displacements on a pattern are sums with these signs, and forces on
    corners sums with them of forces on patterns.
    """
    bits = (np.arange(8)[:, None] >> np.arange(3)) & 1
    signs = np.where((bits[:, None] & ~bits[None, :]) == 1, -1.0, 1.0).prod(axis=2)
    full = np.einsum("mk,kanb,ln->malb", signs, K.reshape(8, 3, 8, 3), signs) / 64.0
    full[0], full[:, :, 0] = 0.0, 0.0
    axis = np.arange(3)
    pattern = np.arange(8)[:, None] ^ (1 << axis)
    return np.ascontiguousarray(full[pattern[:, :, None], axis[:, None], pattern[:, None, :], axis])
