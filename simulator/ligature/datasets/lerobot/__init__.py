"""Datasets in the formats of LeRobot, v2.1 and v3.0: Parquet, one video for each camera and episode, JSON."""

from ligature.datasets.lerobot.export import FORMATS, export
from ligature.datasets.lerobot.video import CODECS

__all__ = ["CODECS", "FORMATS", "export"]
