"""Commands to a running scene: plain values that any front end (ROS, Python, a replay) can make.

Indices are those of the `Scene`. Poses are x y z qx qy qz qw. A command is a persistent target: it
holds until the next one for the same object or until a `Release`. SI units, world axes unless a
field says otherwise.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Mapping
from dataclasses import dataclass

from ligature.model.scene import Scene

Vector = tuple[float, ...]


class CommandType(enum.IntEnum):
    """What a number in a command means; the values are those of ``ambf_msgs/RigidBodyCmd``."""

    FORCE = 0
    POSITION = 1
    VELOCITY = 2


@dataclass(frozen=True)
class BodyCommand:
    """Cartesian and joint command of one body (interface reference §3.1, §3.2).

    ``target`` is a pose (7,) for POSITION, a twist (6,) for VELOCITY, a wrench (6,) for FORCE.
    ``joint_values[i]`` goes to the i-th active joint of the body's tree, as ``joint_types[i]``.
    """

    body: int
    type: CommandType
    target: Vector
    joint_types: tuple[CommandType, ...] = ()
    joint_values: Vector = ()


@dataclass(frozen=True)
class ActuatorCommand:
    """Grasp or release with a constraint actuator (interface reference §3.4)."""

    actuator: int
    actuate: bool
    body: str = ""
    offset: Vector | None = None
    sensor: str | None = None


@dataclass(frozen=True)
class PlaceCommand:
    """Put a camera or a light (``kind``) at a pose in its parent's frame; None lets it be."""

    kind: str
    index: int
    pose: Vector | None


STREAMED = (
    "servo_jp", "servo_jv", "servo_jf", "servo_cp", "servo_cv", "servo_ci", "servo_cs", "spatial/servo_cf",
    "body/servo_cf", "jaw/servo_jp", "jaw/servo_jf",
)  # fmt: skip
"""Verbs of arms of which only the newest counts."""

ORDERED = (
    "state_command", "servo_jr", "move_jp", "move_jr", "move_cp", "jaw/move_jp", "hold", "free",
    "use_gravity_compensation", "body/set_cf_orientation_absolute", "set_base_frame", "trajectory_j/set_ratio",
    "trajectory_j/set_ratio_v", "trajectory_j/set_ratio_a", "set_tool_type", "tool_type_request",
    "emulate_adapter_present", "emulate_tool_present", "set_endoscope_type", "lock_orientation",
    "unlock_orientation", "gripper/servo_jp", "place_jp",
)  # fmt: skip
"""Verbs of arms that are carried out one after the other, none left out."""

VERBS = (*STREAMED, *ORDERED)


@dataclass(frozen=True)
class ParentCommand:
    """Hang a camera or a light (``kind``) on body ``parent``, None for the world; its pose there stays what it was."""

    kind: str
    index: int
    parent: int | None


@dataclass(frozen=True)
class ArmCommand:
    """One CRTK command to an arm (interface reference §5.4); ``verb`` is the topic's name below the arm's.

    ``values`` are the numbers of the message: joint values, a pose (7,), a twist or wrench (6,), a flag; ``text``
    its words. How many numbers a verb takes depends on the arm, which refuses a command that does not fit it.
    """

    arm: int
    verb: str
    values: Vector = ()
    text: str = ""


@dataclass(frozen=True)
class Release:
    """The watchdog of one object expired: its command is cleared (interface reference §2.4)."""

    kind: str
    index: int


@dataclass(frozen=True)
class Reset:
    """Put objects back to their initial poses; ``bodies_only`` leaves cameras and lights."""

    bodies_only: bool = False


@dataclass(frozen=True)
class WatchContacts:
    """Write contact points and forces into states from now on, or no longer: somebody looks at them."""

    enabled: bool


Command = BodyCommand | ActuatorCommand | PlaceCommand | ParentCommand | ArmCommand | Release | Reset | WatchContacts


LARGEST = 1e9
"""Largest magnitude of a number in a command, in SI units."""

MOST_NUMBERS, MOST_BYTES = 64, 200
"""Most numbers of one kind in a command, and most bytes of each of its texts."""

PLACED = ("camera", "light")
"""Kinds of objects that a `PlaceCommand` or `ParentCommand` moves."""

RELEASED = ("body", "actuator", "camera", "light", "arm")
"""Kinds of objects whose commands a `Release` clears."""

_LENGTHS = {CommandType.POSITION: 7, CommandType.VELOCITY: 6, CommandType.FORCE: 6}


def check(command: Command) -> None:
    """Raise ValueError, saying what was expected, when a command may not reach the physics."""
    if isinstance(command, BodyCommand):
        _few("joint commands", command.joint_values)
        _few("types of joint commands", command.joint_types)
        wanted = _LENGTHS[command.type]
        if len(command.target) != wanted:
            raise ValueError(f"a {command.type.name} command has {wanted} numbers, not {len(command.target)}")
        _finite("the command", command.target)
        _finite("joint commands", command.joint_values)
        if command.type is CommandType.POSITION:
            _unit(command.target[3:])
    elif isinstance(command, ActuatorCommand):
        _short("the name of a body", command.body)
        _short("the name of a sensor", command.sensor or "")
        if command.offset is not None:
            _pose("the offset", command.offset)
    elif isinstance(command, PlaceCommand) and command.pose is not None:
        _pose("the pose", command.pose)
    elif isinstance(command, ArmCommand):
        if command.verb not in VERBS:
            raise ValueError(f"arms know no '{command.verb[:40]}'; they know {', '.join(VERBS)}")
        _few(command.verb, command.values)
        _short(f"the text of {command.verb}", command.text)
        _finite(command.verb, command.values)


def objects_of(scene: Scene) -> dict[str, int]:
    """How many objects of each kind that can be commanded a scene has."""
    return {
        "body": len(scene.bodies),
        "actuator": len(scene.actuators),
        "camera": len(scene.cameras),
        "light": len(scene.lights),
        "arm": len(scene.arms),
    }


def object_of(command: object) -> tuple[str, int] | None:
    """Kind and index of the object that a command is for; None for events."""
    if isinstance(command, BodyCommand):
        return "body", command.body
    if isinstance(command, ActuatorCommand):
        return "actuator", command.actuator
    if isinstance(command, ArmCommand):
        return "arm", command.arm
    if isinstance(command, PlaceCommand | ParentCommand | Release):
        return command.kind, command.index
    return None


def check_object(command: object, objects: Mapping[str, int]) -> None:
    """Raise ValueError when a command is for an object that is not among ``objects``, as from `objects_of`."""
    item = object_of(command)
    if item is None:
        return
    kind, index = item
    known = PLACED if isinstance(command, PlaceCommand | ParentCommand) else RELEASED
    if kind not in known:
        raise ValueError(f"a '{kind[:40]}' takes no {type(command).__name__}; {', '.join(known)} do")
    if not 0 <= index < objects[kind]:
        raise ValueError(f"there is no {kind} number {index}")
    if isinstance(command, ParentCommand) and not 0 <= (command.parent or 0) < objects["body"]:
        raise ValueError(f"there is no body number {command.parent} to hang a {kind} on")


def _few(what: str, values: tuple[object, ...]) -> None:
    if len(values) > MOST_NUMBERS:
        raise ValueError(f"{what} takes at most {MOST_NUMBERS} numbers, not {len(values)}")


def _short(what: str, text: str) -> None:
    size = len(text) if len(text) > MOST_BYTES else len(text.encode("utf-8"))
    if size > MOST_BYTES:
        raise ValueError(f"{what} has at most {MOST_BYTES} bytes, not {size}")


def _pose(what: str, values: Vector) -> None:
    if len(values) != 7:
        raise ValueError(f"{what} has 7 numbers, not {len(values)}")
    _finite(what, values)
    _unit(values[3:])


def _finite(what: str, values: Vector) -> None:
    for value in values:
        if not math.isfinite(value) or abs(value) > LARGEST:
            raise ValueError(f"{what} must be finite and below {LARGEST:g}, not {value}")


def _unit(quaternion: Vector) -> None:
    length = math.sqrt(sum(v * v for v in quaternion))
    if not 0.9 <= length <= 1.1:
        raise ValueError(f"the quaternion has the length {length:.3g}; it must be 1")
