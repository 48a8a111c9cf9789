"""The name under which scripts import the handle `Camera`."""

from ligature.client.placed import Camera

__all__ = ["Camera"]
