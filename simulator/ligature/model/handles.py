"""Bodies and joints of a running simulation by name, as users hold them.

World axes, SI units; poses are x y z qx qy qz qw.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from ligature.model.commands import BodyCommand, Command, CommandType, Release
from ligature.model.lookup import UnknownNameError, find_by_text
from ligature.model.scene import Body, Camera, Joint
from ligature.model.state import StateRecord

Array = NDArray[np.float64]
Handle = TypeVar("Handle")


class Running(Protocol):
    """What handles need of the simulation."""

    state: StateRecord

    def apply(self, command: Command) -> None:
        """Take a command; it acts from the next tick on."""

    def set_pose(self, body: int, pose: Array) -> None:
        """Put the root body of a tree at ``pose`` (7,) at rest."""


class Handles(Mapping[str, Handle], Generic[Handle]):
    """Objects of one kind by topic name, identifier, name, or any part of these that only one of them has."""

    def __init__(
        self, kind: str, items: Sequence[Body] | Sequence[Joint] | Sequence[Camera], handles: Sequence[Handle]
    ) -> None:
        self._kind = kind
        self._names = ([i.identity.topic for i in items], [i.identity.identifier for i in items])
        self._bare_names = [i.identity.name for i in items]
        self._handles = list(handles)

    def __getitem__(self, text: str) -> Handle:
        for names in self._names:
            if text in names:
                return self._handles[names.index(text)]
        if self._bare_names.count(text) == 1:
            return self._handles[self._bare_names.index(text)]
        for names in self._names:
            found = find_by_text(names, text)
            if found is not None:
                return self._handles[found]
        raise UnknownNameError(
            f"'{text}' does not name exactly one {self._kind}; choose one of {', '.join(self._names[0])}"
        )

    def __iter__(self) -> Iterator[str]:
        return iter(self._names[0])

    def __len__(self) -> int:
        return len(self._handles)


class BodyHandle:
    """One body of a running simulation."""

    def __init__(self, simulation: Running, body: Body) -> None:
        self._simulation = simulation
        self.body = body

    @property
    def pose(self) -> Array:
        """Pose (7,) of the body frame in world axes: x y z in metres, qx qy qz qw."""
        return np.array(self._simulation.state["body_pose"][0, self.body.index])

    @property
    def twist(self) -> Array:
        """Linear velocity of the centre of mass and angular velocity, (6,), world axes."""
        return np.array(self._simulation.state["body_twist"][0, self.body.index])

    def set_pose(self, pose: Sequence[float]) -> None:
        """Put the body at ``pose`` (7,) at once, at rest; for links of an arm use joint commands."""
        self._simulation.set_pose(self.body.index, np.asarray(pose, dtype=float))

    def command_pose(self, pose: Sequence[float]) -> None:
        """Drive the body to ``pose`` (7,) with its Cartesian controller."""
        self._command(CommandType.POSITION, pose)

    def command_twist(self, twist: Sequence[float]) -> None:
        """Drive the body with ``twist`` (6,)."""
        self._command(CommandType.VELOCITY, twist)

    def command_wrench(self, wrench: Sequence[float]) -> None:
        """Push the body with ``wrench`` (6,) at its centre of mass."""
        self._command(CommandType.FORCE, wrench)

    def command_joints(self, values: Sequence[float], type: CommandType = CommandType.POSITION) -> None:
        """Command the active joints below this body, in the order of ``body.joints``."""
        self._simulation.apply(
            BodyCommand(
                self.body.index,
                CommandType.FORCE,
                (0.0,) * 6,
                (type,) * len(values),
                tuple(map(float, values)),
            )
        )

    def release(self) -> None:
        """Drop whatever was commanded: joints go limp, forces cease."""
        self._simulation.apply(Release("body", self.body.index))

    def _command(self, type: CommandType, target: Sequence[float]) -> None:
        self._simulation.apply(BodyCommand(self.body.index, type, tuple(map(float, target))))


class JointHandle:
    """One joint of a running simulation; radians or metres."""

    def __init__(self, simulation: Running, joint: Joint) -> None:
        self._simulation = simulation
        self.joint = joint

    @property
    def position(self) -> float:
        """Joint position."""
        return float(self._simulation.state["joint_position"][0, self.joint.index])

    @property
    def velocity(self) -> float:
        """Joint velocity."""
        return float(self._simulation.state["joint_velocity"][0, self.joint.index])

    @property
    def effort(self) -> float:
        """Reaction along the joint axis, where the joint has feedback enabled."""
        return float(self._simulation.state["joint_effort"][0, self.joint.index])
