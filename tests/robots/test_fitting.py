"""Which known arm a scene has: by the lengths of its links, whatever the instrument is called."""

from __future__ import annotations

import dataclasses
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.frames import inverse
from ligature.model.scene import ArmDescription, ArmKind, Scene
from ligature.robots.fitting import (
    ALIKE,
    DEFAULT_TOOL,
    base_pose,
    console_pose,
    kinematics_of,
    master_side,
    psm_kinematics,
)
from ligature.robots.instruments import instrument

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


@pytest.fixture(scope="module")
def scene() -> Scene:
    return ligature.load(SMALL)


@pytest.fixture(params=[0, 1])
def psm(scene: Scene, request: pytest.FixtureRequest) -> ArmDescription:
    return [arm for arm in scene.arms if arm.kind is ArmKind.PSM][request.param]


@pytest.mark.parametrize("share", [-3.0, -1.1, -0.8, 0.8, 1.1, 3.0])
def test_an_arm_whose_insertion_begins_elsewhere_is_known_only_within_rounding(
    scene: Scene, psm: ArmDescription, share: float
) -> None:
    usual = psm_kinematics(scene, psm)[0].lengths
    insertion = scene.joints[psm.joints[2]]
    along = scene.bodies[insertion.parent].T_body_inertial[:3, :3] @ insertion.axis
    T = insertion.T_parent_child_zero.copy()
    T[:3, 3] += share * ALIKE * along
    joints = list(scene.joints)
    joints[insertion.index] = dataclasses.replace(insertion, T_parent_child_zero=T)
    lengths = psm_kinematics(dataclasses.replace(scene, joints=tuple(joints)), psm)[0].lengths
    changed = 0.0 if abs(share) < 1.0 else -share * ALIKE
    assert lengths.tool_to_rcm == pytest.approx(usual.tool_to_rcm + changed, abs=1e-5 if changed else 0.0)
    assert lengths.wrist == pytest.approx(usual.wrist, abs=1e-5 if changed else 0.0)


def test_an_unknown_instrument_is_reported_and_the_usual_one_taken(scene: Scene, psm: ArmDescription) -> None:
    arm, problem = psm_kinematics(scene, dataclasses.replace(psm, tool="nonsense"))
    assert "nonsense" in problem and problem.endswith(f"; using {instrument(DEFAULT_TOOL).type}")
    for tool in ("", DEFAULT_TOOL):
        usual, problem = psm_kinematics(scene, dataclasses.replace(psm, tool=tool))
        assert problem == "" and usual.lengths == arm.lengths
        np.testing.assert_array_equal(usual.lower, arm.lower)


def test_masters_stand_to_both_sides_of_the_view() -> None:
    assert [master_side(name) for name in ("MTML", "mtml", "MTMR", "left MTM")] == ["left", "left", "right", "right"]
    left, right = console_pose("left"), console_pose("right")
    np.testing.assert_allclose(left[:3, 3], (0.18, 0.4, 0.475))
    np.testing.assert_allclose(right[:3, 3], (-0.18, 0.4, 0.475))
    np.testing.assert_allclose(left[:3, :3], right[:3, :3])


def test_a_base_is_where_the_scene_has_it_or_where_its_camera_needs_it(scene: Scene) -> None:
    for arm in scene.arms:
        T = base_pose(scene, arm)
        if arm.kind is ArmKind.PSM:
            np.testing.assert_array_equal(T, scene.bodies[arm.base].T_world_body)
        np.testing.assert_allclose(T @ inverse(T), np.eye(4), atol=1e-12)
        assert kinematics_of(scene, arm).n >= 4
