"""The name under which scripts import the handle `RigidBody`."""

from ligature.client.rigid_body import RigidBody

__all__ = ["RigidBody"]
