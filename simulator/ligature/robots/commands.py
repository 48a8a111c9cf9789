"""The commands of CRTK arms: each knows its verb, its fields, and the method of the arm that it calls.

A verb is the topic's name below the arm's (as in the dVRK). Radians, metres, N, N m; frames as the arm's
methods have them. How many joint values a verb takes depends on the arm, which rejects what does not fit it.
"""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from ligature.model.commands import Command
from ligature.model.frames import quaternion_matrix
from ligature.model.messages import FLAG, INDEX, Numbers, Real, Text, Vector, wire
from ligature.model.scene import ArmKind
from ligature.robots.impedance import CartesianImpedance
from ligature.robots.operating_state import Rejected

if TYPE_CHECKING:
    from ligature.robots.arm import Arm

_WHAT_IS_MISSING = {
    ArmKind.PSM: "is not a PSM: it has neither jaw nor tool",
    ArmKind.ECM: "is not an ECM: it has no endoscope",
    ArmKind.MTM: "is not an MTM",
}

_GAINS = Numbers(12)


@dataclass(frozen=True)
class ArmCommand(Command):
    """One CRTK command to arm number ``arm`` of the scene.

    Of ``streamed`` commands only the newest counts; the others are carried out one after the other, none left out.
    ``kind`` is the only kind of arm that takes the command, None for all.
    """

    verb: ClassVar[str] = ""
    streamed: ClassVar[bool] = False
    kind: ClassVar[ArmKind | None] = None
    _method: ClassVar[str] = ""

    arm: int = wire(INDEX)

    def __init_subclass__(
        cls,
        code: int = -1,
        verb: str = "",
        method: str = "",
        streamed: bool = False,
        kind: ArmKind | None = None,
    ) -> None:
        """Register a verb; ``method`` is the arm's, where its name is not the verb with underscores."""
        super().__init_subclass__(code)
        cls.verb, cls.streamed, cls.kind = verb, streamed, kind
        cls._method = method or verb.replace("/", "_")
        if verb:
            VERBS[verb] = cls

    @property
    def object(self) -> tuple[str, int]:  # noqa: D102
        return "arm", self.arm

    @property
    def slot(self) -> Hashable | None:  # noqa: D102
        return (self.object, self.verb) if self.streamed else None

    @property
    def moves(self) -> bool:
        """Whether the arm answers with ``goal_reached``."""
        return is_move(self.verb)

    def carry_out(self, arm: Arm) -> None:
        """Have ``arm`` do it; raises `Rejected` with the reason when it does not."""
        if self.kind is not None and arm.kind != self.kind.name:
            raise Rejected(f"{arm.name} {_WHAT_IS_MISSING[self.kind]}")
        self._call(arm)

    def _call(self, arm: Any) -> None:
        """Call the arm's method with the fields in their order."""
        getattr(arm, self._method)(*[getattr(self, name) for name, _, _ in self.fields()[1:]])


def is_move(verb: str) -> bool:
    """Whether a verb such as ``jaw/move_jp`` has a goal that ``goal_reached`` reports."""
    return verb.rpartition("/")[2].startswith("move_")


VERBS: dict[str, type[Any]] = {}
"""Every command of arms by its verb."""


@dataclass(frozen=True)
class _Position(ArmCommand):
    position: Vector = wire(Numbers())


@dataclass(frozen=True)
class _Effort(ArmCommand):
    effort: Vector = wire(Numbers())


@dataclass(frozen=True)
class _Pose(ArmCommand):
    """The arm checks the pose, so that it can answer with a warning of its own."""

    pose: Vector = wire(Numbers())


@dataclass(frozen=True)
class _Wrench(ArmCommand):
    wrench: Vector = wire(Numbers())


@dataclass(frozen=True)
class _Flag(ArmCommand):
    flag: bool = wire(FLAG)


@dataclass(frozen=True)
class _Ratio(ArmCommand):
    ratio: float = wire(Real())


# --- state ------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StateCommand(ArmCommand, code=32, verb="state_command"):
    """``enable``, ``disable``, ``pause``, ``unpause``, ``home`` or ``unhome``."""

    command: str = wire(Text())


class Adopt(ArmCommand, code=33, verb="adopt"):
    """Be enabled and homed at once, where the arm stands: for clients that know no states."""


class Hold(ArmCommand, code=34, verb="hold"):
    """Stay at the present set-point."""


class Free(ArmCommand, code=35, verb="free"):
    """Let the joints move freely, with no effort."""


class UseGravityCompensation(_Flag, code=36, verb="use_gravity_compensation"):
    """Whether effort modes carry the arm's own weight."""


class TrajectorySetRatio(_Ratio, code=37, verb="trajectory_j/set_ratio"):
    """Velocities and accelerations of moves as a fraction of the largest."""


class TrajectorySetRatioV(_Ratio, code=38, verb="trajectory_j/set_ratio_v"):
    """Velocities of moves as a fraction of the largest."""


class TrajectorySetRatioA(_Ratio, code=39, verb="trajectory_j/set_ratio_a"):
    """Accelerations of moves as a fraction of the largest."""


@dataclass(frozen=True)
class SetBaseFrame(_Pose, code=40, verb="set_base_frame"):
    """Pose (7,) of the base in the frame called ``reference``."""

    reference: str = wire(Text(), default="")


class BodySetCfOrientationAbsolute(_Flag, code=41, verb="body/set_cf_orientation_absolute"):
    """Whether ``body`` wrenches are in base axes."""


# --- joint space ------------------------------------------------------------------------------


@dataclass(frozen=True)
class ServoJp(_Position, code=48, verb="servo_jp", streamed=True):
    """Follow a stream of joint positions (n,), with their velocities (n,) where they are known."""

    velocity: Vector | None = wire(Numbers(optional=True), default=None)


class ServoJr(_Position, code=49, verb="servo_jr"):
    """Add ``position`` (n,) to the joint set-point."""


@dataclass(frozen=True)
class ServoJv(ArmCommand, code=50, verb="servo_jv", streamed=True):
    """Follow a stream of joint velocities (n,)."""

    velocity: Vector = wire(Numbers())


class ServoJf(_Effort, code=51, verb="servo_jf", streamed=True):
    """Drive the joints with efforts (n,)."""


class MoveJp(_Position, code=52, verb="move_jp"):
    """Move the joints to ``position`` (n,)."""


class MoveJr(_Position, code=53, verb="move_jr"):
    """Move the joints by ``position`` (n,)."""


class PlaceJp(_Position, code=54, verb="place_jp"):
    """Put the joints at ``position`` (n,) at once: for setting up an experiment."""


# --- Cartesian space --------------------------------------------------------------------------


class ServoCp(_Pose, code=64, verb="servo_cp", streamed=True):
    """Follow a stream of tip poses (7,)."""


@dataclass(frozen=True)
class ServoCv(ArmCommand, code=65, verb="servo_cv", streamed=True):
    """Follow a stream of tip twists (6,)."""

    twist: Vector = wire(Numbers())


class SpatialServoCf(_Wrench, code=66, verb="spatial/servo_cf", streamed=True):
    """Push with a wrench (6,) in axes of the reference frame."""


class BodyServoCf(_Wrench, code=67, verb="body/servo_cf", streamed=True):
    """Push with a wrench (6,) in axes of the tip."""


@dataclass(frozen=True)
class ServoCs(ArmCommand, code=68, verb="servo_cs", streamed=True):
    """Follow the given ones of pose (7,), twist (6,) and wrench (6,) (``crtk_msgs/CartesianState``)."""

    pose: Vector | None = wire(Numbers(7, optional=True), default=None)
    twist: Vector | None = wire(Numbers(6, optional=True), default=None)
    wrench: Vector | None = wire(Numbers(6, optional=True), default=None)


@dataclass(frozen=True)
class ServoCi(ArmCommand, code=69, verb="servo_ci", streamed=True):
    """Yield like springs and dampers around a pose (``crtk_msgs/CartesianImpedance``).

    ``force_orientation`` and ``torque_orientation`` are quaternions, zeros for none. The four gains (12,) are
    stiffness, damping, bias and dead band, each along x, y and z.
    """

    force_position: Vector = wire(Numbers(3))
    force_orientation: Vector = wire(Numbers(4))
    torque_orientation: Vector = wire(Numbers(4))
    position_positive: Vector = wire(_GAINS)
    position_negative: Vector = wire(_GAINS)
    orientation_positive: Vector = wire(_GAINS)
    orientation_negative: Vector = wire(_GAINS)

    def _call(self, arm: Any) -> None:
        sides = (
            self.position_positive, self.position_negative, self.orientation_positive, self.orientation_negative,
        )  # fmt: skip
        R_force, R_torque = _rotation(self.force_orientation), _rotation(self.torque_orientation)
        gains = np.array(sides).reshape(4, 4, 3)
        arm.servo_ci(CartesianImpedance(np.array(self.force_position), R_force, R_torque, gains))


class MoveCp(_Pose, code=70, verb="move_cp"):
    """Move to a tip pose (7,)."""


class ServoCr(_Pose, code=71, verb="servo_cr"):
    """Move and turn the set-point of the tip by a pose (7,)."""


# --- for clients that know no states ------------------------------------------------------------


class _Direct(ArmCommand):
    """The same as the verb without ``direct/``, in any state of the arm; see `ligature.robots.arm.Arm.direct`."""

    def _call(self, arm: Any) -> None:
        arm.direct(self._method, *[getattr(self, name) for name, _, _ in self.fields()[1:]])


class DirectServoJp(_Direct, _Position, code=128, verb="direct/servo_jp", method="servo_jp", streamed=True):
    """Follow a stream of joint positions (n,)."""


class DirectMoveJp(_Direct, _Position, code=129, verb="direct/move_jp", method="move_jp"):
    """Move the joints to ``position`` (n,)."""


@dataclass(frozen=True)
class DirectServoJv(_Direct, code=130, verb="direct/servo_jv", method="servo_jv", streamed=True):
    """Follow a stream of joint velocities (n,)."""

    velocity: Vector = wire(Numbers())


class DirectServoCp(_Direct, _Pose, code=131, verb="direct/servo_cp", method="servo_cp", streamed=True):
    """Follow a stream of tip poses (7,) in the base."""


class DirectMoveCp(_Direct, _Pose, code=132, verb="direct/move_cp", method="move_cp"):
    """Move to a tip pose (7,) in the base."""


class DirectServoCr(_Direct, _Pose, code=133, verb="direct/servo_cr", method="servo_cr"):
    """Move and turn the set-point of the tip by a pose (7,) in axes of the base."""


class DirectJawServoJp(
    _Direct, _Position, code=134, verb="direct/jaw/servo_jp", method="servo_jaw", streamed=True, kind=ArmKind.PSM
):
    """Follow a stream of openings (1,)."""


def _rotation(quaternion: Vector) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Rotation (3, 3) of a quaternion (4,); one of zeros is none."""
    q = np.array(quaternion)
    length = float(np.linalg.norm(q))
    return np.eye(3) if length < 0.1 else quaternion_matrix(q / length)


# --- PSM --------------------------------------------------------------------------------------


class JawServoJp(_Position, code=80, verb="jaw/servo_jp", method="servo_jaw", streamed=True, kind=ArmKind.PSM):
    """Follow a stream of openings (1,)."""


class JawServoJf(_Effort, code=81, verb="jaw/servo_jf", method="push_jaw", streamed=True, kind=ArmKind.PSM):
    """Open or close the jaw with an effort (1,)."""


class JawMoveJp(_Position, code=82, verb="jaw/move_jp", method="move_jaw", kind=ArmKind.PSM):
    """Move the jaw to an opening (1,)."""


@dataclass(frozen=True)
class SetToolType(ArmCommand, code=83, verb="set_tool_type", kind=ArmKind.PSM):
    """Change the instrument to ``tool``."""

    tool: str = wire(Text())


class ToolTypeRequest(ArmCommand, code=84, verb="tool_type_request", kind=ArmKind.PSM):
    """Emit the instrument's name."""

    def _call(self, arm: Any) -> None:
        arm.emit("tool_type", arm.tool_type)


class EmulateAdapterPresent(_Flag, code=85, verb="emulate_adapter_present", kind=ArmKind.PSM):
    """Accepted, as a console does; the simulated arm has no adapter."""

    def _call(self, arm: Any) -> None:
        pass


class EmulateToolPresent(_Flag, code=86, verb="emulate_tool_present", kind=ArmKind.PSM):
    """Pretend that the instrument was put on or taken off."""


# --- ECM, MTM ---------------------------------------------------------------------------------


@dataclass(frozen=True)
class SetEndoscopeType(ArmCommand, code=96, verb="set_endoscope_type", kind=ArmKind.ECM):
    """Change the endoscope."""

    endoscope: str = wire(Text())


@dataclass(frozen=True)
class LockOrientation(ArmCommand, code=112, verb="lock_orientation", kind=ArmKind.MTM):
    """Keep an orientation, a quaternion (4,), while the arm yields to efforts."""

    quaternion: Vector = wire(Numbers())


class UnlockOrientation(ArmCommand, code=113, verb="unlock_orientation", kind=ArmKind.MTM):
    """Let the orientation move freely again."""


class GripperServoJp(_Position, code=114, verb="gripper/servo_jp", kind=ArmKind.MTM):
    """Press or open the gripper (1,), as an operator's fingers do."""
