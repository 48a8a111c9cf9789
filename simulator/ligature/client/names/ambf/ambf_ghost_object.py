"""The name under which scripts import the handle `GhostObject`."""

from ligature.client.sensors import GhostObject

__all__ = ["GhostObject"]
