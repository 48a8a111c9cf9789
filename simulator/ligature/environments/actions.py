"""What an agent's actions are: they move the set-point of one arm. Metres, radians; poses in the arm's base."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ligature.environments.reading import ArmReading
from ligature.model.frames import axis_rotation
from ligature.robots.operating_state import Rejected
from ligature.robots.poses import rotation_vector
from ligature.robots.psm_arm import PsmArm

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
        forward, reading = self._arm.kinematics.forward, self._reading
        before = reading.joint_setpoints.copy()
        T, bounded = _bounded(forward(reading.joints), _stepped(forward(before), action))
        self._arm.servo_cp(T)
        if np.abs(self._arm.setpoint_js().position - before).max() <= LEAP:
            return bounded
        # beyond the limits of the wrist the same pose has other joints, and on the way there the tip is elsewhere
        self._arm.servo_jp(before)
        return True

    def _act_on_joints(self, step: Array) -> bool:
        measured, wanted = self._reading.joints, self._reading.joint_setpoints + step
        near = np.clip(wanted, measured - AHEAD_JOINTS, measured + AHEAD_JOINTS)
        self._arm.servo_jp(near)
        return bool((near != wanted).any())


def _stepped(T: Array, action: Array) -> Array:
    """The set-point ``T`` (4, 4) moved by an action, in place."""
    T[:3, 3] += STEP_LENGTH * action[:3]
    turn = STEP_ANGLE * action[3:6]
    angle = _length(turn)
    if angle > 0.0:
        T[:3, :3] = T[:3, :3] @ axis_rotation(turn / angle, angle)
    return T


def _is_near(T_measured: Array, T: Array) -> bool:
    """Whether a set-point (4, 4) is within `AHEAD_LENGTH` and `AHEAD_ANGLE` of what is measured."""
    cosine = 0.5 * (float((T_measured[:3, :3] * T[:3, :3]).sum()) - 1.0)
    return _length(T[:3, 3] - T_measured[:3, 3]) <= AHEAD_LENGTH and cosine >= NEAR_COSINE


def _bounded(T_measured: Array, T: Array) -> tuple[Array, bool]:
    """A set-point (4, 4) no farther from what is measured than `AHEAD_LENGTH` and `AHEAD_ANGLE`, and whether it was."""
    if _is_near(T_measured, T):
        return T, False
    ahead, found = T[:3, 3] - T_measured[:3, 3], T.copy()
    length, turn = _length(ahead), rotation_vector(T_measured[:3, :3].T @ T[:3, :3])
    angle = _length(turn)
    if length > AHEAD_LENGTH:
        found[:3, 3] = T_measured[:3, 3] + ahead * (AHEAD_LENGTH / length)
    if angle > AHEAD_ANGLE:
        found[:3, :3] = T_measured[:3, :3] @ axis_rotation(turn / angle, AHEAD_ANGLE)
    return found, True


def _length(vector: Array) -> float:
    """Length of a vector (3,)."""
    x, y, z = vector.tolist()
    return math.sqrt(x * x + y * y + z * z)
