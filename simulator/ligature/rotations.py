"""Rotations for compiled code: quaternions x y z w, rotation vectors in radians, matrices (3, 3).

Small angles, which are the rule, go through series to rounding (the first terms left out are below
1e-12): half the time of a tick went into sines otherwise.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined

Array = NDArray[np.float64]


@inlined
def cross(ax: float, ay: float, az: float, bx: float, by: float, bz: float) -> tuple[float, float, float]:
    """Vector product a × b."""
    return ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx


@inlined
def multiply(
    ax: float, ay: float, az: float, aw: float, bx: float, by: float, bz: float, bw: float
) -> tuple[float, float, float, float]:
    """Quaternion product a b: the rotation b, then a."""
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


@inlined
def quaternion_of(vx: float, vy: float, vz: float) -> tuple[float, float, float, float]:
    """Quaternion of a rotation vector (the exponential map)."""
    square = vx * vx + vy * vy + vz * vz
    if square < 0.01:
        s = 0.5 - square * (1.0 / 48.0 - square * (1.0 / 3840.0 - square / 645120.0))
        c = 1.0 - square * (1.0 / 8.0 - square * (1.0 / 384.0 - square / 46080.0))
    else:
        angle = math.sqrt(square)
        s, c = math.sin(0.5 * angle) / angle, math.cos(0.5 * angle)
    return s * vx, s * vy, s * vz, c


@inlined
def rotation_vector(x: float, y: float, z: float, w: float) -> tuple[float, float, float]:
    """Rotation vector of a quaternion (the logarithm), its length in 0..pi."""
    if w < 0.0:
        x, y, z, w = -x, -y, -z, -w
    square = x * x + y * y + z * z
    if square < 0.01:
        # arcsin(r) / r for the sine r of half the angle
        s = 1.0 + square * (1.0 / 6.0 + square * (3.0 / 40.0 + square * (5.0 / 112.0 + square * 35.0 / 1152.0)))
        s *= 2.0
    else:
        sine = math.sqrt(square)
        s = 2.0 * math.atan2(sine, w) / sine
    return s * x, s * y, s * z


@inlined
def turn(q: Array, i: int, vx: float, vy: float, vz: float) -> None:
    """Turn the quaternion ``q[i]`` by a rotation vector in world axes, in place, and renormalise it."""
    ex, ey, ez, ew = quaternion_of(vx, vy, vz)
    x, y, z, w = multiply(ex, ey, ez, ew, q[i, 0], q[i, 1], q[i, 2], q[i, 3])
    s = 1.0 / math.sqrt(x * x + y * y + z * z + w * w)
    q[i, 0], q[i, 1], q[i, 2], q[i, 3] = s * x, s * y, s * z, s * w


@inlined
def matrix_of(x: float, y: float, z: float, w: float, R: Array) -> None:
    """Write the rotation matrix of a unit quaternion into ``R`` (3, 3)."""
    R[0, 0], R[0, 1], R[0, 2] = 1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)
    R[1, 0], R[1, 1], R[1, 2] = 2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)
    R[2, 0], R[2, 1], R[2, 2] = 2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)


@inlined
def rotate(R: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """R v."""
    return (
        R[0, 0] * x + R[0, 1] * y + R[0, 2] * z,
        R[1, 0] * x + R[1, 1] * y + R[1, 2] * z,
        R[2, 0] * x + R[2, 1] * y + R[2, 2] * z,
    )


@inlined
def rotate_back(R: Array, x: float, y: float, z: float) -> tuple[float, float, float]:
    """Rᵀ v."""
    return (
        R[0, 0] * x + R[1, 0] * y + R[2, 0] * z,
        R[0, 1] * x + R[1, 1] * y + R[2, 1] * z,
        R[0, 2] * x + R[1, 2] * y + R[2, 2] * z,
    )


@inlined
def left_jacobian_inverse_times(
    vx: float, vy: float, vz: float, ux: float, uy: float, uz: float
) -> tuple[float, float, float]:
    """Jl(v)⁻¹ u: how the rotation vector v changes when its rotation is turned by u from the left.

    Source: Barfoot, State Estimation for Robotics, eq. 7.76b.
    """
    square = vx * vx + vy * vy + vz * vz
    if square < 0.25:
        c = 1.0 / 12.0 + square * (1.0 / 720.0 + square * (1.0 / 30240.0 + square / 1209600.0))
    else:
        half = 0.5 * math.sqrt(square)
        c = (1.0 - half * math.cos(half) / math.sin(half)) / square
    ax, ay, az = cross(vx, vy, vz, ux, uy, uz)
    bx, by, bz = cross(vx, vy, vz, ax, ay, az)
    return ux - 0.5 * ax + c * bx, uy - 0.5 * ay + c * by, uz - 0.5 * az + c * bz
