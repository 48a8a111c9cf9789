"""Constant data of an arm for the page: joints with their limits, jaw, pose of the base. Metres, radians."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.cockpit.pursuit import JOINT
from ligature.model.arms import CHAINS
from ligature.model.frames import inverse, pose7_matrix
from ligature.model.scene import ArmDescription, ArmKind, JointType, Scene
from ligature.robots.fitting import base_pose, kinematics_of
from ligature.robots.mtm_arm import GRIPPER_LIMITS
from ligature.robots.operating_state import State
from ligature.robots.psm import Psm

Array = NDArray[np.float64]

ENDLESS = 2.0 * np.pi
"""Range shown of a joint without limits, to either side."""


@dataclass(frozen=True, eq=False)
class JointFacts:
    """A joint as a slider shows it: ``scale`` turns SI units into those of ``unit``."""

    name: str
    low: float
    high: float
    scale: float
    unit: str


@dataclass(frozen=True, eq=False)
class ArmFacts:
    """One arm; ``grip`` is its jaw or gripper with the verb that moves it, None for an arm without."""

    index: int
    description: ArmDescription
    joints: tuple[JointFacts, ...]
    speed: Array
    grip: JointFacts | None
    grip_verb: str
    T_base: Array

    @classmethod
    def of(cls, scene: Scene, index: int) -> ArmFacts:
        """Arm number ``index`` of ``scene``."""
        description = scene.arms[index]
        kinematics = kinematics_of(scene, description)
        types = CHAINS.get(description.kind, (JointType.REVOLUTE,) * len(kinematics.joint_names))
        joints = []
        for i, (name, type_) in enumerate(zip(kinematics.joint_names, types, strict=True)):
            ends = [float(kinematics.lower[i]), float(kinematics.upper[i])]
            if description.joints:
                joint = scene.joints[description.joints[i]]
                ends[0] = ends[0] if joint.low is None else max(ends[0], joint.low)
                ends[1] = ends[1] if joint.high is None else min(ends[1], joint.high)
            joints.append(_facts(name, ends[0], ends[1], type_ is JointType.PRISMATIC))
        grip, verb = None, ""
        if isinstance(kinematics, Psm) and len(description.jaw) == 2:
            grip, verb = _facts("jaw", *kinematics.instrument.jaw), "jaw/servo_jp"
        elif description.kind is ArmKind.MTM:
            low, high = np.ravel(GRIPPER_LIMITS).tolist()
            grip, verb = _facts("gripper", low, high), "gripper/servo_jp"
        speed = np.array([JOINT["prismatic" if t is JointType.PRISMATIC else "revolute"] for t in types])
        return cls(index, description, tuple(joints), speed, grip, verb, base_pose(scene, description))

    @property
    def name(self) -> str:
        """As CRTK has it."""
        return self.description.name

    @property
    def n(self) -> int:
        """Number of joints."""
        return len(self.joints)

    def base_in_world(self, state: Any) -> Array:
        """Pose (4, 4) of the base in a state (one element of the record)."""
        base = self.description.base
        return self.T_base if base < 0 else pose7_matrix(state["body_pose"][base])

    def tip_in_world(self, state: Any) -> Array:
        """Pose (4, 4) of the tip that is asked for."""
        return self.base_in_world(state) @ pose7_matrix(state["arm"][self.index]["local_setpoint_cp"])

    def in_reference(self, state: Any, T_world_tip: Array) -> Array:
        """A tip pose in the frame that ``servo_cp`` takes: the base, or where a base frame was set to."""
        record = state["arm"][self.index]
        T_reference_base = pose7_matrix(record["setpoint_cp"]) @ inverse(pose7_matrix(record["local_setpoint_cp"]))
        moved: Array = T_reference_base @ inverse(self.base_in_world(state)) @ T_world_tip
        return moved

    def setpoints(self, state: Any) -> Array:
        """Joint set-points (n,)."""
        return np.array(state["arm"][self.index]["setpoint_js"][0, : self.n])

    def ready(self, state: Any) -> bool:
        """Whether it takes motion."""
        record = state["arm"][self.index]
        return int(record["operating"]) == State.ENABLED and bool(record["homed"])


def _facts(name: str, low: float, high: float, straight: bool = False) -> JointFacts:
    low, high = max(low, -ENDLESS), min(high, ENDLESS)
    return JointFacts(name, low, high, *((1e3, "mm") if straight else (float(np.rad2deg(1.0)), "°")))
