"""The mouse over the terminal: drags move the hand, its wheel takes it away and near. Metres, radians.

A drag with the left button moves right and down, one with the right button turns about the axes down and right, as if
the hand were rolled under the mouse. The middle button is a button; the keys are those of the `keyboard`. Terminals
report a mouse by the cell that it is over (xterm's SGR mode, which all common ones have).
"""

from __future__ import annotations

import os
import re
from typing import Any

import numpy as np

from ligature.model.frames import axis_rotation, frame, matrix_pose7
from ligature.teleop.calibration import Calibration
from ligature.teleop.devices import keyboard
from ligature.teleop.devices.device import Reading, Take

DEFAULTS = Calibration()
OPTIONS: dict[str, Any] = {"step": 0.005, "turn": 0.05, "cell": 0.002, "roll": 0.02, "notch": 0.005}
"""Metres for a key, radians for a key; metres and radians for a cell that the mouse is dragged over, metres for a notch
of its wheel."""

REPORT_ON, REPORT_OFF = b"\x1b[?1002h\x1b[?1006h", b"\x1b[?1006l\x1b[?1002l"
REPORT = re.compile(rb"\x1b\[<(\d+);(\d+);(\d+)([Mm])")
BEGUN = re.compile(rb"\x1b(\[(<[\d;]{0,20})?)?\Z")
"""The beginning of a report whose end has not arrived."""

MOTION, WHEEL, MODIFIERS = 32, 64, 4 + 8 + 16
LEFT, MIDDLE, RIGHT = 0, 1, 2


class Adapter(keyboard.Adapter):
    """Mouse and keys of standard input's terminal, or of ``topic`` such as ``/dev/pts/3``."""

    def __init__(self, topic: str, options: dict[str, Any], take: Take) -> None:
        super().__init__(topic, options, take)
        self._cell, self._roll, self._notch = options["cell"], options["roll"], options["notch"]
        self._buttons["middle"] = False
        self._at: tuple[int, int] | None = None
        self._rest = b""
        self._output = os.open(os.ttyname(self._input), os.O_WRONLY | os.O_NOCTTY)
        os.write(self._output, REPORT_ON)

    def _read(self, data: bytes, now: float) -> None:
        data = self._rest + data
        at = 0
        for report in REPORT.finditer(data):
            super()._read(data[at : report.start()], now)
            at = report.end()
            code, column, row = (int(number) for number in report.group(1, 2, 3))
            self._report(code & ~MODIFIERS, (column, row), report[4] == b"M", now)
        begun = BEGUN.search(data, at)
        end = len(data) if begun is None else begun.start()
        self._rest = data[end:]
        super()._read(data[at:end], now)

    def _report(self, code: int, place: tuple[int, int], pressed: bool, now: float) -> None:
        """Take a report of the mouse: a button or a notch, or with `MOTION` a drag to a cell (column, row)."""
        if code & WHEEL:
            self._move(np.array([0.0, 0.0, self._notch if code == WHEEL else -self._notch]))
        elif code & MOTION and self._at is not None:
            right, down = place[0] - self._at[0], 2 * (place[1] - self._at[1])  # a cell is twice as high as wide
            if code == MOTION + LEFT:
                self._move(self._cell * np.array([right, down, 0.0]))
            elif code == MOTION + RIGHT:
                self._turn_by(self._roll * np.array([-down, right, 0.0]))
        elif code == MIDDLE:
            self._buttons["middle"] = pressed
            self.take(Reading(now, matrix_pose7(self._T), None, dict(self._buttons)))
        self._at = place if pressed else None

    def _move(self, way: Any) -> None:
        self._T = frame(self._T[:3, :3], self._T[:3, 3] + way)

    def _turn_by(self, turn: Any) -> None:
        angle = float(np.linalg.norm(turn))
        if angle > 0.0:
            self._T = frame(axis_rotation(turn / angle, angle) @ self._T[:3, :3], self._T[:3, 3])

    def close(self) -> None:
        """Give mouse and terminal back as they were."""
        os.write(self._output, REPORT_OFF)
        os.close(self._output)
        super().close()
