"""The name under which scripts import the handle `Vehicle`."""

from ligature.client.vehicle import Vehicle

__all__ = ["Vehicle"]
