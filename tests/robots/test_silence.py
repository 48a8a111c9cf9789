"""What every kind of arm does when the stream of a command ends: as on the dVRK, no watchdog lets go of an arm.

Positions and efforts stay, velocities end. Radians, metres, N, N m.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from ligature.robots import ecm_arm, mtm_arm, psm_arm
from ligature.robots.arm import Arm
from ligature.robots.axes import STREAM_SECONDS, Axes, Mode
from ligature.robots.commands import VERBS, ArmCommand, ServoCi, ServoCs
from ligature.robots.ecm import Ecm
from ligature.robots.ecm_arm import EcmArm
from ligature.robots.mtm import Mtm
from ligature.robots.mtm_arm import MtmArm
from ligature.robots.plant import IdealPlant

from tests.robots.conftest import advance, ideal_psm

SILENT = 0.6
"""Simulated seconds without a command: longer than any time-out."""


def ideal_ecm() -> EcmArm:
    chain = Ecm()
    limits = np.array([chain.lower, chain.upper])
    plant = IdealPlant(limits[0], limits[1], np.full(4, 0.1), np.full(4, 0.5), ecm_arm.HOME.copy())
    joints = Axes(chain.joint_names, limits, ecm_arm.MAX_VELOCITY, ecm_arm.MAX_ACCELERATION, plant)
    return EcmArm("ECM", chain, joints)


def ideal_mtm() -> MtmArm:
    chain = Mtm("left")
    limits = np.array([chain.lower, chain.upper])
    plant = IdealPlant(limits[0], limits[1], mtm_arm.INERTIA, mtm_arm.DAMPING, np.zeros(7))
    joints = Axes(chain.joint_names, limits, mtm_arm.MAX_VELOCITY, mtm_arm.MAX_ACCELERATION, plant)
    ends = mtm_arm.GRIPPER_LIMITS
    fingers = IdealPlant(ends[0], ends[1], np.full(1, 1e-3), np.full(1, 1e-2), np.zeros(1))
    return MtmArm("MTML", chain, joints, Axes(("gripper",), ends, np.full(1, 20.0), np.full(1, 200.0), fingers))


ARMS: dict[str, Callable[[], Arm]] = {"PSM": lambda: ideal_psm(psm_arm.HOME.copy()), "ECM": ideal_ecm, "MTM": ideal_mtm}
STAYS = ("servo_jp", "servo_cp", "jaw/servo_jp", "direct/servo_jp", "direct/servo_cp", "direct/jaw/servo_jp")
ENDS = ("servo_jv", "servo_cv", "direct/servo_jv")
PUSHES = ("servo_jf", "jaw/servo_jf", "spatial/servo_cf", "body/servo_cf", "servo_ci", "servo_cs")
STREAMED = sorted(verb for verb, command in VERBS.items() if command.streamed)


def test_every_streamed_verb_is_tried() -> None:
    assert sorted((*STAYS, *ENDS, *PUSHES)) == STREAMED


def command_of(verb: str, arm: Arm, rng: np.random.Generator) -> ArmCommand:
    """A command that the arm takes where it is."""
    kind = VERBS[verb]
    if kind is ServoCs:
        return ServoCs(0, None, None, tuple(rng.normal(0.0, 0.05, 6)))
    if kind is ServoCi:
        rest, none = tuple(arm.measured_cp()[:3]), (0.0,) * 4
        return ServoCi(0, rest, none, none, *[(-5.0,) * 3 + (-0.5,) * 3 + (0.0,) * 6] * 4)
    n = 1 if "jaw" in verb else arm.joints.n
    pose = arm.local_setpoint_cp() if "direct" in verb else arm.setpoint_cp()
    pose[:3] += rng.normal(0.0, 1e-3, 3)
    values = {
        "position": rng.normal(0.0, 0.01, n) + (0.3 if n == 1 else arm.setpoint_js().position),
        "velocity": rng.normal(0.0, 0.02, n), "effort": rng.normal(0.0, 0.01, n), "pose": pose,
        "twist": rng.normal(0.0, 0.005, 6), "wrench": rng.normal(0.0, 0.05, 6),
    }  # fmt: skip
    (name,) = (name for name, _, _ in kind.fields()[1:2])
    extra = {"velocity": tuple(rng.normal(0.0, 0.1, n))} if verb == "servo_jp" and rng.random() < 0.5 else {}
    return kind(0, **{name: tuple(np.asarray(values[name]).tolist())}, **extra)


@pytest.mark.parametrize(
    ("kind", "verb"),
    [(kind, verb) for kind in ARMS for verb in STREAMED if VERBS[verb].kind is None or VERBS[verb].kind.name == kind],
)
def test_a_stream_that_ends_leaves_the_arm_as_the_dvrk_does(kind: str, verb: str) -> None:
    rng = np.random.default_rng(STREAMED.index(verb))
    arm: Any = ARMS[kind]()
    arm.adopt()
    axes = arm.jaw.axes if "jaw" in verb else arm.joints
    for _ in range(20):
        command_of(verb, arm, rng).carry_out(arm)
        advance(arm, 0.005)
    last = axes.setpoint.copy()
    advance(arm, STREAM_SECONDS + 0.05)
    soon = axes.setpoint.copy()
    advance(arm, SILENT)
    later = axes.setpoint.copy()
    assert arm.is_enabled and not arm.is_busy
    if verb in PUSHES:
        assert axes.mode is Mode.EFFORT
        if verb.endswith("servo_jf"):
            np.testing.assert_array_equal(later[2], last[2])
        else:
            assert later[2].any()
        return
    assert axes.mode is Mode.POSITION
    np.testing.assert_array_equal(later[1], 0.0)
    np.testing.assert_array_equal(later[0], soon[0])
    if verb in STAYS:
        np.testing.assert_array_equal(later[0], last[0])
    else:
        moved = np.abs(later[0] - last[0])
        assert moved.any() and (moved <= np.abs(last[1]) * (STREAM_SECONDS + 2e-3) + 1e-12).all()
