"""The name under which scripts of AMBF 3.0 import the node."""

from ligature.client.layer import ral

__all__ = ["ral"]
