"""Writes the state of an arm into its part of the state record. Radians, metres, N·m, N."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.state import ARM_DTYPE, ARM_JOINTS
from ligature.robots.arm import Arm
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.psm_arm import PsmArm

Array = NDArray[np.float64]


_NUMBERS = slice(ARM_DTYPE.fields["measured_js"][1], ARM_DTYPE.itemsize)  # type: ignore[index]
"""Where the numbers of an arm are in its record, in bytes: all the same from the measured joints on."""


class ArmRecord:
    """Keeps the part of one arm in the state record up to date.

    Assigning to a field of a record takes longer than all arithmetic here: the numbers are gathered in an array of
    their layout, and only what changed is assigned.
    """

    def __init__(self, arm: Arm) -> None:
        self._arm = arm
        self._status: tuple[Any, ...] = ()
        self._described: tuple[Any, ...] = ()
        self._record: Any = None
        self._numbers = numbers = np.zeros((_NUMBERS.stop - _NUMBERS.start) // 8)
        sizes = np.cumsum([0, 6 * ARM_JOINTS, 6, 28, 24, 12 * ARM_JOINTS])
        self._js, self._fingers, self._poses, self._vectors, self._jacobians = (
            numbers[a:b].reshape(shape)
            for a, b, shape in zip(
                sizes[:-1], sizes[1:], ((2, 3, ARM_JOINTS), (2, 3), (4, 7), (4, 6), (2, 6, ARM_JOINTS)), strict=True
            )
        )

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
        opening = b""
        if fingers is not None:
            self._fingers[0], self._fingers[1] = (reading[:, 0] for reading in fingers.readings())
            opening = self._fingers.tobytes()
        placed = arm.base_frame.tobytes(), tool, arm.cf_orientation_absolute
        described = (measured.tobytes(), setpoint.tobytes(), wrench.tobytes(), opening, *placed)
        if described != self._described:
            self._described = described
            arm.kinematics.describe(
                arm.base_frame, arm.cf_orientation_absolute, measured, setpoint, wrench,
                self._js, self._poses, self._vectors, self._jacobians,
            )  # fmt: skip
            if self._record is None:
                self._record = np.asarray(record).reshape(1).view(np.uint8)[_NUMBERS]
            self._record[:] = self._numbers.view(np.uint8)

    def _fill_status(self, record: Any) -> None:
        """Fill in what changes seldom."""
        state, *ratio, reference, record["tool"], record["tool_present"] = self._status
        record["operating"], record["homed"], record["busy"] = state.state, state.is_homed, state.is_busy
        record["ratio"] = ratio
        record["reference"] = reference.encode("utf-8")[:64]
