"""What an agent's actions are: they move the set-point of one arm. Metres, radians; poses in the arm's base."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.environments.reading import ArmReading
from ligature.kernels import compiled
from ligature.model.frames import axis_rotation
from ligature.robots.chain import forward_row
from ligature.robots.operating_state import Rejected
from ligature.robots.poses import rotation_vector
from ligature.robots.psm_arm import PsmArm
from ligature.unrolled import Matrix, unrolled

Array = NDArray[np.float64]

STEP_LENGTH, STEP_ANGLE, STEP_JAW = 0.001, 0.05, 0.1
"""Metres, radians and radians of jaw that an action of 1 means."""

STEP_JOINTS = np.array([0.01, 0.01, 0.001, 0.08, 0.06, 0.06])

AHEAD_LENGTH, AHEAD_ANGLE, AHEAD_JOINTS = 0.005, 0.25, 5.0 * STEP_JOINTS
"""How far a set-point may be ahead of what is measured: an arm that something stops does not wind up."""

LEAP = 0.5
"""Radians and metres that a joint's set-point may go in an action: a step of the tip takes a tenth of that."""

NEAR_COSINE = math.cos(AHEAD_ANGLE)


class ArmActions:
    """Moves the set-point of ``arm`` by actions, ``cartesian`` or ``joint`` (`SuturingEnv` has the table)."""

    def __init__(self, arm: PsmArm, reading: ArmReading, kind: str) -> None:
        self._arm, self._reading, self._kind = arm, reading, kind
        self._before, self._T_measured, self._T = np.zeros(arm.joints.n), np.zeros((4, 4)), np.zeros((4, 4))

    def act(self, action: Array) -> tuple[str, bool]:
        """Command the arm by an action (7,) of -1 to 1; what it rejects is returned, and it stays.

        Also whether the set-point was held back.
        """
        arm, bounded = self._arm, False
        try:
            if self._kind == "joint":
                bounded = self._act_on_joints(action[:6] * STEP_JOINTS)
            else:
                bounded = self._act_on_tip(action)
            if arm.jaw is not None:
                arm.jaw.servo_jp(self._reading.jaw_setpoint[:1] + STEP_JAW * action[6])
        except Rejected as rejection:
            return str(rejection), bounded
        return "", bounded

    def _act_on_tip(self, action: Array) -> bool:
        """Move the set-point by an action, near the tip; whether it was held back for that."""
        arm, reading, before, T = self._arm, self._reading, self._before, self._T
        before[:] = reading.joint_setpoints
        bounded = not _step_setpoint(*arm.kinematics.tables(), reading.joints, before, action, self._T_measured, T)
        arm.servo_cp(_bounded(self._T_measured, T) if bounded else T)
        if np.abs(arm.joints.setpoint[0] - before).max() <= LEAP:
            return bounded
        # beyond the limits of the wrist the same pose has other joints, and on the way there the tip is elsewhere
        arm.servo_jp(before)
        return True

    def _act_on_joints(self, step: Array) -> bool:
        measured, wanted = self._reading.joints, self._reading.joint_setpoints + step
        near = np.clip(wanted, measured - AHEAD_JOINTS, measured + AHEAD_JOINTS)
        self._arm.servo_jp(near)
        return bool((near != wanted).any())


@unrolled(A=(3, 3), B=(3, 3), C=(3, 3))
def _multiply(k: int, A: Matrix, B: Matrix, C: Matrix) -> None:
    """Row ``k`` of ``C`` is the product of those of ``A`` and ``B``, with the bits of OpenBLAS for `blas.CORE`."""
    C[k] = A[k] @ B[k]


@compiled
def _step_setpoint(
    table: Array, modified: bool, tip: Array, measured: Array, before: Array, action: Array, T_measured: Array, T: Array
) -> bool:
    """Poses (4, 4) of the tip: ``T_measured`` at the joints ``measured``, ``T`` where an ``action`` moves it to.

    It moves from the joints ``before``; the first three arguments are those of the kinematics. Returns whether ``T`` is
    within `AHEAD_LENGTH` and `AHEAD_ANGLE` of what is measured.
    """
    forward_row(table, modified, tip, measured, T_measured)
    forward_row(table, modified, tip, before, T)
    for a in range(3):
        T[a, 3] += STEP_LENGTH * action[a]
    x, y, z = STEP_ANGLE * action[3], STEP_ANGLE * action[4], STEP_ANGLE * action[5]
    angle = math.sqrt(x * x + y * y + z * z)
    if angle > 0.0:
        _turn(T, x / angle, y / angle, z / angle, angle)
    overlap = np.empty((3, 3))
    way = 0.0
    for i in range(3):
        for j in range(3):
            overlap[i, j] = T_measured[i, j] * T[i, j]
        ahead = T[i, 3] - T_measured[i, 3]
        way += ahead * ahead
    (a, b, c), (d, e, f), (g, h, i) = overlap
    cosine = 0.5 * ((((a + b) + (c + d)) + ((e + f) + (g + h)) + i) - 1.0)  # in this order NumPy adds nine numbers
    return math.sqrt(way) <= AHEAD_LENGTH and cosine >= NEAR_COSINE


@compiled
def _turn(T: Array, x: float, y: float, z: float, angle: float) -> None:
    """Turn the pose ``T`` (4, 4) about the unit vector x y z of its own axes, as `axis_rotation` does."""
    K, square, turn, turned = np.zeros((1, 3, 3)), np.empty((1, 3, 3)), np.empty((1, 3, 3)), np.empty((1, 3, 3))
    K[0, 0, 1], K[0, 0, 2], K[0, 1, 0], K[0, 1, 2], K[0, 2, 0], K[0, 2, 1] = -z, y, z, -x, -y, x
    _multiply(0, K, K, square)
    sine, rest = math.sin(angle), 1.0 - math.cos(angle)
    for i in range(3):
        for j in range(3):
            turn[0, i, j] = (1.0 if i == j else 0.0) + sine * K[0, i, j] + rest * square[0, i, j]
            K[0, i, j] = T[i, j]
    _multiply(0, K, turn, turned)
    T[:3, :3] = turned[0]


def _bounded(T_measured: Array, T: Array) -> Array:
    """A set-point (4, 4) no farther from what is measured than `AHEAD_LENGTH` and `AHEAD_ANGLE`."""
    ahead, found = T[:3, 3] - T_measured[:3, 3], T.copy()
    length, turn = _length(ahead), rotation_vector(T_measured[:3, :3].T @ T[:3, :3])
    angle = _length(turn)
    if length > AHEAD_LENGTH:
        found[:3, 3] = T_measured[:3, 3] + ahead * (AHEAD_LENGTH / length)
    if angle > AHEAD_ANGLE:
        found[:3, :3] = T_measured[:3, :3] @ axis_rotation(turn / angle, AHEAD_ANGLE)
    return found


def _length(vector: Array) -> float:
    """Length of a vector (3,)."""
    x, y, z = vector.tolist()
    return math.sqrt(x * x + y * y + z * z)
