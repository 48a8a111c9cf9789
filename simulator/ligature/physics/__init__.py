"""Rigid bodies on Bullet: articulations, springs, controllers, contacts."""

from ligature.physics.quiet import import_quietly

import_quietly("pybullet")

from ligature.physics.world import Controllers, World, failed, failure  # noqa: E402

__all__ = ["Controllers", "World", "failed", "failure"]
