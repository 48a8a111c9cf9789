"""Writes the state of an arm into its part of the state record. Radians, metres, N·m, N."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.robots.arm import Arm
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.poses import describe_tip
from ligature.robots.psm_arm import PsmArm

Array = NDArray[np.float64]


class ArmRecord:
    """Keeps the part of one arm in the state record up to date.

    Assigning to a field of a record takes longer than all arithmetic here, so that only what changed is assigned.
    """

    def __init__(self, arm: Arm) -> None:
        self._arm = arm
        self._status: tuple[Any, ...] = ()
        self._described: tuple[Any, ...] = ()

    def write(self, record: Any) -> None:
        """Fill ``record``, of `ligature.model.state.ARM_DTYPE`, the same each time, with the arm's state now."""
        arm, axes = self._arm, self._arm.joints
        (measured, setpoint), wrench = axes.readings(), arm.spatial_measured_cf()
        tool = arm.kinematics.instrument.id if isinstance(arm, PsmArm) else 0
        present = isinstance(arm, PsmArm) and arm.tool_present
        status = (arm.operating_state, axes.ratio_v, axes.ratio_a, arm.reference, tool, present)
        if status != self._status:
            self._status = status
            self._fill_status(record)
        fingers = (
            arm.gripper if isinstance(arm, MtmArm) else arm.jaw.axes if isinstance(arm, PsmArm) and arm.jaw else None
        )
        if fingers is not None:
            opening, wanted = fingers.readings()
            record["jaw_measured_js"], record["jaw_setpoint_js"] = opening[:, 0], wanted[:, 0]
        placed = arm.base_frame.tobytes(), tool, arm.cf_orientation_absolute
        described = (measured.tobytes(), setpoint.tobytes(), wrench.tobytes(), *placed)
        if described != self._described:
            self._described = described
            self._describe(record, measured, setpoint, wrench)

    def _fill_status(self, record: Any) -> None:
        """Fill in what changes seldom."""
        state, *ratio, reference, record["tool"], record["tool_present"] = self._status
        record["operating"], record["homed"], record["busy"] = state.state, state.is_homed, state.is_busy
        record["ratio"] = ratio
        record["reference"] = reference.encode("utf-8")[:64]

    def _describe(self, record: Any, measured: Array, setpoint: Array, wrench: Array) -> None:
        """Fill in what follows from joints (3, n) and wrench (6,), most of the work: only when they changed."""
        arm, n = self._arm, self._arm.joints.n
        record["measured_js"][:, :n] = measured
        record["setpoint_js"][:, :n] = setpoint
        tips = arm.kinematics.forward(np.array([measured[0], setpoint[0]]))
        body = arm.kinematics.jacobian_body(measured[0])
        spatial = arm.kinematics.jacobian_spatial(measured[0])
        record["body_jacobian"][:, :n], record["spatial_jacobian"][:, :n] = body, spatial
        poses, vectors = np.empty((4, 7)), np.empty((4, 6))
        describe_tip(tips, arm.base_frame, body @ measured[1], wrench, poses, vectors)
        record["local_measured_cp"], record["local_setpoint_cp"], record["measured_cp"], record["setpoint_cp"] = poses
        record["local_measured_cv"], record["measured_cv"], record["spatial_measured_cf"], turned_back = vectors
        record["body_measured_cf"] = wrench if arm.cf_orientation_absolute else turned_back
