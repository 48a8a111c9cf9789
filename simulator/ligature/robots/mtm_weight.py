"""What the motors of a master arm bear: its weight with the springs that balance it, and their largest efforts.

Radians, N·m. The numbers are those of one real arm, MTMR 31519, as its laboratory identified them (`gc-MTMR-31519.json`
of sawIntuitiveResearchKit) by the method of Lin et al., *A reliable gravity compensation control strategy for dVRK
robotic arms with nonlinear disturbance forces*, IEEE RA-L 4, 2019. Friction and cables, and the weight of the wrist,
below 0.2 N·m, are left out.
"""

from __future__ import annotations

from math import cos, sin

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

GRAVITY = 9.81

UPPER_ARM_MOMENT = (-0.68178, 0.16363)
"""Mass times distance in kg·m of what turns with the shoulder, along and across the upper arm."""

FOREARM_MOMENT = (0.02505, 0.00960)
"""The same of what turns with the elbow, along and across the forearm."""

SPRING = (-1.33154, 7.16606)
"""Torque in N·m of the balancing spring at the shoulder, and its stiffness in N·m/rad."""

MAX_EFFORT = np.array([1.86082986, 3.21661506, 1.95978284, 0.30901338, 0.09684378, 0.09684378, 0.02287592])
"""Largest effort of each joint's motor in N·m (`ftmax` of `mtmr.json` of sawIntuitiveResearchKit)."""


def weight(q: Array) -> Array:
    """Efforts (7,) that hold the arm still at the joint values ``q`` (7,)."""
    shoulder, forearm = float(q[1]), float(q[1] + q[2])
    on_elbow = GRAVITY * (FOREARM_MOMENT[0] * cos(forearm) - FOREARM_MOMENT[1] * sin(forearm))
    on_shoulder = GRAVITY * (UPPER_ARM_MOMENT[0] * sin(shoulder) + UPPER_ARM_MOMENT[1] * cos(shoulder))
    efforts = np.zeros(7)
    efforts[1] = on_shoulder + on_elbow + SPRING[0] + SPRING[1] * shoulder
    efforts[2] = on_elbow
    return efforts
