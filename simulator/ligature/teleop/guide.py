"""The guided calibration of a device: three motions and a squeeze show its axes and its grip. Metres, radians."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from ligature.teleop.calibration import Calibration, Unclear, axes_of_motions, pose_of
from ligature.teleop.config import TeleopConfig
from ligature.teleop.devices import module
from ligature.teleop.devices.device import Device, Reading

Array = NDArray[np.float64]

TIMEOUT = 5.0
SETTLED = 0.3
"""Seconds over which the median of a device that rests is taken."""


class Ear:
    """Hears a device while the operator holds still."""

    def __init__(self) -> None:
        self.readings: list[Reading] = []
        self.device: Device | None = None

    def rest(self) -> tuple[Array, float | None]:
        """Where the handle is, (3,), and its grip; raises `Unclear` when the device sends nothing sensible."""
        self.readings.clear()
        end = time.monotonic() + TIMEOUT
        while time.monotonic() < end:
            time.sleep(SETTLED)
            if self.device is not None:
                self.device.poll(time.monotonic())
            poses = [pose_of(reading.pose) for reading in list(self.readings)]
            places = np.array([T[:3, 3] for T in poses if np.isfinite(T).all()])
            if len(places):
                grips = [reading.grip for reading in list(self.readings) if reading.grip is not None]
                return np.median(places, axis=0), float(np.median(grips)) if grips else None
        raise Unclear(f"the device sent nothing for {TIMEOUT:g} s, or no poses; is its driver running?")


def calibration_of(config: TeleopConfig, name: str, ask: Callable[[str], str], show: Callable[[str], None]) -> str:
    """Ask the operator to move a device; returns the YAML lines for its block in the configuration.

    Raises `Unclear` for an unknown device.
    """
    if name not in config.devices:
        raise Unclear(f"unknown device '{name}'; choose one of {', '.join(config.devices)}")
    spec, ear = config.devices[name], Ear()
    ear.device = module(spec.kind).Adapter(spec.topic, dict(spec.options), ear.readings.append)
    assert ear.device is not None
    try:
        ask(f"Hold {name} in the middle of where you will work, grip open, and press Enter. ")
        middle, opened = ear.rest()
        ask("Move it 10 cm to your right, hold still, and press Enter. ")
        right, _ = ear.rest()
        ask("Back to the middle, then 10 cm up, hold still, and press Enter. ")
        up, _ = ear.rest()
        ask("Close the grip, hold still, and press Enter. ")
        _, closed = ear.rest()
    finally:
        ear.device.close()
    axes = axes_of_motions(right - middle, up - middle)
    before = spec.calibration
    grips = (before.closed, before.opened)
    if opened is not None and closed is not None and abs(opened - closed) > 1e-3:
        grips = (closed, opened)
    show(f"Write this into the block of {name}:")
    return Calibration(axes, before.handle, *grips).text()
