"""What rigid bodies and the legacy objects share: wrenches, and joint lists by name or index, in radians or metres."""

from __future__ import annotations

import copy
import math
import operator
import time
from collections.abc import Sequence
from typing import Any

import rospy
from geometry_msgs.msg import Point, Vector3, Wrench

from ligature.client.base_object import BaseObject

LISTS_TIMEOUT = 0.5
"""Seconds after a handle became active within which a simulator lists its children and joints."""
POLL = 0.005


class JointedObject(BaseObject):
    """A handle whose messages list children and joints, once a command has asked for them.

    Who reads or commands joints right after getting a handle is kept waiting for the lists, for `LISTS_TIMEOUT` at
    most.
    """

    _asked = -math.inf

    def get_inertia(self) -> Point:
        """Principal moments of inertia, kg·m²."""
        return self._state.pInertia

    def get_force_command(self) -> Vector3:
        """The commanded force, zero while none was commanded."""
        return self._cmd.wrench.force

    def get_torque_command(self) -> Vector3:
        """The commanded torque, zero while none was commanded."""
        return self._cmd.wrench.torque

    def set_force(self, fx: float, fy: float, fz: float) -> None:
        """Command a force on the centre of mass, world axes; the torque stays the commanded one."""
        self.set_wrench(Wrench(vector(fx, fy, fz), self._cmd.wrench.torque))

    def set_torque(self, nx: float, ny: float, nz: float) -> None:
        """Command a torque, world axes; the force stays the commanded one."""
        self.set_wrench(Wrench(self._cmd.wrench.force, vector(nx, ny, nz)))

    def set_wrench(self, wrench: Wrench) -> None:
        """Command force and torque, world axes."""
        if not self._takes(*components(wrench.force), *components(wrench.torque)):
            return
        with self._lock:
            self._cmd.wrench = copy.deepcopy(wrench)
            self._wrench_commanded()

    def wrench_command(self, fx: float, fy: float, fz: float, nx: float, ny: float, nz: float) -> None:
        """Command force and torque by their components."""
        self.set_wrench(Wrench(vector(fx, fy, fz), vector(nx, ny, nz)))

    def _wrench_commanded(self) -> None:
        """Mark the command as a wrench command."""
        raise NotImplementedError

    def get_children_names(self) -> list[str]:
        """Names of all bodies below this one."""
        return list(self._listed.children_names)

    def get_num_of_children(self) -> int:
        """How many bodies are below this one."""
        return len(self._listed.children_names)

    def get_joint_names(self) -> list[str]:
        """Names of the joints below this body."""
        return list(self._listed.joint_names)

    def get_num_joints(self) -> int:
        """How many joints there are below this body."""
        return len(self._listed.joint_positions)

    def is_joint_idx_valid(self, joint_idx: int) -> bool:
        """Whether there is a joint of that index; logs the known ones when not."""
        if 0 <= joint_idx < self.get_num_joints():
            return True
        rospy.logwarn(f"{self._name}: no joint {joint_idx}; {self._extent()}")
        return False

    def get_joint_idx_from_name(self, joint_name: str) -> int | None:
        """Index of a joint; None, with a message, when there is none of that name."""
        if joint_name in self._listed.joint_names:
            return int(self._listed.joint_names.index(joint_name))
        rospy.logwarn(f"{self._name}: no joint {joint_name!r}; {self._extent()}")
        return None

    def get_joint_name_from_idx(self, joint_idx: int) -> str | None:
        """Name of a joint; None, with a message, when there is none of that index."""
        return self._listed.joint_names[joint_idx] if self.is_joint_idx_valid(joint_idx) else None

    def get_joint_pos(self, joint_name_or_idx: str | int) -> float | None:
        """Position of a joint; None, with a message, when there is none of that name or index."""
        return self._value(self._listed.joint_positions, joint_name_or_idx)

    def get_all_joint_pos(self) -> list[float]:
        """Positions of all joints."""
        return list(self._listed.joint_positions)

    def get_publish_children_names_flag(self) -> bool:
        """Whether the command asks for the names of children."""
        return self._cmd.publish_children_names

    get_publish_children_name_flag = get_publish_children_names_flag
    """As AMBF writes it too."""

    def get_publish_joint_names_flag(self) -> bool:
        """Whether the command asks for the names of joints."""
        return self._cmd.publish_joint_names

    def get_publish_joint_positions_flag(self) -> bool:
        """Whether the command asks for positions, velocities and efforts of joints."""
        return self._cmd.publish_joint_positions

    def set_publish_children_names_flag(self, state: bool) -> None:
        """Ask for the names of children."""
        self._cmd.publish_children_names = bool(state)

    def set_publish_joint_names_flag(self, state: bool) -> None:
        """Ask for the names of joints."""
        self._cmd.publish_joint_names = bool(state)

    def set_publish_joint_positions_flag(self, state: bool) -> None:
        """Ask for positions, velocities and efforts of joints."""
        self._cmd.publish_joint_positions = bool(state)

    def set_active(self) -> None:
        """Have the command published, and ask for all lists."""
        with self._lock:
            self.set_publish_children_names_flag(True)
            self.set_publish_joint_names_flag(True)
            self.set_publish_joint_positions_flag(True)
        if not self.is_active():
            self._asked = time.monotonic()
        super().set_active()

    @property
    def _listed(self) -> Any:
        """The newest state, with the lists that were asked for."""
        while not self._state.joint_names and time.monotonic() < self._asked + LISTS_TIMEOUT:
            time.sleep(POLL)
        return self._state

    def _index(self, joint: str | int) -> int | None:
        if isinstance(joint, str):
            return self.get_joint_idx_from_name(joint)
        index = operator.index(joint)
        return index if self.is_joint_idx_valid(index) else None

    def _write_joint(self, joint: str | int, value: float, kinds: str, kind: Any, others: Any) -> None:
        """Command one joint; the field ``kinds`` of the command holds the kind of each joint, at first ``others``."""
        value, index = float(value), self._index(joint)
        if index is None or not self._takes(value):
            return
        with self._lock:
            cmd = self._cmd
            cmd.joint_cmds = grown(cmd.joint_cmds, index + 1, 0.0)
            setattr(cmd, kinds, grown(getattr(cmd, kinds), index + 1, others))
            cmd.joint_cmds[index], getattr(cmd, kinds)[index] = value, kind

    def _value(self, values: Sequence[float], joint: str | int) -> float | None:
        index = self._index(joint)
        return None if index is None or index >= len(values) else values[index]

    def _extent(self) -> str:
        names = self._listed.joint_names
        if not names:
            return "its state lists no joints yet, or it has none"
        return "it has " + ", ".join(f"{index} {name}" for index, name in enumerate(names))


def grown(values: Sequence[Any], length: int, fill: Any) -> list[Any]:
    """``values`` with at least ``length`` entries; never shorter than it was."""
    return [*values, *[fill] * (length - len(values))]


def vector(x: float, y: float, z: float) -> Vector3:
    """A vector message of three numbers; TypeError or ValueError for what is none."""
    return Vector3(float(x), float(y), float(z))


def components(v: Vector3) -> tuple[float, float, float]:
    """The numbers of a vector message."""
    return v.x, v.y, v.z
