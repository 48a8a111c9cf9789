"""3D mice on ``spacenav/joy`` (`sensor_msgs/Joy` of spacenav_node): six deflections that are speeds of the hand."""

from __future__ import annotations

from typing import Any

from ligature.teleop.calibration import Calibration
from ligature.teleop.devices import joy
from ligature.teleop.devices.device import Take

DEFAULTS = Calibration()
OPTIONS: dict[str, Any] = {**joy.OPTIONS, "moves": ["-1", "-2", "+0"], "turns": ["-4", "-5", "+3"], "timeout": 0.5}
"""The driver's axes are x forward, y left, z up, then turns about these."""


class Adapter(joy.Adapter):
    """A 3D mouse on ``topic``."""

    def __init__(self, topic: str, options: dict[str, Any], take: Take) -> None:
        super().__init__(topic, options, take)
