"""The name under which scripts import the handle `Object`."""

from ligature.client.legacy import Object

__all__ = ["Object"]
