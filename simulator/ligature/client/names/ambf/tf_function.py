"""The conversions that AMBF 3.0 imports under this name; quaternions x, y, z, w."""

from ligature.client.euler import euler_from_quaternion, quaternion_from_euler

__all__ = ["euler_from_quaternion", "quaternion_from_euler"]
