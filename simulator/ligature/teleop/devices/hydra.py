"""One paddle of a Razer Hydra: ``paddles[i].transform``, ``.buttons``, ``.trigger`` on ``hydra_calib``. Metres."""

from __future__ import annotations

import time
from typing import Any

import numpy as np

from ligature.teleop.calibration import Calibration, axes_of_words
from ligature.teleop.devices.device import Device, Reading, Take
from ligature.teleop.messages import Listener, pose_numbers

DEFAULTS = Calibration(axes=axes_of_words("away", "left", "up"), closed=1.0, opened=0.0)
"""The driver's axes are x forward, y left, z up; a pulled trigger closes."""

OPTIONS: dict[str, Any] = {"paddle": "right"}

PADDLES = {"left": 0, "right": 1}
BUTTONS = ("bumper", "1", "2", "3", "4", "middle", "stick")


class Adapter(Device):
    """The paddle that the option ``paddle`` names, left or right."""

    def __init__(self, topic: str, options: dict[str, Any], take: Take) -> None:
        super().__init__(take)
        if options["paddle"] not in PADDLES:
            raise ValueError(f"paddle is left or right, not '{options['paddle']}'")
        self._paddle = PADDLES[options["paddle"]]
        self._listener = Listener(topic, self._moved)

    def _moved(self, message: Any, sender: str) -> None:
        if len(message.paddles) <= self._paddle:
            return
        paddle = message.paddles[self._paddle]
        buttons = {name: bool(value) for name, value in zip(BUTTONS, paddle.buttons, strict=False)}
        pose = np.array(pose_numbers(paddle))
        self.take(Reading(time.monotonic(), pose, float(paddle.trigger), buttons))

    def close(self) -> None:
        """Listen no more."""
        self._listener.close()
