"""The arms of a scene, bound to its physics: which joints they drive, and how long their links are.

World axes, metres, radians.
"""

from ligature.arms.arm_set import ArmSet

__all__ = ["ArmSet"]
