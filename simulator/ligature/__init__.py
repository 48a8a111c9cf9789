"""Ligature: an open simulator for robot-assisted suturing."""

from ligature.in_process import Simulation
from ligature.model.load import SceneError, load
from ligature.model.scene import Scene

__version__ = "0.1.0"

__all__ = ["Scene", "SceneError", "Simulation", "load"]
