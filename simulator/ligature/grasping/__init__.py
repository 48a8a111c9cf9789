"""Attaches bodies rigidly for actuators, and grasps them by friction between the fingers of jaws."""

from ligature.grasping.actuator_attachments import ActuatorAttachments
from ligature.grasping.actuator_grasps import ActuatorGrasps
from ligature.grasping.grasps import NOTHING, Grasps, Held

__all__ = ["NOTHING", "ActuatorAttachments", "ActuatorGrasps", "Grasps", "Held"]
