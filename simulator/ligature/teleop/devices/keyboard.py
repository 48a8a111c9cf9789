"""The keys of the terminal: each press moves the hand by a step. Metres, radians.

``d a`` right and left, ``s w`` down and up, ``e q`` away and near; ``l j``, ``k i``, ``o u`` turn about these axes.
The keys space, ``c`` and ``v`` are buttons that one press holds down and the next one lets go; tab, ``p`` and ``P``
are down for a moment.
"""

from __future__ import annotations

import os
import select
import sys
import termios
import tty
from typing import Any

import numpy as np

from ligature.model.frames import axis_rotation, frame, matrix_pose7
from ligature.teleop.calibration import Calibration
from ligature.teleop.devices.device import Device, Reading, Take

DEFAULTS = Calibration()
OPTIONS: dict[str, Any] = {"step": 0.005, "turn": 0.05}

MOVES = {"d": (0, 1), "a": (0, -1), "s": (1, 1), "w": (1, -1), "e": (2, 1), "q": (2, -1)}
TURNS = {"l": (1, 1), "j": (1, -1), "k": (0, -1), "i": (0, 1), "o": (2, 1), "u": (2, -1)}
SWITCHES = {" ": "space", "c": "c", "v": "v"}
CLICKS = {"\t": "tab", "p": "p", "P": "P"}


class Adapter(Device):
    """Keys read from standard input, or from the terminal ``topic`` such as ``/dev/pts/3``."""

    def __init__(self, topic: str, options: dict[str, Any], take: Take) -> None:
        super().__init__(take)
        self._step, self._turn = options["step"], options["turn"]
        self._T = np.eye(4)
        self._buttons = dict.fromkeys((*SWITCHES.values(), *CLICKS.values()), False)
        self._opened = os.open(topic, os.O_RDONLY | os.O_NOCTTY) if topic else None
        self._input = sys.stdin.fileno() if self._opened is None else self._opened
        if not os.isatty(self._input):
            raise ValueError(
                "the keyboard needs a terminal: run the command in one, or set the topic to one such as /dev/pts/3"
            )
        self._before = termios.tcgetattr(self._input)
        tty.setcbreak(self._input)

    def poll(self, now: float) -> None:
        """Take the keys pressed since, and give where the hand is by now."""
        while select.select([self._input], [], [], 0.0)[0]:
            self._read(os.read(self._input, 64), now)
        self.take(Reading(now, matrix_pose7(self._T), None, dict(self._buttons)))

    def _read(self, data: bytes, now: float) -> None:
        for key in data.decode("ascii", "ignore"):
            self._press(key)
            if key in CLICKS:
                self.take(Reading(now, matrix_pose7(self._T), None, {**self._buttons, CLICKS[key]: True}))

    def _press(self, key: str) -> None:
        T = self._T
        if key in MOVES:
            axis, sign = MOVES[key]
            way = np.zeros(3)
            way[axis] = sign * self._step
            self._T = frame(T[:3, :3], T[:3, 3] + way)
        elif key in TURNS:
            axis, sign = TURNS[key]
            self._T = frame(axis_rotation(np.eye(3)[axis], sign * self._turn) @ T[:3, :3], T[:3, 3])
        elif key in SWITCHES:
            self._buttons[SWITCHES[key]] = not self._buttons[SWITCHES[key]]

    def close(self) -> None:
        """Give the terminal back as it was."""
        termios.tcsetattr(self._input, termios.TCSADRAIN, self._before)
        if self._opened is not None:
            os.close(self._opened)
