"""Holds bodies: rigidly for actuators, by friction between the fingers of jaws."""

from ligature.grasping.clamps import Clamps
from ligature.grasping.grasps import Grasps, Held
from ligature.grasping.holder import Holder

__all__ = ["Clamps", "Grasps", "Held", "Holder"]
