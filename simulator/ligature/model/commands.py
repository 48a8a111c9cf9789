"""Commands to a running scene: plain values that any front end (ROS, Python, a replay) can make.

Indices are those of the `Scene`. Poses are x y z qx qy qz qw. A command is a persistent target: it
holds until the next one for the same object or until a `Release`. SI units, world axes unless a
field states otherwise. The commands of CRTK arms are in `ligature.robots.commands`.
"""

from __future__ import annotations

import enum
from collections.abc import Hashable, Mapping
from dataclasses import dataclass
from typing import Any

from ligature.model.messages import (
    FLAG,
    INDEX,
    Choice,
    Choices,
    Field,
    Message,
    Numbers,
    OptionalIndex,
    Pose,
    Text,
    Vector,
    wire,
)
from ligature.model.scene import Scene


class CommandType(enum.IntEnum):
    """The quantity that a command sets; the values are those of ``ambf_msgs/RigidBodyCmd``."""

    FORCE = 0
    POSITION = 1
    VELOCITY = 2


MOUNTED = ("camera", "light")
"""Kinds of objects that a `PlaceCommand` or `ParentCommand` moves."""

RELEASED = ("body", "actuator", "camera", "light", "arm")
"""Kinds of objects whose commands a `Release` clears."""

MAX_POSITION = 1e4
"""Metres from the origin of a pose; at 1e9 m between two attached bodies, doubles have no digits left."""

MAX_VELOCITY = 1e4
"""Metres or radians per second of a twist."""

MAX_FORCE = 1e6
"""Newtons or newton metres of a wrench, and largest joint command of any type."""

_TARGETS: dict[CommandType, Field] = {
    CommandType.POSITION: Pose(bound=MAX_POSITION),
    CommandType.VELOCITY: Numbers(6, MAX_VELOCITY, "m/s or rad/s"),
    CommandType.FORCE: Numbers(6, MAX_FORCE, "N or N m"),
}


def _type_of(value: Any) -> Any:
    """The `CommandType` of a number, or ``value`` itself where it is none, for the check."""
    try:
        return CommandType(value)
    except ValueError:
        return value


@dataclass(frozen=True)
class Command(Message):
    """A command that the simulation executes and records contain."""


@dataclass(frozen=True)
class BodyCommand(Command, code=1):
    """Cartesian and joint command of one body (as in AMBF).

    ``target`` is a pose (7,) for POSITION, a twist (6,) for VELOCITY, a wrench (6,) for FORCE.
    ``joint_values[i]`` goes to the i-th active joint of the body's tree, as ``joint_types[i]``.
    """

    body: int = wire(INDEX)
    type: CommandType = wire(Choice(tuple(sorted(CommandType))))
    target: Vector = wire(Numbers(bound=float("inf")), "the command")
    joint_types: tuple[CommandType, ...] = wire(Choices(tuple(sorted(CommandType))), default=())
    joint_values: Vector = wire(Numbers(bound=MAX_FORCE), "joint commands", default=())

    def __post_init__(self) -> None:
        """Take numbers for types: what carries commands out tells types apart by identity."""
        if not isinstance(self.type, CommandType):
            object.__setattr__(self, "type", _type_of(self.type))
        if not all(isinstance(item, CommandType) for item in self.joint_types):
            object.__setattr__(self, "joint_types", tuple(map(_type_of, self.joint_types)))

    @property
    def object(self) -> tuple[str, int]:  # noqa: D102
        return "body", self.body

    def check_together(self, counts: Mapping[str, int] | None) -> None:  # noqa: D102
        _TARGETS[self.type].check(f"a {self.type.name} command", self.target)


@dataclass(frozen=True)
class ActuatorCommand(Command, code=2):
    """Attach a body to a constraint actuator, or release what it holds (as in AMBF)."""

    actuator: int = wire(INDEX)
    actuate: bool = wire(FLAG)
    body: str = wire(Text(), default="")
    offset: Vector | None = wire(Pose(bound=MAX_POSITION, optional=True), "the offset", default=None)
    sensor: str | None = wire(Text(optional=True), default=None)

    @property
    def object(self) -> tuple[str, int]:  # noqa: D102
        return "actuator", self.actuator

    @property
    def slot(self) -> Hashable:
        """Attaching and releasing have a slot each: neither replaces the other."""
        return self.object, self.actuate


@dataclass(frozen=True)
class _Mounted(Command):
    """A command to a camera or a light (``kind``)."""

    kind: str = wire(Choice(MOUNTED))
    index: int = wire(INDEX)

    @property
    def object(self) -> tuple[str, int]:  # noqa: D102
        return self.kind, self.index


@dataclass(frozen=True)
class PlaceCommand(_Mounted, code=3):
    """Put a camera or a light (``kind``) at a pose in its parent's frame; None leaves it where it is."""

    pose: Vector | None = wire(Pose(bound=MAX_POSITION, optional=True), "the pose")


@dataclass(frozen=True)
class ParentCommand(_Mounted, code=8):
    """Mount a camera or a light (``kind``) on body ``parent``, None for the world; its pose there does not change."""

    parent: int | None = wire(OptionalIndex())

    @property
    def slot(self) -> Hashable:  # noqa: D102
        return self.object, "parent"

    def check_together(self, counts: Mapping[str, int] | None) -> None:  # noqa: D102
        if counts is not None and not 0 <= (self.parent or 0) < counts["body"]:
            raise ValueError(f"the scene has no body number {self.parent} to mount a {self.kind} on")


@dataclass(frozen=True)
class Release(Command, code=4):
    """The watchdog of one object expired: its command is cleared (as in AMBF)."""

    kind: str = wire(Choice(RELEASED))
    index: int = wire(INDEX)

    @property
    def object(self) -> tuple[str, int]:  # noqa: D102
        return self.kind, self.index

    @property
    def releases(self) -> bool:  # noqa: D102
        return True


@dataclass(frozen=True)
class Reset(Command, code=5):
    """Put objects back to their initial poses; ``bodies_only`` leaves cameras and lights."""

    bodies_only: bool = wire(FLAG, default=False)


@dataclass(frozen=True)
class WatchContacts(Command, code=9):
    """Switch the contact points and forces in states on or off, for a view that shows them."""

    enabled: bool = wire(FLAG)


PHASE_TOPIC = "ligature/phase"
"""Topic below the root of a run by which operators mark phases."""


@dataclass(frozen=True)
class MarkPhase(Command, code=13):
    """The operator marks the begin of a ``phase`` of the work; an empty text ends the current one.

    The simulation does not change. Records contain the mark, and datasets made from them have it as a label.
    """

    phase: str = wire(Text())

    @classmethod
    def of(cls, text: str) -> MarkPhase:
        """The mark for the name ``text`` of a phase; raises ValueError for an invalid name."""
        mark = cls(text.strip())
        mark.check()
        return mark

    def check_together(self, counts: Mapping[str, int] | None) -> None:  # noqa: D102
        if not self.phase.isprintable() or self.phase != self.phase.strip():
            raise ValueError(f"a phase is printable text without spaces around it, not {self.phase[:40]!r}")


@dataclass(frozen=True)
class PluginCommand(Command, code=12):
    """Numbers for topic number ``topic`` of those that plug-in number ``plugin`` of the scene subscribes."""

    plugin: int = wire(INDEX)
    topic: int = wire(INDEX)
    values: Vector = wire(Numbers(), "the message")

    @property
    def slot(self) -> Hashable:  # noqa: D102
        return "plugin", self.plugin, self.topic

    def check_together(self, counts: Mapping[str, int] | None) -> None:  # noqa: D102
        if counts is not None and not 0 <= self.plugin < counts["plugin"]:
            raise ValueError(f"the scene has no plug-in number {self.plugin} that runs")


def object_counts(scene: Scene) -> dict[str, int]:
    """How many objects of each kind that can be commanded a scene has, for `Message.check`."""
    return {
        "body": len(scene.bodies),
        "actuator": len(scene.actuators),
        "camera": len(scene.cameras),
        "light": len(scene.lights),
        "arm": len(scene.arms),
        "plugin": len(scene.plugins),
    }
