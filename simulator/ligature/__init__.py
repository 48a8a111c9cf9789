"""Ligature: an open simulator for robot-assisted suturing."""

__version__ = "0.1.0"
