"""Tissue that nothing holds, in a frame that goes along with it; axes of that frame, SI units.

A step with the fixed matrix A resists rotation, which would let a body that nothing holds turn as in honey. So it
deforms in a frame that a rigid body of its mass carries, and of its step is left what moves neither centre of mass nor

    Σ m X × x = 0,

with X the nodes at rest about the centre of mass: the frame is the one that fits the body best, the rotation in the
polar decomposition of Σ m x Xᵀ (Müller and others, Meshless deformations based on shape matching, 2005). Forces of
constraint B μ, with the six columns of B those of mass times rigid motion, are what an accelerated frame does to it:

    A d = r + B μ,  Bᵀ d = 0,   hence  d = A⁻¹ r - Z Zᵀ r   with  Z Zᵀ = A⁻¹ B (Bᵀ A⁻¹ B)⁻¹ Bᵀ A⁻¹.

As they are linear in the fixed matrix, the compliance of the step has them too, once and for all.
"""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_triangular

from ligature.kernels import kernel

Array = NDArray[np.float64]


def frame_modes(solve: Callable[[Array], Array], mass: Array, rest: Array) -> Array:
    """Z above, (6, n, 3), from ``solve``, A⁻¹ times a vector (3 n,), nodes' masses (n,) and places at rest (n, 3)."""
    about = rest - mass @ rest / mass.sum()
    rigid = np.concatenate([np.broadcast_to(np.eye(3)[:, None], (3, *rest.shape)), np.cross(np.eye(3)[:, None], about)])
    B = (mass[:, None] * rigid).reshape(6, -1)
    Y = np.stack([solve(row.copy()) for row in B])
    modes = solve_triangular(np.linalg.cholesky(B @ Y.T), Y, lower=True)
    return np.ascontiguousarray(modes.reshape(6, *rest.shape))


@kernel
def without_frame(modes: Array, d: Array, force: Array) -> None:
    """Take from ``d`` (n, 3) = A⁻¹ ``force`` (n, 3) what the frame does instead."""
    for mode in range(modes.shape[0]):
        Z, share = modes[mode], 0.0
        for k in range(d.shape[0]):
            share += Z[k, 0] * force[k, 0] + Z[k, 1] * force[k, 1] + Z[k, 2] * force[k, 2]
        for k in range(d.shape[0]):
            for a in range(3):
                d[k, a] -= share * Z[k, a]


@kernel
def add_inertial_forces(mass: Array, x: Array, v: Array, spin: Array, h: float, force: Array) -> None:
    """force (n, 3) += centrifugal and Coriolis forces in a frame that turns by ``spin`` (3,), in a step of ``h`` s.

    Coriolis forces turn velocities by twice the frame's turn, by the rule of Cayley, which adds no energy.
    """
    wx, wy, wz = spin[0], spin[1], spin[2]
    scale = 2.0 / (1.0 + h * h * (wx * wx + wy * wy + wz * wz))
    for k in range(x.shape[0]):
        # With t = -h ω the turned velocity is v + 2 / (1 + t²) t × (v + t × v).
        vx, vy, vz = v[k, 0], v[k, 1], v[k, 2]
        ux = vx - h * (wy * vz - wz * vy)
        uy = vy - h * (wz * vx - wx * vz)
        uz = vz - h * (wx * vy - wy * vx)
        cx = wy * x[k, 2] - wz * x[k, 1]
        cy = wz * x[k, 0] - wx * x[k, 2]
        cz = wx * x[k, 1] - wy * x[k, 0]
        force[k, 0] -= mass[k] * (scale * (wy * uz - wz * uy) + wy * cz - wz * cy)
        force[k, 1] -= mass[k] * (scale * (wz * ux - wx * uz) + wz * cx - wx * cz)
        force[k, 2] -= mass[k] * (scale * (wx * uy - wy * ux) + wx * cy - wy * cx)


@kernel
def sum_moments(mass: Array, centre: Array, x: Array, v: Array, out: Array) -> None:
    """Inertia of nodes about ``centre`` (3,) and, in the last row of ``out`` (4, 3), their moment of momentum."""
    for a in range(4):
        out[a, 0], out[a, 1], out[a, 2] = 0.0, 0.0, 0.0
    for k in range(x.shape[0]):
        m, rx, ry, rz = mass[k], x[k, 0] - centre[0], x[k, 1] - centre[1], x[k, 2] - centre[2]
        out[0, 0] += m * (ry * ry + rz * rz)
        out[1, 1] += m * (rz * rz + rx * rx)
        out[2, 2] += m * (rx * rx + ry * ry)
        out[0, 1] -= m * rx * ry
        out[0, 2] -= m * rx * rz
        out[1, 2] -= m * ry * rz
        out[3, 0] += m * (ry * v[k, 2] - rz * v[k, 1])
        out[3, 1] += m * (rz * v[k, 0] - rx * v[k, 2])
        out[3, 2] += m * (rx * v[k, 1] - ry * v[k, 0])
    out[1, 0], out[2, 0], out[2, 1] = out[0, 1], out[0, 2], out[1, 2]


@kernel
def share_momentum(sums: Array, rest: Array, inertia: Array, spin: Array, share: Array, work: Array) -> None:
    """Let ``spin`` (3,) and ``share`` (3,) be those of the shape now, at the same moment of momentum in all.

    ``sums`` (4, 3) are of the shape now, ``rest`` of that at rest, ``inertia`` (3, 3) the rigid body's; ``work`` (3, 3)
    is scratch.
    """
    A = work
    b = share
    for a in range(3):
        b[a] -= sums[3, a]
        for k in range(3):
            b[a] += inertia[a, k] * spin[k]
            A[a, k] = inertia[a, k] + sums[a, k] - rest[a, k]
    # Cholesky's method by hand: the inertia of a body is symmetric and positive.
    l00 = math.sqrt(A[0, 0])
    l10, l20 = A[1, 0] / l00, A[2, 0] / l00
    l11 = math.sqrt(A[1, 1] - l10 * l10)
    l21 = (A[2, 1] - l20 * l10) / l11
    l22 = math.sqrt(A[2, 2] - l20 * l20 - l21 * l21)
    y0 = b[0] / l00
    y1 = (b[1] - l10 * y0) / l11
    y2 = (b[2] - l20 * y0 - l21 * y1) / l22
    spin[2] = y2 / l22
    spin[1] = (y1 - l21 * spin[2]) / l11
    spin[0] = (y0 - l10 * spin[1] - l20 * spin[2]) / l00
    for a in range(3):
        share[a] = sums[3, a]
        for k in range(3):
            share[a] += (sums[a, k] - rest[a, k]) * spin[k]


class Momentum:
    """Moment of momentum of tissue in its frame, over that of the rigid body that carries the frame.

    Parameters
    ----------
    mass, rest
        Of the nodes, (n,) kg and at rest (n, 3) m.
    inertia
        Of the rigid body about the centre of mass (3, 3), kg m².
    """

    def __init__(self, mass: Array, rest: Array, inertia: Array) -> None:
        self._mass, self._centre, self._inertia = mass, mass @ rest / mass.sum(), np.ascontiguousarray(inertia)
        self._sums, self._rest, self._work = np.zeros((4, 3)), np.zeros((4, 3)), np.zeros((3, 3))
        sum_moments(mass, self._centre, rest, rest, self._rest)

    def share(self, x: Array, v: Array, spin: Array, before: Array) -> tuple[Array, Array]:
        """Angular velocity (3,) and share of the tissue in the momentum (3,) when nodes are at ``x`` with ``v``.

        ``spin`` (3,) was the rigid body's and ``before`` (3,) the share: their sum stays.
        """
        spin, share = spin.copy(), before.copy()
        sum_moments(self._mass, self._centre, x, v, self._sums)
        share_momentum(self._sums, self._rest, self._inertia, spin, share, self._work)
        return spin, share
