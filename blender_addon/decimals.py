"""Numbers as files state them: the shortest decimals that are the same in single precision, in which Blender counts."""

from __future__ import annotations

import numpy as np

from .ligature.authoring.placement import Pose, vector

TINY = 1e-9
"""Numbers below this are the noise of single precision and become zero."""


def decimal(value: float) -> float:
    """The shortest decimal that is this number in single precision."""
    return float(np.format_float_scientific(np.float32(value), unique=True)) + 0.0


def decimals(values) -> tuple[float, ...]:
    """The shortest decimals that are these numbers in single precision."""
    return tuple(decimal(value) for value in values)


def tidy(values) -> tuple[float, ...]:
    """Numbers in short decimals, noise as zero."""
    return tuple(0.0 if abs(v) < TINY else decimal(v) for v in vector(values))


def clean(pose: Pose) -> Pose:
    """A pose in short decimals."""
    position, orientation = ([0.0 if abs(v) < TINY else decimal(v) for v in part] for part in pose)
    return tuple(position), tuple(orientation)
