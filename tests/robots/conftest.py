"""Arms without physics: ideal axes under the real behaviour."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from ligature.robots import psm_arm
from ligature.robots.arm import Arm
from ligature.robots.axes import Axes
from ligature.robots.plant import IdealPlant
from ligature.robots.psm import Psm
from ligature.robots.psm_arm import PsmArm

DT = 1e-3


def ideal_psm(start: np.ndarray | None = None) -> PsmArm:
    kinematics = Psm("LARGE_NEEDLE_DRIVER:420006")
    limits = np.array([kinematics.lower, kinematics.upper])
    at = np.zeros(6) if start is None else start
    joints = Axes(
        kinematics.joint_names, limits, psm_arm.MAX_VELOCITY, psm_arm.MAX_ACCELERATION,
        IdealPlant(limits[0], limits[1], np.full(6, 0.1), np.full(6, 0.5), at),
    )  # fmt: skip
    ends = np.array(kinematics.instrument.jaw).reshape(2, 1)
    plant = IdealPlant(ends[0], ends[1], np.full(1, 0.01), np.full(1, 0.1), np.zeros(1))
    jaw = Axes(("jaw",), ends, [psm_arm.JAW_MAX_VELOCITY], [psm_arm.JAW_MAX_ACCELERATION], plant)
    return PsmArm("PSM1", kinematics, joints, jaw)


def advance(arm: Arm, seconds: float) -> None:
    for _ in range(round(seconds / DT)):
        arm.tick(DT)
        if isinstance(arm.joints.plant, IdealPlant):
            arm.joints.plant.step(DT)


@pytest.fixture
def psm() -> PsmArm:
    """A PSM as it is after start."""
    return ideal_psm()


@pytest.fixture
def ready() -> PsmArm:
    """A PSM that is enabled and homed, its events forgotten."""
    arm = ideal_psm()
    arm.home()
    advance(arm, 3.0)
    assert arm.is_homed and not arm.is_busy
    arm.events.clear()
    return arm


@pytest.fixture
def reported() -> Callable[[Arm, str], list[object]]:
    """Values of an arm's events of one name."""
    return lambda arm, name: [event.value for event in arm.events if event.name == name]
