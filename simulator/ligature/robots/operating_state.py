"""The operating state of a CRTK device: which command is allowed in which state.

The table is that of the real dVRK 2.x, which differs from CRTK's text in ``pause`` and ``home`` of a disabled arm.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass
from typing import Any

from ligature.deprecation import warn_deprecated


class State(enum.IntEnum):
    """States of CRTK; the numbers are those of the state record."""

    DISABLED = 0
    ENABLED = 1
    PAUSED = 2
    FAULT = 3


@dataclass(frozen=True)
class OperatingState:
    """The content of ``crtk_msgs/OperatingState``: ``is_busy`` during moves and homing, never because of ``servo_``."""

    state: State = State.DISABLED
    is_homed: bool = False
    is_busy: bool = False


class Action(enum.Enum):
    """The effect of an allowed command."""

    NOTHING = enum.auto()
    POWER_UP = enum.auto()
    DISABLE = enum.auto()
    PAUSE = enum.auto()
    RESUME = enum.auto()
    HOME = enum.auto()
    UNHOME = enum.auto()


class Rejected(ValueError):
    """A command that an arm does not carry out; the message gives the reason and what would be right."""


_D, _E, _P, _F = State.DISABLED, State.ENABLED, State.PAUSED, State.FAULT
TRANSITIONS: dict[str, dict[State, Action]] = {
    "enable": {_D: Action.POWER_UP, _E: Action.NOTHING},
    "disable": dict.fromkeys(State, Action.DISABLE),
    "pause": {_D: Action.PAUSE, _E: Action.PAUSE, _P: Action.NOTHING},
    "resume": {_P: Action.RESUME},
    "home": {_D: Action.HOME, _E: Action.HOME},
    "unhome": dict.fromkeys(State, Action.UNHOME),
}
"""Action of each command in each state; a command that is missing is rejected."""


def action(command: str, state: State) -> Action:
    """The effect of ``command`` in ``state``; raises `Rejected` for an unknown command or one that is not allowed."""
    if command not in TRANSITIONS:
        raise Rejected(f"'{command}' is not a state command; use one of {', '.join(TRANSITIONS)}")
    found = TRANSITIONS[command].get(state)
    if found is None:
        allowed = ", ".join(s.name for s in TRANSITIONS[command])
        raise Rejected(f"'{command}' is not allowed in state {state.name}, only in {allowed}")
    return found


def towards_enabled(state: State) -> str:
    """What to send to an arm that is not ENABLED, as the end of a sentence."""
    return {State.PAUSED: "send 'resume'", State.FAULT: "send 'disable', then 'enable'"}.get(state, "send 'enable'")


def __getattr__(name: str) -> Any:
    """Former names of this module."""
    if name == "Refused":
        warn_deprecated("Refused", "Rejected")
        return Rejected
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
