"""Bends that stay in a thread: what a joint bends or twists beyond its yield moment becomes its rest.

Perfect plasticity by radial return (Simo, Hughes, Computational Inelasticity, 1998, §3.3): bending and twist yield
where their moment together reaches one limit. A thread that slides out of a knot is bent and straightened on the way,
which takes work, and a knot that is set does not spring open: beside friction, both hold surgical knots (Johanns et
al., The strength of surgical knots involves a critical interplay between friction and elastoplasticity, Science
Advances 9, 2023).
"""

from __future__ import annotations

import math

from ligature.kernels import kernel
from ligature.suture.layout import Joints


@kernel
def set_bends(joints: Joints) -> None:
    """Move the rest of every joint that bears more than its yield moment, until it bears that."""
    for j in range(joints.yields.shape[0]):
        most = joints.yields[j]
        if most == math.inf:
            continue
        square = 0.0
        for a in range(3):
            if joints.low[j, a] != joints.high[j, a]:
                square += (joints.stiffness[j, a] * (joints.angle[j, a] - joints.rest[j, a])) ** 2
        if square <= most * most:
            continue
        flown = 1.0 - most / math.sqrt(square)
        for a in range(3):
            if joints.low[j, a] != joints.high[j, a]:
                joints.rest[j, a] += flown * (joints.angle[j, a] - joints.rest[j, a])
