"""A patient side manipulator as a CRTK arm: instrument, jaw, and the depth that Cartesian motion needs.

Metres, radians; the jaw angle is the opening between its two fingers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.robots.arm import Arm, JointState
from ligature.robots.axes import Axes
from ligature.robots.instruments import instrument
from ligature.robots.inverse import Reason
from ligature.robots.operating_state import Rejected
from ligature.robots.psm import INSERTION, Psm

Array = NDArray[np.float64]

HOME = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
MAX_VELOCITY = np.array([np.pi / 2, np.pi / 2, 0.2, 6 * np.pi, 6 * np.pi, 6 * np.pi])
MAX_ACCELERATION = np.array([np.pi / 2, np.pi / 2, 0.2, 4 * np.pi, 4 * np.pi, 4 * np.pi])
JAW_MAX_VELOCITY, JAW_MAX_ACCELERATION = 6 * np.pi, 4 * np.pi
"""Limits of moves."""

SERVO_MAX_VELOCITY = np.array([10.0, 10.0, 1.5, 40.0, 40.0, 40.0])
"""Speeds at which the drives catch up with a set-point at most: beyond those of moves, below those of accidents."""

SERVO_MAX_DECELERATION = np.array([100.0, 100.0, 50.0, 4000.0, 4000.0, 4000.0])
"""Decelerations with which they do: what the drives can give such masses, so that a step does not overshoot."""

FOLLOWING_BOUND = np.array([0.6, 0.6, 0.06, 1.5, 1.5, 1.5])

LEAST_DEPTH, ENTRY_DEPTH = 0.045, 0.043
"""Depths of the end of the shaft below the remote centre: kept by Cartesian motion, and needed to begin it."""

OPEN_ANGLE, CLOSED_ANGLE = np.deg2rad(60.0), np.deg2rad(-20.0)


class Jaw:
    """The jaw of a PSM; its moves share the arm's busy flag."""

    def __init__(self, arm: PsmArm, axes: Axes) -> None:
        self._arm, self.axes = arm, axes

    def measured_js(self) -> JointState:
        """Opening, its speed and the effort that closes or opens it, each (1,)."""
        return JointState(*self.axes.measured().copy())

    def setpoint_js(self) -> JointState:
        """What is asked for."""
        return JointState(*self.axes.setpoint.copy())

    def servo_jp(self, angle: ArrayLike) -> None:
        """Follow a stream of openings."""
        self._arm.servo_jaw(angle)

    def move_jp(self, angle: ArrayLike) -> None:
        """Move to an opening."""
        self._arm.move_jaw(angle)

    def servo_jf(self, effort: ArrayLike) -> None:
        """Open or, with a negative effort, close with an effort in N·m."""
        self._arm.push_jaw(effort)

    def open(self, angle: float = OPEN_ANGLE) -> None:
        """Open to an angle."""
        self.move_jp(angle)

    def close(self) -> None:
        """Close, and press."""
        self.move_jp(CLOSED_ANGLE)


class PsmArm(Arm):
    """A PSM with its instrument; ``lower``, ``upper`` (6,) are the ends of travel that the scene's joints have."""

    kind = "PSM"
    kinematics: Psm

    def __init__(self, name: str, kinematics: Psm, joints: Axes, jaw: Axes | None) -> None:
        self._travel = joints.limits.copy()
        self._jaw_axes = jaw
        self.jaw = None if jaw is None else Jaw(self, jaw)
        self.tool_present = True
        super().__init__(name, kinematics, joints, HOME, FOLLOWING_BOUND)
        self._fit_limits()
        self.emit("tool_type", self.tool_type)

    _KEPT = (*Arm._KEPT, "tool_present", "kinematics")

    @property
    def tool_type(self) -> str:
        """Name and model number of the instrument."""
        return self.kinematics.instrument.type

    def outline(self) -> tuple[str, ...]:
        """See `Arm.outline`; the tool and the jaw's mode, too."""
        return *super().outline(), "tool_present", *(() if self._jaw_axes is None else ("_jaw_axes.mode",))

    @property
    def depth(self) -> float:
        """Metres from the remote centre to the end of the shaft, at the set-point."""
        return self.kinematics.depth(self.joints.setpoint[0])

    def set_tool_type(self, tool: str) -> None:
        """Change the instrument: its limits and the jaw's range.

        The lengths stay those of the scene's bodies, which are what moves.

        Raises `Rejected` for an unknown one.
        """
        try:
            found = instrument(tool)
        except ValueError as error:
            raise Rejected(f"set_tool_type: {error}") from error
        self.kinematics = Psm(found, self.kinematics.model, self.kinematics.lengths)
        self._fit_limits()
        self.emit("tool_type", self.tool_type)

    def _fit_limits(self) -> None:
        """Set the joint limits to the intersection of those of the instrument and of the scene's joints."""
        lower = np.maximum(self.kinematics.lower, self._travel[0])
        upper = np.minimum(self.kinematics.upper, self._travel[1])
        self.joints.limits = np.array([lower, upper])
        if self._jaw_axes is not None:
            self._jaw_axes.limits = np.array(self.kinematics.instrument.jaw).reshape(2, 1)

    def emulate_tool_present(self, present: bool) -> None:
        """Pretend that the instrument was put on or taken off; without it only the first joints may move."""
        self.tool_present = bool(present)
        self._emit_state()
        if present:
            self.emit("tool_type", self.tool_type)

    @property
    def is_homed(self) -> bool:
        """See `Device.is_homed`; an arm without its tool is not homed until the tool is back."""
        return self.tool_present and super().is_homed

    def _require_joints(self, what: str) -> None:
        super()._require_joints(what)
        if not self.tool_present and not self._direct:
            raise Rejected(f"{what}: {self.name} has no tool; arm not ready: send true to 'emulate_tool_present'")

    def _finish_home(self) -> None:
        super()._finish_home()
        self.emit("desired_state", "TOOL_ENGAGED" if self.tool_present else "HOMED")

    def _groups(self) -> tuple[Axes, ...]:
        return (self.joints,) if self._jaw_axes is None else (self.joints, self._jaw_axes)

    def _require_cartesian(self, what: str) -> None:
        super()._require_cartesian(what)
        if self.depth < ENTRY_DEPTH and not self._direct:
            raise Rejected(
                f"{what}: the tool of {self.name} is {1000 * self.depth:.0f} mm below the remote centre; "
                f"insert it to {1000 * LEAST_DEPTH:.0f} mm first"
            )

    def _solve(self, pose: ArrayLike, what: str) -> Array:
        q = super()._solve(pose, what)
        if self._direct:
            return q
        q[INSERTION] = max(q[INSERTION], self.kinematics.insertion_at(LEAST_DEPTH))
        return q

    def _joints_at(self, T: Array) -> tuple[Array, Reason]:
        q = np.empty(self.joints.n)
        return q, self.kinematics.solve(T, self.joints.setpoint[0], q)

    # --- jaw --------------------------------------------------------------------------------

    def _jaw(self, what: str) -> Axes:
        self._require_joints(what)
        if self._jaw_axes is None:
            raise Rejected(f"{what}: {self.name} has no jaw")
        return self._jaw_axes

    def servo_jaw(self, angle: ArrayLike) -> None:
        """See `Jaw.servo_jp`."""
        self._servo(self._jaw("jaw/servo_jp"), "jaw/servo_jp", angle)

    def move_jaw(self, angle: ArrayLike) -> None:
        """See `Jaw.move_jp`."""
        self._move(self._jaw("jaw/move_jp"), "jaw/move_jp", angle)

    def push_jaw(self, effort: ArrayLike) -> None:
        """See `Jaw.servo_jf`."""
        axes = self._jaw("jaw/servo_jf")
        tau = axes.checked(effort, "jaw/servo_jf")
        self._stop_for(axes)
        axes.push(tau)
