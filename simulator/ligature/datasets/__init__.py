"""Datasets to learn from: pictures, depth, ids, motion and phases of simulated work, in one HDF5 file."""

from ligature.datasets.writer import DatasetError, DatasetWriter

__all__ = ["DatasetError", "DatasetWriter"]
