"""A device in an operator's hand: its readings become hands in the view, its buttons pedals. Metres, radians."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ligature.teleop.calibration import Calibration
from ligature.teleop.devices.device import Reading
from ligature.teleop.pairing import Hand

ACTIONS = ("clutch", "camera", "close", "toggle", "next", "previous", "present", "phase", "phase back")
"""What a button may do: ``close`` keeps the jaw closed while down, ``toggle`` opens or closes with each press, ``next``
and ``previous`` select another follower, ``present`` means that the operator is there while down, ``phase`` and
``phase back`` mark that the next or the previous phase of the work begins."""

MARKS = {"phase": 1, "phase back": -1}
"""Actions that mark phases, and by how many they go on in the list."""


@dataclass(frozen=True)
class Press:
    """A pedal or button that went down or up; ``action`` is one of `ACTIONS`."""

    action: str
    pressed: bool


class Handset:
    """One device with its calibration, and what its buttons do, by their names."""

    def __init__(self, calibration: Calibration, buttons: Mapping[str, str]) -> None:
        self.calibration = calibration
        self._actions = dict(buttons)
        self._down: dict[str, bool] = {}
        self._grips = any(action in ("close", "toggle") for action in buttons.values())
        self._closed = False

    def take(self, reading: Reading) -> tuple[Hand, list[Press]]:
        """The hand of a reading, and the buttons that changed since the last one."""
        presses = []
        for name, action in self._actions.items():
            down = bool(reading.buttons.get(name, False))
            if down != self._down.get(name, False):
                self._down[name] = down
                if action == "close":
                    self._closed = down
                elif action == "toggle":
                    self._closed = not self._closed if down else self._closed
                else:
                    presses.append(Press(action, down))
        hand = self.calibration.hand(reading.time, reading.pose, reading.grip)
        if self._grips:
            hand = Hand(hand.time, hand.T_view_hand, 0.0 if self._closed else 1.0)
        return hand, presses
