"""Rigid bodies on Bullet: articulations, springs, controllers, contacts."""

from ligature.physics.world import World

__all__ = ["World"]
