"""Euler angles and quaternions (x, y, z, w), in radians, as AMBF's clients call them.

``axes`` is ``s`` (fixed axes) or ``r`` (axes that turn with the body) and three letters: the axis of the first,
second and third angle. ``sxyz`` is roll, pitch, yaw.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

Quaternion = tuple[float, float, float, float]

GIMBAL = 1e-7
"""Below this sine or cosine of the middle half angle the first and third axis coincide."""


def quaternion_from_euler(ai: float, aj: float, ak: float, axes: str = "sxyz") -> Quaternion:
    """Quaternion x, y, z, w that turns by ``ai``, ``aj``, ``ak`` about the three ``axes``; ValueError on other axes."""
    fixed, sequence = _axes(axes)
    turns = [_about(axis, angle) for axis, angle in zip(sequence, (ai, aj, ak), strict=True)]
    if fixed:
        turns.reverse()
    return _product(_product(turns[0], turns[1]), turns[2])


def euler_from_quaternion(quaternion: Sequence[float], axes: str = "sxyz") -> tuple[float, float, float]:
    """Angles about the three ``axes`` of a ``quaternion`` x, y, z, w of any length.

    The first and third are in -π..π; where both are about one axis, one of them is zero. A quaternion of zero length,
    as in a message that was never filled, is no rotation. Bernardes and Viollet, PLOS ONE 17(11), 2022, algorithm 1.
    """
    fixed, sequence = _axes(axes)
    x, y, z, w = (float(value) for value in quaternion)
    if x * x + y * y + z * z + w * w == 0.0:
        w = 1.0
    vector = (x, y, z)
    i, j, k = sequence if fixed else sequence[::-1]
    proper = i == k
    if proper:
        k = 3 - i - j
    sign = (i - j) * (j - k) * (k - i) / 2
    if proper:
        a, b, c, d = w, vector[i], vector[j], vector[k] * sign
    else:
        a, b = w - vector[j], vector[i] + vector[k] * sign
        c, d = vector[j] + w, vector[k] * sign - vector[i]
    middle = 2 * math.atan2(math.hypot(c, d), math.hypot(a, b))
    half_sum, half_difference = math.atan2(b, a), math.atan2(d, c)
    if abs(middle) < 2 * GIMBAL:
        first, third = 2 * half_sum, 0.0
    elif abs(middle - math.pi) < 2 * GIMBAL:
        first, third = -2 * half_difference, 0.0
    else:
        first, third = half_sum - half_difference, half_sum + half_difference
    if not proper:
        middle -= math.pi / 2
        third *= sign
    angles = (_wrapped(first), middle, _wrapped(third))
    return angles if fixed else angles[::-1]


def _axes(axes: str) -> tuple[bool, tuple[int, int, int]]:
    letters = axes[1:]
    good = len(axes) == 4 and axes[0] in "sr" and set(letters) <= set("xyz")
    if not good or letters[0] == letters[1] or letters[1] == letters[2]:
        raise ValueError(f"axes {axes!r}: must be 's' or 'r' and three letters of x, y, z, no two neighbours equal")
    i, j, k = ("xyz".index(letter) for letter in letters)
    return axes[0] == "s", (i, j, k)


def _about(axis: int, angle: float) -> Quaternion:
    if math.isinf(angle):  # sine and cosine raise for it, and not for NaN
        angle = math.nan
    q = [0.0, 0.0, 0.0, math.cos(angle / 2)]
    q[axis] = math.sin(angle / 2)
    return (q[0], q[1], q[2], q[3])


def _product(p: Quaternion, q: Quaternion) -> Quaternion:
    px, py, pz, pw = p
    qx, qy, qz, qw = q
    return (
        pw * qx + px * qw + py * qz - pz * qy,
        pw * qy - px * qz + py * qw + pz * qx,
        pw * qz + px * qy - py * qx + pz * qw,
        pw * qw - px * qx - py * qy - pz * qz,
    )


def _wrapped(angle: float) -> float:
    return math.remainder(angle, 2 * math.pi)
