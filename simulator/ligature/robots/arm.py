"""A CRTK arm: servo and moves in joint and Cartesian space, free of any transport.

Names are those of CRTK. ``local`` poses are in the arm's base frame; `measured_cp` and
`servo_cp` have the base frame applied that `set_base_frame` set. Poses are accepted as x y z qx qy qz qw (7,) or as
matrices (4, 4) and returned as (7,). Twists and wrenches (6,) are linear then angular. Radians, metres, seconds of
simulated time. A command that is not carried out raises `Rejected` and changes nothing.
"""

from __future__ import annotations

import reprlib
from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.robots.axes import Axes, Mode
from ligature.robots.device import Device
from ligature.robots.impedance import CartesianImpedance
from ligature.robots.inverse import REASONS, InverseResult, Reason
from ligature.robots.operating_state import Rejected, State, towards_enabled
from ligature.robots.poses import numbers_of, pose_matrix_of, turned

Array = NDArray[np.float64]

CHALLENGE = "CRTK"
"""Where the suturing challenge's node has its topics, which `Arm.direct` serves; warnings name them."""

NO_COMMON_RATIO = 0.0
"""What ``trajectory_j/ratio`` reports while velocities and accelerations have ratios of their own (as in the dVRK)."""

MOST_REFERENCE = 64
"""Bytes of the name of a reference frame: what the state has room for."""

FARTHEST_BASE = 1e6
"""Metres along an axis between the base and the origin of its reference frame; a tip then has 0.1 nm."""

PULL_BACK = 1e-2
"""Damping of the inverse that turns twists into joint velocities: bounded near singular poses."""


def damped_inverse(jacobian: Array, twist: Array) -> Array:
    """Joint velocities (n,) whose twist (m,) by ``jacobian`` (m, n) comes closest, bounded near singular poses."""
    damped = jacobian @ jacobian.T + PULL_BACK**2 * np.eye(len(twist))
    velocity: Array = jacobian.T @ np.linalg.solve(damped, twist)
    return velocity


class NoWrench:
    """The wrench on a tip that nothing touches.

    Attributes
    ----------
    group
        No bit of what bodies feel.
    """

    group = 0

    def __call__(self) -> Array:
        """Zeros (6,)."""
        return np.zeros(6)


NO_WRENCH = NoWrench()

WITH_JOINTS = (Reason.REACHED, Reason.OUTSIDE_LIMITS)
"""Codes of poses for which there are joint values; beyond limits these are clipped."""


class JointState(NamedTuple):
    """Positions, velocities and efforts, each (n,)."""

    position: Array
    velocity: Array
    effort: Array


class Kinematics(Protocol):
    """What an arm asks of its kinematic chain: see `ligature.robots.chain.Chain`."""

    joint_names: tuple[str, ...]
    lower: Array
    upper: Array

    def forward(self, q: ArrayLike) -> Array:
        """Pose T_base_tip."""

    def inverse(self, T_base_tip: ArrayLike, seed: ArrayLike | None = None) -> InverseResult:
        """Joint values of a pose."""

    def jacobian_body(self, q: ArrayLike) -> Array:
        """Body Jacobian (6, n)."""

    def jacobian_spatial(self, q: ArrayLike) -> Array:
        """Spatial Jacobian (6, n)."""

    def tables(self) -> tuple[Array, bool, Array]:
        """Table of the chain, whether it is Craig's, and the tip (4, 4)."""

    def describe(
        self, base: Array, absolute: bool, measured: Array, setpoint: Array, wrench: Array,
        js: Array, poses: Array, vectors: Array, jacobians: Array,
    ) -> None:  # fmt: skip
        """Fill in what the arm reports of its tip."""


class Arm(Device):
    """What PSM, ECM and MTM have in common.

    Parameters
    ----------
    kinematics
        Of the arm; the others as for `Device`.
    """

    kind: ClassVar[str]
    """PSM, ECM or MTM."""

    def __init__(self, name: str, kinematics: Kinematics, axes: Axes, home: Array, following_bound: ArrayLike) -> None:
        super().__init__(name, axes, home, following_bound)
        self.kinematics = kinematics
        self.reference = ""
        self.gravity_compensation = False
        self.cf_orientation_absolute = False
        self._T_reference_base = np.eye(4)
        self._inverted = self._T_reference_base, np.eye(4)
        self._pushing: tuple[str, Any] | None = None
        self._direct = False
        self._tip_wrench: Callable[[], Array] | None = None

    _KEPT = (
        *Device._KEPT, "reference", "gravity_compensation", "cf_orientation_absolute", "_T_reference_base", "_pushing",
    )  # fmt: skip

    _OUTLINE = (
        "_state", "_homed", "_busy", "joints.mode", "joints.ratio_v", "joints.ratio_a", "reference",
        "_T_reference_base", "kinematics", "cf_orientation_absolute", "_tip_wrench",
    )  # fmt: skip

    def outline(self) -> tuple[str, ...]:
        """Names of what commands alone change of what the arm reports; whatever changes is another object then."""
        return self._OUTLINE

    @property
    def tip_wrench(self) -> Callable[[], Array] | None:
        """What measures the wrench on the tip, see `set_tip_wrench`; None where it follows from the drives."""
        return NO_WRENCH if self._tip_wrench is None and self.joints.mode is Mode.OFF else self._tip_wrench

    def _hold_all(self) -> None:
        self._pushing = None
        super()._hold_all()

    def _off_all(self) -> None:
        self._pushing = None
        super()._off_all()

    @property
    def is_idle(self) -> bool:
        """See `Device.is_idle`; an arm that pushes is not."""
        return self._pushing is None and super().is_idle

    def _advance(self, dt: float) -> None:
        super()._advance(dt)
        if self._pushing is not None:
            self._exert()

    # --- readiness --------------------------------------------------------------------------

    def direct(self, method: str, *values: Any) -> None:
        """Carry out a motion for a client that knows no states, as the suturing challenge's node does.

        The arm is enabled where it stands and need not be homed; the tip may begin anywhere and keeps no depth, poses
        are in the base. Joints are clipped to their limits all the same.

        Raises `Rejected` when the arm rejects the motion, and for a ``method`` that is none of its commands.
        """
        known = isinstance(method, str) and not method.startswith("_")
        if not (known and callable(getattr(type(self), method, None))):
            raise Rejected(f"direct takes the name of a command, such as 'servo_cp', not {reprlib.repr(method)}")
        self.take_over()
        self._direct = True
        try:
            getattr(self, method)(*values)
        except Rejected as error:
            raise Rejected(f"{CHALLENGE}/{self.name.lower()}/{error}") from error
        finally:
            self._direct = False

    def _require_joints(self, what: str) -> None:
        self._check_running()
        if self._direct:
            return
        if self._state is not State.ENABLED:
            raise Rejected(f"{what}: {self.name} is {self._state.name}; arm not ready: {towards_enabled(self._state)}")
        if not self._homed:
            raise Rejected(f"{what}: {self.name} is not homed; arm not ready: send 'home'")

    def _require_cartesian(self, what: str) -> None:
        self._require_joints(what)

    def _stop_for(self, axes: Axes) -> None:
        """End a move that a streamed command replaces."""
        if axes.moving:
            self.emit("goal_reached", False)
            axes.hold()
            if not any(other.moving for other in self._groups()):
                self._busy = False
                self._emit_state()
        if axes is self.joints:
            self._pushing = None

    # --- joint space ------------------------------------------------------------------------

    def measured_js(self) -> JointState:
        """Joint state now, by the sensors."""
        return JointState(*self.joints.measured().copy())

    def setpoint_js(self) -> JointState:
        """Joint state that is asked for."""
        return JointState(*self.joints.setpoint.copy())

    def servo_jp(self, position: ArrayLike, velocity: ArrayLike | None = None) -> None:
        """Follow a stream of joint positions (n,), clipped to the limits."""
        self._servo(self.joints, "servo_jp", position, velocity)

    def _servo(self, axes: Axes, what: str, position: ArrayLike, velocity: ArrayLike | None = None) -> None:
        self._require_joints(what)
        goal = axes.checked(position, what)
        speed = None if velocity is None else axes.checked(velocity, f"{what} velocity")
        self._stop_for(axes)
        axes.servo(goal, speed)

    def servo_jr(self, step: ArrayLike) -> None:
        """Add to the joint set-point."""
        self._require_joints("servo_jr")
        self.servo_jp(self.joints.setpoint[0] + self.joints.checked(step, "servo_jr"))

    def servo_jv(self, velocity: ArrayLike) -> None:
        """Follow a stream of joint velocities (n,); the arm stops when the stream does."""
        self._require_joints("servo_jv")
        speed = self.joints.checked(velocity, "servo_jv")
        self._stop_for(self.joints)
        self.joints.stream_velocity(np.clip(speed, -self.joints.max_velocity, self.joints.max_velocity))

    def servo_jf(self, effort: ArrayLike) -> None:
        """Drive the joints with efforts (n,)."""
        self._require_joints("servo_jf")
        tau = self.joints.checked(effort, "servo_jf")
        self._stop_for(self.joints)
        self.joints.push(tau)

    def move_jp(self, goal: ArrayLike) -> None:
        """Move the joints to ``goal`` (n,), clipped to the limits."""
        self._move(self.joints, "move_jp", goal)

    def _move(self, axes: Axes, what: str, goal: ArrayLike) -> None:
        self._require_joints(what)
        self._start_move(axes, axes.checked(goal, what))

    def _start_move(self, axes: Axes, goal: Array) -> None:
        moving = axes.moving
        axes.move(goal)
        if moving:
            self.emit("goal_reached", False)
        if axes is self.joints:
            self._pushing = None
        self._begin_busy()

    def move_jr(self, step: ArrayLike) -> None:
        """Move the joints by ``step`` (n,) from the goal of the running move, or from the set-point."""
        self._require_joints("move_jr")
        self.move_jp(self.joints.goal + self.joints.checked(step, "move_jr"))

    def hold(self) -> None:
        """Stay at the present set-point."""
        self._require_joints("hold")
        self._stop_moves()
        self._hold_all()
        self._emit_state()

    def free(self) -> None:
        """Let the joints move freely, with no effort."""
        self._require_joints("free")
        self._stop_moves()
        self._pushing = None
        self.joints.push(np.zeros(self.joints.n))
        self._emit_state()

    def place_jp(self, position: ArrayLike) -> None:
        """Put the joints somewhere at once: for setting up an experiment, not a thing a real arm can do."""
        self._check_running()
        self.joints.place(self.joints.checked(position, "place_jp"))

    # --- Cartesian space --------------------------------------------------------------------

    def measured_cp(self) -> Array:
        """Pose (7,) of the tip in the reference frame of the base frame, or in the base."""
        return matrix_pose7(self._T_reference_base @ self.kinematics.forward(self.joints.measured()[0]))

    def setpoint_cp(self) -> Array:
        """Pose (7,) that is asked for."""
        return matrix_pose7(self._T_reference_base @ self.kinematics.forward(self.joints.setpoint[0]))

    def local_measured_cp(self) -> Array:
        """Pose (7,) of the tip in the base."""
        return matrix_pose7(self.kinematics.forward(self.joints.measured()[0]))

    def local_setpoint_cp(self) -> Array:
        """Pose (7,) that is asked for, in the base."""
        return matrix_pose7(self.kinematics.forward(self.joints.setpoint[0]))

    def local_measured_cv(self) -> Array:
        """Twist (6,) of the tip in base axes."""
        q, qd, _ = self.joints.measured()
        return turned(self.kinematics.forward(q)[:3, :3], self.kinematics.jacobian_body(q) @ qd)

    def measured_cv(self) -> Array:
        """Twist (6,) of the tip in axes of the reference frame."""
        return turned(self._T_reference_base[:3, :3], self.local_measured_cv())

    def body_jacobian(self) -> Array:
        """Body Jacobian (6, n) at the measured joints."""
        return self.kinematics.jacobian_body(self.joints.measured()[0])

    def spatial_jacobian(self) -> Array:
        """Spatial Jacobian (6, n) at the measured joints."""
        return self.kinematics.jacobian_spatial(self.joints.measured()[0])

    def spatial_measured_cf(self) -> Array:
        """Wrench (6,) that the world exerts on the tip, in base axes about the tip; RuntimeError after `end`."""
        self._check_running()
        if self._tip_wrench is not None:
            return self._tip_wrench()
        q, _, effort = self.joints.measured()
        if not effort.any():
            return np.zeros(6)
        jacobian = self.kinematics.jacobian_body(q)
        pushed: Array = np.linalg.lstsq(jacobian.T, -effort, rcond=1e-6)[0]
        return turned(self.kinematics.forward(q)[:3, :3], pushed)

    def body_measured_cf(self) -> Array:
        """The same in axes of the tip; in base axes after `body_set_cf_orientation_absolute`."""
        wrench = self.spatial_measured_cf()
        if self.cf_orientation_absolute:
            return wrench
        return turned(self.kinematics.forward(self.joints.measured()[0])[:3, :3].T, wrench)

    def set_tip_wrench(self, source: Callable[[], Array]) -> None:
        """Take the wrench on the tip (6,), in base axes about the tip, from ``source``."""
        self._tip_wrench = source

    def servo_cp(self, pose: ArrayLike) -> None:
        """Follow a stream of tip poses."""
        self._require_cartesian("servo_cp")
        q = self._solve(pose, "servo_cp")
        self._stop_for(self.joints)
        self.joints.servo(q)

    def move_cp(self, pose: ArrayLike) -> None:
        """Move to a tip pose, on the joint trajectory that ends there."""
        self._require_cartesian("move_cp")
        self._start_move(self.joints, self._solve(pose, "move_cp"))

    def servo_cr(self, step: ArrayLike) -> None:
        """Add to the set-point of the tip: ``step`` moves and turns it in axes of `setpoint_cp`."""
        self._require_cartesian("servo_cr")
        T = pose7_matrix(self.local_setpoint_cp() if self._direct else self.setpoint_cp())
        change = pose_matrix_of(step, "servo_cr")
        T[:3, :3] = change[:3, :3] @ T[:3, :3]
        T[:3, 3] += change[:3, 3]
        q = self._solve(T, "servo_cr")
        self._stop_for(self.joints)
        self.joints.servo(q)

    def _solve(self, pose: ArrayLike, what: str) -> Array:
        """Joint values of a pose in the reference frame; beyond joint limits they are clipped, as the drives do."""
        T = pose_matrix_of(pose, what)
        if not self._direct:
            T = self._base_from_reference @ T
        q, code = self._joints_at(T)
        if code not in WITH_JOINTS:
            raise Rejected(
                f"{what}: no inverse kinematics of {self.name} at {T[:3, 3].round(4).tolist()}: {REASONS[code]}"
            )
        return self.joints.clipped(q)

    def _joints_at(self, T: Array) -> tuple[Array, Reason]:
        """Joint values (n,) of a pose (4, 4) in the base, and the code of `InverseResult`."""
        result = self.kinematics.inverse(T, self.joints.setpoint[0])
        return result.q, Reason(int(result.code))

    def servo_cv(self, twist: ArrayLike) -> None:
        """Follow a stream of tip twists (6,) in axes of the reference frame; the arm stops when the stream does."""
        self._require_cartesian("servo_cv")
        wanted = turned(self._T_reference_base[:3, :3].T, self._six(twist, "servo_cv"))
        q = self.joints.setpoint[0]
        speed = self._joint_velocity(q, turned(self.kinematics.forward(q)[:3, :3].T, wanted))
        self._stop_for(self.joints)
        excess = float(np.max(np.abs(speed) / self.joints.max_velocity))
        self.joints.stream_velocity(speed / max(excess, 1.0))

    def _joint_velocity(self, q: Array, twist: Array) -> Array:
        """Joint velocities (n,) that give the tip a ``twist`` (6,) in its axes."""
        return damped_inverse(self.kinematics.jacobian_body(q), twist)

    def spatial_servo_cf(self, wrench: ArrayLike) -> None:
        """Push with a wrench (6,) in axes of the reference frame, at the tip."""
        pushed = turned(self._T_reference_base[:3, :3].T, self._six(wrench, "servo_cf"))
        self._push_with("spatial/servo_cf", pushed)

    def body_servo_cf(self, wrench: ArrayLike) -> None:
        """Push with a wrench (6,) in axes of the tip, or absolute after `body_set_cf_orientation_absolute`."""
        if self.cf_orientation_absolute:
            self.spatial_servo_cf(wrench)
            return
        self._push_with("body/servo_cf", self._six(wrench, "servo_cf"))

    def servo_ci(self, stiffness: CartesianImpedance) -> None:
        """Yield like springs and dampers around a pose; see `CartesianImpedance`."""
        if not isinstance(stiffness, CartesianImpedance):
            raise Rejected(f"servo_ci takes a CartesianImpedance, not {reprlib.repr(stiffness)}")
        self._push_with("servo_ci", stiffness)

    def servo_cs(self, pose: ArrayLike | None, twist: ArrayLike | None, wrench: ArrayLike | None) -> None:
        """Follow whichever of pose, twist and wrench is given; none of them is a wrench of zero."""
        try:
            if pose is not None:
                self.servo_cp(pose)
            elif twist is not None:
                self.servo_cv(twist)
            else:
                self.body_servo_cf(np.zeros(6) if wrench is None else wrench)
        except Rejected as error:  # names what the client sent, too
            raise Rejected(f"servo_cs: {error}") from error

    def _push_with(self, what: str, push: Any) -> None:
        """Apply the joint efforts of the command ``what``, computed anew each tick."""
        self._require_cartesian(what)
        self._stop_for(self.joints)
        self._pushing = what, push
        self._exert()

    def _exert(self) -> None:
        """Apply the joint efforts of the commanded wrench, at the measured joints."""
        assert self._pushing is not None
        q = self.joints.measured()[0]
        self.joints.push(
            self.kinematics.jacobian_body(q).T @ self._wrench_on_tip(self.kinematics.forward(q), *self._pushing)
        )

    def _wrench_on_tip(self, T: Array, what: str, push: Any) -> Array:
        """The wrench (6,) in axes of the tip at ``T`` (4, 4) that ``push`` means."""
        if what == "servo_ci":
            push = push.wrench(inverse(self._T_reference_base), T, self.local_measured_cv())
        return np.array(push) if what == "body/servo_cf" else turned(T[:3, :3].T, push)

    @staticmethod
    def _six(values: ArrayLike, what: str) -> Array:
        numbers = numbers_of(values, what).reshape(-1)
        if len(numbers) != 6 or not np.isfinite(numbers).all():
            raise Rejected(f"{what} takes 6 finite numbers, not {numbers.tolist()}")
        return numbers

    def set_base_frame(self, pose: ArrayLike, reference: str) -> None:
        """Set the pose of the base in a reference frame; `measured_cp` and `servo_cp` are in that frame then.

        Raises `Rejected` for a name that is no text or too long, and for a pose farther away than `FARTHEST_BASE`.
        """
        if not isinstance(reference, str):
            raise Rejected(f"set_base_frame takes the name of a frame, not {reprlib.repr(reference)}")
        size = len(reference.encode("utf-8"))
        if size > MOST_REFERENCE:  # cut off, it would be the name of another frame
            raise Rejected(f"set_base_frame: the name of the frame may have {MOST_REFERENCE} bytes, not {size}")
        T = pose_matrix_of(pose, "set_base_frame")
        if np.abs(T[:3, 3]).max() > FARTHEST_BASE:  # the position of the tip would have no digits left
            raise Rejected(f"set_base_frame: the base must stay within {FARTHEST_BASE:g} m, not {T[:3, 3].tolist()}")
        self._T_reference_base = T
        self.reference = reference
        self.emit("base_frame", reference)

    @property
    def _base_from_reference(self) -> Array:
        """Pose (4, 4) of the reference frame in the base; kept, for it is asked for with every pose."""
        of, found = self._inverted
        if of is not self._T_reference_base:
            found = inverse(self._T_reference_base)
            self._inverted = self._T_reference_base, found
        return found

    @property
    def base_frame(self) -> Array:
        """Pose (4, 4) of the base in the reference frame."""
        return self._T_reference_base

    def use_gravity_compensation(self, flag: bool) -> None:
        """Whether effort modes carry the arm's own weight; arms without weight, all but masters, need none."""
        self.gravity_compensation = bool(flag)

    def body_set_cf_orientation_absolute(self, flag: bool) -> None:
        """Whether ``body`` wrenches are in base axes."""
        self.cf_orientation_absolute = bool(flag)

    def forward_kinematics(self, jp: ArrayLike, local: bool = False) -> Array:
        """Pose (7,) of the tip for joint values; missing ones at the end are zero.

        Raises `Rejected` for too many values, and for what is no finite number.
        """
        values = numbers_of(jp, "forward_kinematics").reshape(-1)
        if not np.isfinite(values).all():
            raise Rejected(f"forward_kinematics takes finite numbers, not {values.tolist()}")
        n = self.joints.n
        if len(values) > n:
            raise Rejected(f"too many joints: {self.name} has {n}, not {len(values)}")
        T = self.kinematics.forward(np.concatenate([values, np.zeros(n - len(values))]))
        return matrix_pose7(T if local else self._T_reference_base @ T)

    def inverse_kinematics(self, seed: ArrayLike, cp: ArrayLike) -> Array:
        """Joint values of a local pose, closest to ``seed`` (n,).

        Raises `Rejected` for a seed of the wrong length, and where there is no solution.
        """
        values = numbers_of(seed, "inverse_kinematics").reshape(-1)
        if len(values) != self.joints.n:
            raise Rejected(f"incorrect number of joints: {self.name} has {self.joints.n}, not {len(values)}")
        result = self.kinematics.inverse(pose_matrix_of(cp, "inverse_kinematics"), values)
        if not result.ok:
            raise Rejected(f"inverse kinematics failed: {result.explain(self.kinematics.joint_names)}")
        return result.q

    # --- trajectories -----------------------------------------------------------------------

    def trajectory_j_set_ratio(self, ratio: float) -> None:
        """Velocities and accelerations of moves as a fraction of the largest."""
        ratio = self._ratio(ratio)
        self._set_ratio(ratio, ratio)

    def trajectory_j_set_ratio_v(self, ratio: float) -> None:
        """Velocities of moves as a fraction of the largest."""
        self._set_ratio(self._ratio(ratio), None)

    def trajectory_j_set_ratio_a(self, ratio: float) -> None:
        """Accelerations of moves as a fraction of the largest."""
        self._set_ratio(None, self._ratio(ratio))

    @staticmethod
    def _ratio(ratio: float) -> float:
        numbers = numbers_of(ratio, "trajectory_j/set_ratio").reshape(-1)
        if len(numbers) != 1 or not 0.0 < numbers[0] <= 1.0:
            raise Rejected(f"a ratio must be above 0 and at most 1, not {reprlib.repr(ratio)}")
        return float(numbers[0])

    def _set_ratio(self, v: float | None, a: float | None) -> None:
        for axes in self._groups():
            axes.ratio_v, axes.ratio_a = v or axes.ratio_v, a or axes.ratio_a
        if v is not None:
            self.emit("trajectory_j/ratio_v", v)
        if a is not None:
            self.emit("trajectory_j/ratio_a", a)
        both = self.joints.ratio_v, self.joints.ratio_a
        self.emit("trajectory_j/ratio", both[0] if both[0] == both[1] else NO_COMMON_RATIO)
