"""The name under which scripts import the handle `Actuator`."""

from ligature.client.actuator import Actuator

__all__ = ["Actuator"]
