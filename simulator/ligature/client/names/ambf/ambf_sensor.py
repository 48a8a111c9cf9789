"""The name under which scripts import the handle `Sensor`."""

from ligature.client.sensors import Sensor

__all__ = ["Sensor"]
