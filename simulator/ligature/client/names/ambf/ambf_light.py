"""The name under which scripts import the handle `Light`."""

from ligature.client.placed import Light

__all__ = ["Light"]
