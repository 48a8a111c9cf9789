"""The name under which scripts import AMBF's client."""

from ligature.client.client import Client

__all__ = ["Client"]
