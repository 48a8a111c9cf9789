"""Datasets to learn from: pictures, depth, ids, motion and phases of simulated work, as HDF5 and for LeRobot."""

from ligature.datasets.store import DatasetError
from ligature.datasets.writer import DatasetWriter

__all__ = ["DatasetError", "DatasetWriter"]
