"""How large the numbers of a client may be: beyond these no scene of this kind stays sane (SI units)."""

from __future__ import annotations

from ligature.bus.codec import Message
from ligature.bus.pacing import FASTEST as FASTEST_PACE
from ligature.bus.pacing import SLOWEST, Pace
from ligature.model.commands import ActuatorCommand, BodyCommand, CommandType, PlaceCommand

FARTHEST = 1e4
"""Metres from the origin of a pose; 1e9 m between two held bodies leaves the doubles no digits to act in."""

FASTEST = 1e4
"""Metres or radians per second of a twist."""

STRONGEST = 1e6
"""Newtons or newton metres of a wrench, and largest joint command of any type."""

_OF_TARGET = {
    CommandType.POSITION: (FARTHEST, "m"),
    CommandType.VELOCITY: (FASTEST, "m/s or rad/s"),
    CommandType.FORCE: (STRONGEST, "N or N m"),
}


def check_bounds(message: Message) -> None:
    """Raise ValueError, saying what is allowed, when a number of a command is too large."""
    if isinstance(message, BodyCommand):
        bound, unit = _OF_TARGET[message.type]
        _below("the command", message.target, bound, unit)
        _below("joint commands", message.joint_values, STRONGEST, "SI units")
    elif isinstance(message, ActuatorCommand) and message.offset is not None:
        _below("the offset", message.offset, FARTHEST, "m")
    elif isinstance(message, PlaceCommand) and message.pose is not None:
        _below("the pose", message.pose, FARTHEST, "m")
    elif isinstance(message, Pace) and not SLOWEST <= message.speed <= FASTEST_PACE:
        raise ValueError(f"the speed must be within {SLOWEST:g} … {FASTEST_PACE:g}, not {message.speed:g}")


def _below(what: str, values: tuple[float, ...], bound: float, unit: str) -> None:
    if values and (max(values) > bound or min(values) < -bound):
        largest = max(values, key=abs)
        raise ValueError(f"{what} must stay within {bound:g} {unit}, not {largest:g}")
