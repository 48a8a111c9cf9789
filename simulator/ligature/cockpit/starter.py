"""The first minute in one step: instruments are powered and homed, without a click for each command."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from typing import Any

from ligature.bus.codec import Message
from ligature.cockpit.arm_facts import ArmFacts
from ligature.model.scene import ArmKind
from ligature.robots.commands import StateCommand
from ligature.robots.operating_state import State

AGAIN = 2.0
"""Seconds after which a command without effect is sent again."""

GIVEN_UP = 20.0
"""Seconds after which an arm that does not get ready is left to its operator."""


class Starter:
    """Gets ``arms`` ready: the instruments, or all where a scene has none; endoscope and consoles stay as they are."""

    def __init__(self, arms: Sequence[ArmFacts], send: Callable[[Message], None]) -> None:
        instruments = [arm for arm in arms if arm.description.kind is ArmKind.PSM]
        self._arms = instruments or list(arms)
        self._send = send
        self._asked: dict[int, tuple[str, float]] = {}
        self._begun = float("-inf")
        self.active = False

    def begin(self) -> None:
        """Get them ready from now on."""
        self.active, self._begun, self._asked = True, time.monotonic(), {}

    def end(self) -> None:
        """Leave them as they are."""
        self.active = False

    def advance(self, state: Any) -> bool:
        """Send what is due in a state (one element of the record); True when all have just become ready."""
        if not self.active:
            return False
        now = time.monotonic()
        left = [arm for arm in self._arms if not arm.ready(state)]
        for arm in left:
            record = state["arm"][arm.index]
            command = "home" if int(record["operating"]) == State.ENABLED else "enable"
            asked, when = self._asked.get(arm.index, ("", float("-inf")))
            if not record["busy"] and (asked != command or now - when > AGAIN):
                self._asked[arm.index] = command, now
                self._send(StateCommand(arm.index, command))
        self.active = bool(left) and now - self._begun < GIVEN_UP
        return not left
