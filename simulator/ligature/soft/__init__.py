"""Bodies of soft tissue among needles, threads and rigid bodies: each tick the simulation couples them."""

from ligature.soft.tissues import BeforeRods, Tissues

__all__ = ["BeforeRods", "Tissues"]
