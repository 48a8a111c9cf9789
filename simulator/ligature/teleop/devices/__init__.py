"""Input devices, one module each; they are found by the name of their kind.

A kind's module has a class ``Adapter``, made with the name of the topics, the options of the configuration file and
where readings go. Its ``DEFAULTS`` are what the numbers of an uncalibrated device mean, ``OPTIONS`` the options that it
knows, with their defaults.
"""

from __future__ import annotations

import importlib
from types import MappingProxyType
from typing import Any

KINDS = MappingProxyType(
    {
        "mtm": "master arm of the dVRK by CRTK, real or simulated",
        "touch": "Geomagic Touch, Phantom Omni and other pens",
        "hydra": "one paddle of a Razer Hydra",
        "joy": "game controller, sensor_msgs/Joy",
        "spacenav": "3D mouse, sensor_msgs/Joy of spacenav_node",
        "keyboard": "keys of the terminal",
        "mouse": "mouse and keys of the terminal",
    }
)
"""Device adapters by their kind in the configuration file."""


def module(kind: str) -> Any:
    """The module of a kind in `KINDS`."""
    return importlib.import_module(f"ligature.teleop.devices.{kind}")
