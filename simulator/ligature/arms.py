"""The arms of a scene, bound to its physics: which joints they drive, and how long their links are.

World axes, metres, radians.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.frames import matrix_pose7, pose7_matrix
from ligature.model.scene import ArmDescription, ArmKind, Scene
from ligature.model.state import StateRecord
from ligature.model.subsystem import Subsystem
from ligature.physics import World
from ligature.robots import ecm_arm, mtm_arm, psm_arm
from ligature.robots.arm import Arm
from ligature.robots.axes import Axes
from ligature.robots.commands import ArmCommand
from ligature.robots.ecm import Ecm
from ligature.robots.ecm_arm import EcmArm
from ligature.robots.fitting import (
    T_TIP_CAMERA,
    camera_arm_base,
    console_pose,
    master_side,
    psm_kinematics,
)
from ligature.robots.instruments import Instrument
from ligature.robots.mtm import Mtm
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.operating_state import Refused
from ligature.robots.plant import IdealPlant
from ligature.robots.psm_arm import PsmArm
from ligature.robots.record import ArmRecord

Array = NDArray[np.float64]

JAW_STIFFNESS = 1.0
"""N·m per radian of following error with which each finger presses: 18 N at the tips of a needle driver at −20°."""

WATCH_PERIOD = 5
"""Ticks between two looks at following errors."""


class ArmSet(Subsystem, Mapping[str, Arm]):
    """The arms of a running scene by name."""

    def __init__(self, scene: Scene, world: World, dt: float = 1e-3) -> None:
        self._world, self._dt = world, dt
        self.problems: list[Diagnostic] = []
        self._arms: list[Arm] = []
        for description in scene.arms:
            self._arms.append(_BUILDERS[description.kind](scene, world, description, self.problems))
        self._by_name = {arm.name: arm for arm in self._arms}
        self._records = [ArmRecord(arm) for arm in self._arms]

    def __getitem__(self, name: str) -> Arm:
        if name not in self._by_name:
            known = ", ".join(self._by_name) or "none"
            raise KeyError(f"no arm is called '{name}'; there are {known}")
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._arms)

    def apply(self, command: ArmCommand) -> None:
        """Carry out a command; what the arm refuses becomes its warning, whatever else it raises its FAULT."""
        arm = self._arms[command.arm]
        try:
            command.carry_out(arm)
        except Refused as error:
            arm.emit("warning", str(error))
            if command.moves:
                arm.emit("goal_reached", False)
        except Exception as error:  # no command ends a run
            arm.fault(f"{command.verb} failed: {_words(error)}")

    def _guarded(self, what: str, arm: Arm, act: Callable[..., None], *arguments: Any) -> None:
        """Have an arm do something; whatever it raises becomes its FAULT, and the other arms go on."""
        try:
            act(*arguments)
        except Exception as error:
            arm.fault(f"{what} failed: {_words(error)}")

    def release(self, index: int) -> None:
        """Whoever commanded an arm is gone: it stays where it is."""
        arm = self._arms[index]
        if arm.is_enabled and arm.is_homed:
            self._guarded("hold", arm, arm.hold)

    def step(self, tick: int) -> None:
        """Advance all arms by a tick."""
        for arm in self._arms:
            self._guarded("the motion", arm, arm.tick, self._dt)
        if (tick + 1) % WATCH_PERIOD == 0:
            for arm in self._arms:
                self._guarded("the watch over following errors", arm, arm.watch, WATCH_PERIOD * self._dt)

    def write_state(self, state: StateRecord) -> None:
        """Write the state of all arms."""
        for arm, arm_record, record in zip(self._arms, self._records, state["arm"][0], strict=True):
            self._guarded("the reading", arm, arm_record.write, record)

    def take_problems(self) -> list[Diagnostic]:
        """What was found since the last call."""
        found, self.problems = self.problems, []
        return found

    def events(self) -> list[tuple[int, str, Any]]:
        """What happened since the last call: number of the arm, name and value."""
        found = []
        for index, arm in enumerate(self._arms):
            found += [(index, event.name, event.value) for event in arm.events]
            arm.events.clear()
        return found

    def reset(self) -> None:
        """The scene was put back to its start: moves end, and arms hold where they are now."""
        for arm in self._arms:
            self._guarded("the reset", arm, arm.settle)

    def snapshot(self) -> list[dict[str, Any]]:
        """Everything that lasts from tick to tick."""
        return [arm.snapshot() for arm in self._arms]

    def restore(self, snapshot: Sequence[dict[str, Any]]) -> None:
        """Continue from `snapshot`."""
        for arm, state in zip(self._arms, snapshot, strict=True):
            arm.restore(state)
        self._records = [ArmRecord(arm) for arm in self._arms]


def _words(error: Exception) -> str:
    """What an exception states, and of which kind it is unless the arm itself raised it."""
    return str(error) if isinstance(error, Refused) else f"{type(error).__name__}: {error}"


# --- building -------------------------------------------------------------------------------


def _psm(scene: Scene, world: World, description: ArmDescription, problems: list[Diagnostic]) -> Arm:
    kinematics, problem = psm_kinematics(scene, description)
    if problem:
        mark = scene.bodies[description.base].identity.mark
        problems.append(Diagnostic(Severity.WARNING, f"{description.name}: {problem}", mark, code="arm"))
    joints = Axes(
        kinematics.joint_names, _travel(scene, description.joints), psm_arm.MAX_VELOCITY, psm_arm.MAX_ACCELERATION,
        world.drive(description.joints, psm_arm.SERVO_MAX_VELOCITY, psm_arm.SERVO_MAX_DECELERATION),
    )  # fmt: skip
    arm = PsmArm(description.name, kinematics, joints, _jaw(world, description, kinematics.instrument))
    parts = [scene.joints[joint].child for joint in description.joints[-1:]]
    parts += [scene.joints[joint].child for joint in description.jaw]
    arm.set_tip_wrench(_TipWrench(world, description, parts, arm))
    return arm


def _travel(scene: Scene, joints: Sequence[int]) -> Array:
    """Ends of travel (2, n) of the joints of a scene."""
    low = [scene.joints[j].low for j in joints]
    high = [scene.joints[j].high for j in joints]
    return np.array([[-np.inf if v is None else v for v in low], [np.inf if v is None else v for v in high]])


def _jaw(world: World, description: ArmDescription, tool: Instrument) -> Axes | None:
    if len(description.jaw) != 2:
        return None
    plant = JawPlant(world, description.jaw)
    limits = np.array(tool.jaw, dtype=float).reshape(2, 1)
    return Axes(("jaw",), limits, [psm_arm.JAW_MAX_VELOCITY], [psm_arm.JAW_MAX_ACCELERATION], plant)


class JawPlant:
    """Two fingers as one jaw: the opening is shared by both, a jaw's effort acts on each (virtual work)."""

    def __init__(self, world: World, fingers: Sequence[int]) -> None:
        self._drive = world.drive(
            fingers,
            np.full(2, psm_arm.SERVO_MAX_VELOCITY[-1]),
            np.full(2, psm_arm.SERVO_MAX_DECELERATION[-1]),
            JAW_STIFFNESS,
        )

    def read(self) -> Array:
        """Opening, its speed, and effort (3, 1)."""
        (q1, q2), (qd1, qd2), (tau1, tau2) = self._drive.read().tolist()
        return np.array([[q1 + q2], [qd1 + qd2], [0.5 * (tau1 + tau2)]])

    def servo(self, position: Array, velocity: Array) -> None:
        """Open to ``position`` (1,); below zero the fingers press."""
        self._drive.servo(np.repeat(position / 2.0, 2), np.repeat(velocity / 2.0, 2))

    def push(self, effort: Array) -> None:
        """Turn each finger with ``effort`` (1,)."""
        self._drive.push(np.repeat(effort, 2))

    def free(self) -> None:
        """Let the fingers go limp."""
        self._drive.free()

    def place(self, position: Array) -> None:
        """Put the fingers at an opening at once."""
        self._drive.place(np.repeat(np.maximum(position, 0.0) / 2.0, 2))

    def reset(self) -> None:
        """Nothing: the fingers belong to the physics."""

    def snapshot(self) -> None:
        """Nothing: it is part of the physics."""

    def restore(self, snapshot: None) -> None:
        """Nothing."""


class _TipWrench:
    """What the world exerts on the instrument, in base axes about the tip."""

    def __init__(self, world: World, description: ArmDescription, bodies: Sequence[int], arm: Arm) -> None:
        self._world, self._base, self._bodies, self._arm = world, description.base, tuple(bodies), arm

    def __call__(self) -> Array:
        if not self._world.touched(self._bodies):
            return np.zeros(6)
        T_world_base = pose7_matrix(self._world.pose7(self._base))
        tip = T_world_base @ self._arm.kinematics.forward(self._arm.joints.measured()[0])
        wrench = self._world.contact_wrench(self._bodies, tip[:3, 3])
        R = T_world_base[:3, :3].T
        return np.concatenate([R @ wrench[:3], R @ wrench[3:]])


def _ecm(scene: Scene, world: World, description: ArmDescription, problems: list[Diagnostic]) -> Arm:
    kinematics = Ecm()
    limits = np.array([kinematics.lower, kinematics.upper])
    if description.joints:
        travel = _travel(scene, description.joints)
        limits = np.array([np.maximum(limits[0], travel[0]), np.minimum(limits[1], travel[1])])
        plant: Any = world.drive(description.joints, ecm_arm.SERVO_MAX_VELOCITY, ecm_arm.SERVO_MAX_DECELERATION)
    else:
        plant = CameraPlant(scene, world, description.tip, kinematics, ecm_arm.HOME)
    joints = Axes(kinematics.joint_names, limits, ecm_arm.MAX_VELOCITY, ecm_arm.MAX_ACCELERATION, plant)
    return EcmArm(description.name, kinematics, joints)


class CameraPlant:
    """An ECM of which a scene has only the body that carries the cameras: moved as the arm would move it.

    The base stands where the scene's camera pose is that of the home pose.
    """

    def __init__(self, scene: Scene, world: World, body: int, kinematics: Ecm, start: Array) -> None:
        self._world, self._body, self._kinematics = world, body, kinematics
        self._T_world_base = camera_arm_base(scene, body, kinematics, start)
        self._start = start
        self._state = np.zeros((3, len(start)))
        self._state[0] = start

    def read(self) -> Array:
        """Joint values, velocities and zero efforts (3, 4)."""
        return self._state

    def servo(self, position: Array, velocity: Array) -> None:
        """Put the camera where the joint values have it."""
        self._state[1] = velocity
        if (position != self._state[0]).any():
            self._state[0] = position
            pose = self._T_world_base @ self._kinematics.forward(position) @ T_TIP_CAMERA
            self._world.set_pose(self._body, matrix_pose7(pose))

    def push(self, effort: Array) -> None:
        """Nothing pushes a camera without an arm: it stays."""
        self._state[1] = 0.0

    def free(self) -> None:
        """It stays."""
        self._state[1] = 0.0

    def place(self, position: Array) -> None:
        """Put the camera where the joint values have it."""
        self.servo(position, np.zeros(len(position)))

    def reset(self) -> None:
        """The scene put the camera back."""
        self._state[:] = 0.0
        self._state[0] = self._start

    def snapshot(self) -> Array:
        """The joint values that the camera's pose stands for."""
        return self._state.copy()

    def restore(self, snapshot: Array) -> None:
        """Continue from `snapshot`."""
        self._state[:] = snapshot


def _mtm(scene: Scene, world: World, description: ArmDescription, problems: list[Diagnostic]) -> Arm:
    side = master_side(description.name)
    kinematics = Mtm(side)
    limits = np.array([kinematics.lower, kinematics.upper])
    start = np.clip(mtm_arm.HOME, limits[0], limits[1])
    plant = IdealPlant(limits[0], limits[1], mtm_arm.INERTIA, mtm_arm.DAMPING, start)
    joints = Axes(kinematics.joint_names, limits, mtm_arm.MAX_VELOCITY, mtm_arm.MAX_ACCELERATION, plant)
    ends = mtm_arm.GRIPPER_LIMITS
    fingers = IdealPlant(ends[0], ends[1], np.full(1, 1e-3), np.full(1, 1e-2), np.zeros(1))
    gripper = Axes(("gripper",), ends, np.full(1, 20.0), np.full(1, 200.0), fingers)
    arm = MtmArm(description.name, kinematics, joints, gripper)
    arm.set_base_frame(console_pose(side), f"{scene.world.frame_prefix}HRSV")
    arm.set_tip_wrench(lambda: np.zeros(6))
    return arm


_BUILDERS = {ArmKind.PSM: _psm, ArmKind.ECM: _ecm, ArmKind.MTM: _mtm}
