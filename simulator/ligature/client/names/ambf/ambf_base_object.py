"""The name under which scripts import the handle `BaseObject`."""

from ligature.client.base_object import BaseObject

__all__ = ["BaseObject"]
