"""The name under which scripts import the handle `World`."""

from ligature.client.world import World

__all__ = ["World"]
