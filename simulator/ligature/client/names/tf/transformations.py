"""The conversions that AMBF 2.0 imports under this name.

Quaternions are x, y, z, w, unlike those of the package of that name on PyPI.
"""

from ligature.client.euler import euler_from_quaternion, quaternion_from_euler

__all__ = ["euler_from_quaternion", "quaternion_from_euler"]
