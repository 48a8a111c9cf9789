"""Kinematics of the master tool manipulator (MTM), in closed form.

The base frame is that of the first joint. Joints: outer yaw, shoulder pitch, elbow pitch, wrist platform, wrist
pitch, wrist yaw, wrist roll. The last four axes meet in one point, so the first three joints place the tip and the
last four turn it, with one freedom to spare. Table (standard
convention): ``MTML.json`` and ``MTMR.json`` of the dVRK's sawIntuitiveResearchKit 2.4.
"""

from __future__ import annotations

import math
from types import MappingProxyType

import numpy as np
from numpy.typing import ArrayLike

from ligature.kernels import compiled
from ligature.robots.chain import HALF_PI, Array, Chain, Convention, Link, advance, identity
from ligature.robots.inverse import (
    DEGENERATE,
    Answers,
    Integers,
    InverseResult,
    Reason,
    first_outside,
    is_rigid,
    nearest_turn,
    pose_rows,
    seed_rows,
)

JOINT_NAMES = (
    "outer_yaw", "shoulder_pitch", "elbow_pitch", "wrist_platform", "wrist_pitch", "wrist_yaw", "wrist_roll",
)  # fmt: skip

UPPER_ARM, FOREARM, FOREARM_RISE = 0.2794, 0.3645, 0.1506
"""Lengths in metres: shoulder to elbow, elbow to wrist along the forearm, and across it."""

ELBOW_TO_WRIST = math.hypot(FOREARM, FOREARM_RISE)
FOREARM_ANGLE = math.atan2(FOREARM_RISE, FOREARM)

PLATFORM, PITCH, YAW, ROLL = 3, 4, 5, 6

_COMMON = ((-1.6580, 3.2288), (-0.785398, 0.785398), (-8.37758, 7.85398))
LIMITS = MappingProxyType(
    {
        "left": ((-0.698132, 1.13446), (-0.261799, 1.13446), (-0.872665, 0.610865), (-3.5779, 1.6580), *_COMMON),
        "right": ((-1.13446, 0.698132), (-0.31416, 1.13446), (-0.872665, 0.610865), (-1.6580, 3.5779), *_COMMON),
    }
)
"""(low, high) of the joints in radians."""

GRIPPER = (0.0, np.deg2rad(60.0))
"""Nominal range of the gripper angle in radians."""

INSIDE = 1e-7
"""Radians by which a platform angle at the edge of what the wrist allows is kept inside, for rounding."""


class Mtm(Chain):
    """A master tool manipulator; ``side`` is "left" (MTML) or "right" (MTMR), which differ in their limits.

    Raises
    ------
    ValueError
        For another side.
    """

    def __init__(self, side: str) -> None:
        if side not in LIMITS:
            raise ValueError(f"'{side}' is not a side of the console; use 'left' or 'right'")
        self.side = side
        links = (
            Link(alpha=HALF_PI, theta=-HALF_PI),
            Link(a=UPPER_ARM, theta=-HALF_PI),
            Link(alpha=-HALF_PI, a=FOREARM, theta=HALF_PI),
            Link(alpha=HALF_PI, d=FOREARM_RISE),
            Link(alpha=-HALF_PI),
            Link(alpha=HALF_PI, theta=-HALF_PI),
            Link(theta=HALF_PI),
        )
        super().__init__(JOINT_NAMES, links, Convention.STANDARD, np.eye(4), LIMITS[side])

    def inverse(self, T_base_tip: ArrayLike, seed: ArrayLike | None = None) -> InverseResult:
        """Joint values that bring the tip to ``T_base_tip`` (..., 4, 4).

        The wrist platform stays as close as the limits of the wrist allow to that of ``seed`` (7,) or (..., 7), or
        to zero, and the roll takes the turn closest to that of ``seed``. The wrist gives every orientation. A pose is
        singular with the wrist on the axis of the outer yaw.
        """
        poses, shape = pose_rows(T_base_tip)
        out = Answers(len(poses), 7, shape)
        seeds = seed_rows(seed, 7, len(poses))
        _inverse_rows(self._table, self._limits, poses, seeds, out.q, out.code, out.joint)
        return out.result()


@compiled
def _inverse_rows(
    table: Array, limits: Array, poses: Array, seeds: Array, q: Array, code: Integers, joint: Integers
) -> None:
    """Solve each of ``poses`` (m, 4, 4); the last three arrays are written."""
    T3, R37, choices = np.empty((4, 4)), np.empty((3, 3)), np.empty(12)
    for k in range(poses.shape[0]):
        T, seed = poses[k], seeds[k if seeds.shape[0] > 1 else 0]
        joint[k] = -1
        q[k] = np.nan
        if not is_rigid(T):
            code[k] = Reason.NOT_A_POSE
            continue
        code[k] = _place(T, q[k])
        if code[k] != Reason.REACHED:
            continue
        identity(T3)
        for j in range(3):
            advance(table[j], False, q[k, j], T3)
        for i in range(3):
            for j in range(3):
                R37[i, j] = T3[0, i] * T[0, j] + T3[1, i] * T[1, j] + T3[2, i] * T[2, j]
        _wrist(R37, limits, seed, choices, q[k])
        joint[k] = first_outside(q[k], limits)
        if joint[k] >= 0:
            code[k] = Reason.OUTSIDE_LIMITS


@compiled
def _place(T: Array, q: Array) -> int:
    """Yaw, shoulder and elbow for the position of ``T``; the elbow bends to the side that the limits allow."""
    x, y, z = T[0, 3], T[1, 3], T[2, 3]
    r = np.sqrt(x * x + y * y)
    cosine = (r * r + z * z - UPPER_ARM**2 - ELBOW_TO_WRIST**2) / (2 * UPPER_ARM * ELBOW_TO_WRIST)
    if abs(cosine) > 1.0:
        return Reason.UNREACHABLE
    if r < DEGENERATE:
        return Reason.SINGULAR
    elbow = np.arctan2(np.sqrt(1.0 - cosine * cosine), cosine)
    lift = np.arctan2(ELBOW_TO_WRIST * np.sin(elbow), UPPER_ARM + ELBOW_TO_WRIST * np.cos(elbow))
    q[0] = np.arctan2(x, -y)
    q[1] = np.arctan2(z, r) - lift + HALF_PI
    q[2] = elbow - FOREARM_ANGLE - HALF_PI
    return Reason.REACHED


@compiled
def _wrist(R37: Array, limits: Array, seed: Array, choices: Array, q: Array) -> None:
    """The wrist within its limits whose platform is closest to the seed's, into ``q[3:]``."""
    near = min(max(seed[PLATFORM], limits[0, PLATFORM]), limits[1, PLATFORM])
    _turn_wrist(R37, near, limits, seed, q)
    if first_outside(q[PLATFORM:], limits[:, PLATFORM:]) < 0:
        return
    best, closest = near, np.inf
    for platform in choices[: _platforms(R37[:, 2], limits, near, choices)]:
        if abs(platform - near) < closest:
            _turn_wrist(R37, platform, limits, seed, q)
            if first_outside(q[PLATFORM:], limits[:, PLATFORM:]) < 0:
                best, closest = platform, abs(platform - near)
    _turn_wrist(R37, best, limits, seed, q)


@compiled
def _turn_wrist(R37: Array, platform: float, limits: Array, seed: Array, q: Array) -> None:
    """The wrist for a given platform angle, into ``q[3:]``: the branch with cos(wrist yaw) >= 0.

    The roll axis, the third column of ``R37``, fixes pitch and yaw; the roll is what remains.
    """
    c, s = np.cos(platform), np.sin(platform)
    u = R37[:, 2]
    along, across, out = c * u[0] + s * u[1], u[2], s * u[0] - c * u[1]  # in the axes of link 4
    pitch = seed[PITCH]
    if along * along + across * across > DEGENERATE**2:
        pitch = np.arctan2(-across, -along)
    yaw = np.arctan2(out, np.sqrt(along * along + across * across))
    cp, sp, cy, sy = np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    # link 6 in link 4: x is (cp sy, sp sy, cy), y is (-sp, cp, 0)
    x4, y4, z4 = c * R37[0, 0] + s * R37[1, 0], R37[2, 0], s * R37[0, 0] - c * R37[1, 0]
    on_x, on_y = cp * sy * x4 + sp * sy * y4 + cy * z4, cp * y4 - sp * x4
    q[PLATFORM] = platform
    q[PITCH] = nearest_turn(pitch, seed[PITCH], limits[0, PITCH], limits[1, PITCH])
    q[YAW] = yaw
    q[ROLL] = nearest_turn(np.arctan2(on_y, on_x) - HALF_PI, seed[ROLL], limits[0, ROLL], limits[1, ROLL])


@compiled
def _platforms(u: Array, limits: Array, near: float, choices: Array) -> int:
    """Platform angles at the edges of what the wrist allows, and where its yaw is zero; returns how many.

    ``u`` (3,) is the roll axis in link 3. Between two edges the platform is either allowed throughout or not at all.
    """
    low, high = limits[0, PLATFORM], limits[1, PLATFORM]
    choices[0], choices[1] = low, high
    across, around = np.sqrt(u[0] * u[0] + u[1] * u[1]), np.arctan2(u[1], u[0])
    if across < DEGENERATE:
        return 2
    choices[2], choices[3] = around, around + np.pi
    count = 4
    for side in range(2):
        inwards = INSIDE if side == 0 else -INSIDE
        sine = np.sin(limits[side, YAW] + inwards) / across
        if abs(sine) <= 1.0:
            choices[count], choices[count + 1] = around + np.arcsin(sine), around + np.pi - np.arcsin(sine)
            count += 2
        edge = limits[side, PITCH] + inwards
        cosine = u[2] / np.tan(edge) / across
        if abs(cosine) <= 1.0:
            choices[count], choices[count + 1] = around + np.arccos(cosine), around - np.arccos(cosine)
            count += 2
    for i in range(2, count):
        choices[i] = nearest_turn(choices[i], near, low, high)
    return count
