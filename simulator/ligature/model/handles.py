"""Bodies and joints of a running simulation by name, as users hold them.

World axes, SI units; poses are x y z qx qy qz qw.
"""

from __future__ import annotations

import difflib
import reprlib
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Generic, Protocol, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.adf.schema import PLURALS
from ligature.model.commands import BodyCommand, Command, CommandType, Release
from ligature.model.frames import matrix_pose7
from ligature.model.lookup import UnknownNameError, find_by_text
from ligature.model.scene import Body, Camera, Joint, Scene
from ligature.model.state import StateRecord

Array = NDArray[np.float64]
MOST_NAMES = 10
"""Most names to choose from in an error."""

Handle = TypeVar("Handle")


class Running(Protocol):
    """What handles need of the simulation."""

    state: StateRecord

    @property
    def scene(self) -> Scene:
        """What is simulated."""

    def apply(self, command: Command) -> None:
        """Take a command; it acts from the next tick on."""

    def set_pose(self, body: int, pose: Array) -> None:
        """Put the root body of a tree at ``pose`` (7,) at rest."""


class Handles(Mapping[str, Handle], Generic[Handle]):
    """Objects of one kind by topic name, identifier, name, or any part of these that only one of them has.

    Its keys are the topic names, and identifiers of objects that share one, such as joints of one name.
    """

    def __init__(
        self, kind: str, items: Sequence[Body] | Sequence[Joint] | Sequence[Camera], handles: Sequence[Handle]
    ) -> None:
        self._kind = kind
        times = Counter(item.identity.topic for item in items)
        self._names = (
            [i.identity.topic if times[i.identity.topic] == 1 else i.identity.identifier for i in items],
            [i.identity.identifier for i in items],
        )
        self._bare_names = [i.identity.name for i in items]
        self._handles = list(handles)

    def __getitem__(self, text: str) -> Handle:
        if not isinstance(text, str):
            raise UnknownNameError(self._unknown(repr(text)))
        for names in self._names:
            if text in names:
                return self._handles[names.index(text)]
        if self._bare_names.count(text) == 1:
            return self._handles[self._bare_names.index(text)]
        for names in self._names:
            found = find_by_text(names, text)
            if found is not None:
                return self._handles[found]
        raise UnknownNameError(self._unknown(text))

    def _unknown(self, text: str) -> str:
        """Why ``text`` names nothing, and what to choose from: what contains it, what is alike, or all there is."""
        topics = self._names[0]
        if not topics:
            return (
                f"there is no {self._kind} '{text}': the scene has none; list one in '{PLURALS[self._kind]}' of a file"
            )
        alike = difflib.get_close_matches(str(text), self._bare_names, MOST_NAMES)
        near = [topic for topic in topics if str(text) in topic]
        near = near or [topic for topic, name in zip(topics, self._bare_names, strict=True) if name in alike]
        shown = (near or topics)[:MOST_NAMES]
        more = f" and {len(near or topics) - len(shown)} more" if len(near or topics) > len(shown) else ""
        return f"'{text}' does not name exactly one {self._kind}; choose one of {', '.join(shown)}{more}"

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

    def set_pose(self, pose: ArrayLike) -> None:
        """Put the body at ``pose``, (7,) or (4, 4), at once, at rest; for links of an arm use joint commands."""
        self._simulation.set_pose(self.body.index, np.array(pose_numbers("set_pose", pose)))

    def command_pose(self, pose: ArrayLike) -> None:
        """Drive the body to ``pose``, (7,) or (4, 4), with its Cartesian controller."""
        self._command(CommandType.POSITION, pose_numbers("command_pose", pose))

    def command_twist(self, twist: ArrayLike) -> None:
        """Drive the body with ``twist`` (6,)."""
        self._command(CommandType.VELOCITY, numbers_of("command_twist", twist, "vx vy vz wx wy wz"))

    def command_wrench(self, wrench: ArrayLike) -> None:
        """Push the body with ``wrench`` (6,) at its centre of mass."""
        self._command(CommandType.FORCE, numbers_of("command_wrench", wrench, "fx fy fz tx ty tz"))

    def command_joints(self, values: ArrayLike, type: CommandType = CommandType.POSITION) -> None:
        """Command the active joints below this body, in the order of ``body.joints``.

        Raises ValueError for a ``type`` that is no `CommandType`, and for an element of a thread.
        """
        self._check_commandable()
        targets = numbers_of("command_joints", values, "one for each joint, or fewer")
        self._simulation.apply(
            BodyCommand(
                self.body.index,
                CommandType.FORCE,
                (0.0,) * 6,
                (type,) * len(targets),
                targets,
            )
        )

    def release(self) -> None:
        """Drop whatever was commanded: joints go limp, forces cease."""
        self._simulation.apply(Release("body", self.body.index))

    def _check_commandable(self) -> None:
        """Raise ValueError for an element of a thread: its rod follows no command."""
        if self.body.index in self._simulation.scene.rod_bodies:
            raise ValueError(
                f"body '{self.body.identity.identifier}' is an element of a thread and takes no commands; "
                "command a body at an end of it"
            )

    def _command(self, type: CommandType, target: tuple[float, ...]) -> None:
        self._check_commandable()
        self._simulation.apply(BodyCommand(self.body.index, type, target))


def pose_numbers(what: str, pose: ArrayLike) -> tuple[float, ...]:
    """A pose, (7,) or (4, 4), as seven numbers; raises ValueError for a matrix that is no pose."""
    T = _array(what, pose, "x y z qx qy qz qw, or a (4, 4) matrix")
    if T.shape != (4, 4):
        return tuple(T.reshape(-1).tolist())
    R = T[:3, :3]
    if not (np.isfinite(T).all() and np.allclose(R @ R.T, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0.0):
        raise ValueError(f"{what} takes a matrix with a rotation in its upper left, not {R.tolist()}")
    return tuple(matrix_pose7(T).tolist())


def numbers_of(what: str, values: ArrayLike, wanted: str) -> tuple[float, ...]:
    """``values`` as plain numbers, whatever holds them; raises TypeError where they are none."""
    return tuple(_array(what, values, wanted).reshape(-1).tolist())


def _array(what: str, values: ArrayLike, wanted: str) -> Array:
    try:
        array = np.asarray(values)
        if np.iscomplexobj(array):
            raise TypeError("complex numbers")
        return array.astype(float)
    except (TypeError, ValueError, OverflowError) as error:
        raise TypeError(f"{what} takes numbers ({wanted}), not {reprlib.repr(values)}") from error


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
