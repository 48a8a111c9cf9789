"""MJCF, as MuJoCo compiles it, turned into objects of the format."""

from ligature.authoring.mjcf.bodies import from_mjcf

__all__ = ["from_mjcf"]
