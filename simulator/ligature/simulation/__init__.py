"""The simulation in process: the tick, the Python API, snapshots and the state hash."""

from ligature.simulation.simulation import Simulation, Snapshot
from ligature.simulation.ticking import PHASES

__all__ = ["PHASES", "Simulation", "Snapshot"]
