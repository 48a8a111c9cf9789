"""Poses, twists and rotations as arms need them: small functions on (4, 4) matrices. Metres, radians."""

from __future__ import annotations

import math
import reprlib

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ligature.model.frames import pose7_matrix
from ligature.robots.operating_state import Rejected

Array = NDArray[np.float64]


def numbers_of(values: ArrayLike, what: str) -> Array:
    """``values`` as an array of its own; raises `Rejected` where they are no numbers."""
    try:
        array = np.array(values)
        if array.dtype.kind == "c":
            raise TypeError("complex numbers")
        return array.astype(float, copy=False)
    except (TypeError, ValueError, OverflowError) as error:
        raise Rejected(f"{what} takes numbers, not {reprlib.repr(values)}") from error


def pose_matrix_of(pose: ArrayLike, what: str) -> Array:
    """A pose, (7,) or (4, 4), as (4, 4); raises `Rejected` for anything else."""
    values = numbers_of(pose, what)
    if not np.isfinite(values).all():
        raise Rejected(f"{what} takes finite numbers")
    if values.shape == (4, 4):
        return values
    if values.shape != (7,):
        raise Rejected(f"{what} takes a pose x y z qx qy qz qw or a (4, 4) matrix, not the shape {values.shape}")
    length = float(np.linalg.norm(values[3:]))
    if not 0.9 <= length <= 1.1:
        raise Rejected(f"{what}: the quaternion has the length {length:.3g}; it must be 1")
    values[3:] /= length
    return pose7_matrix(values)


def turned(rotation: Array, vector: Array) -> Array:
    """A twist or wrench (6,) with both halves turned by ``rotation`` (3, 3)."""
    return np.concatenate([rotation @ vector[:3], rotation @ vector[3:]])


def rotation_vector(R: Array) -> Array:
    """Axis times angle (3,) of a rotation (3, 3), the angle within 0 … pi."""
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / 2.0
    sine, cosine = float(np.linalg.norm(axis)), (float(np.trace(R)) - 1.0) / 2.0
    if sine > 1e-9:
        return np.asarray(axis * (math.atan2(sine, cosine) / sine))
    if cosine > 0.0:
        return axis
    values, vectors = np.linalg.eigh((R + R.T) / 2.0)
    return np.asarray(np.pi * vectors[:, int(np.argmax(values))])
