"""The name under which scripts import the handle `ContactSensor`."""

from ligature.client.sensors import ContactSensor

__all__ = ["ContactSensor"]
