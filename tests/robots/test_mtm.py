"""Inverse kinematics of the master manipulators: seven joints for six coordinates."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import frame, quaternion_matrix
from ligature.robots.mtm import ELBOW_TO_WRIST, UPPER_ARM, Mtm

from tests.robots.poses import assert_same_pose


@pytest.fixture(params=["left", "right"])
def mtm(request: pytest.FixtureRequest) -> Mtm:
    return Mtm(request.param)


def random_joints(mtm: Mtm, count: int) -> np.ndarray:
    return np.random.default_rng(5).uniform(mtm.lower, mtm.upper, (count, 7))


@pytest.mark.machine_code
def test_the_inverse_undoes_the_forward_for_100000_poses(mtm):
    q = random_joints(mtm, 100_000)
    T = mtm.forward(q)
    freely, near = mtm.inverse(T), mtm.inverse(T, q)
    assert freely.ok.all()
    assert (freely.q >= mtm.lower - 1e-9).all()
    assert (freely.q <= mtm.upper + 1e-9).all()
    assert_same_pose(mtm.forward(freely.q), T)
    np.testing.assert_allclose(near.q, q, rtol=0, atol=1e-9)


def test_the_platform_stays_at_the_seed_where_the_wrist_allows_it(mtm):
    q = random_joints(mtm, 2000)
    seed = np.zeros(7)
    seed[3] = 0.3
    result = mtm.inverse(mtm.forward(q), seed)
    held = np.abs(result.q[:, 3] - 0.3) < 1e-12
    assert 0.1 < held.mean() < 1.0
    for k in np.flatnonzero(~held)[:200]:
        # a platform anywhere closer leaves the limits of the wrist
        for platform in np.linspace(0.3, result.q[k, 3], 20)[1:-1]:
            closer = seed.copy()
            closer[3] = platform
            assert abs(mtm.inverse(mtm.forward(q[k]), closer).q[3] - platform) > 1e-9


def test_joints_follow_a_slow_motion_without_a_jump(mtm):
    middle = 0.5 * (mtm.lower + mtm.upper)
    seed = middle.copy()
    for step in range(500):
        target = middle + 0.2 * np.sin(0.01 * step + np.arange(7))
        result = mtm.inverse(mtm.forward(target), seed if step else target)
        assert result.ok
        if step:
            assert np.abs(result.q - seed).max() < 0.05
        seed = result.q


@pytest.mark.parametrize("reach", [UPPER_ARM + ELBOW_TO_WRIST + 1e-3, 3.0])
def test_a_pose_beyond_the_stretched_arm_is_unreachable(mtm, reach):
    result = mtm.inverse(frame(np.eye(3), (0.0, -reach, 0.0)))
    assert (result.ok, result.reason) == (False, "unreachable")
    assert np.isnan(result.q).all()


def test_a_pose_inside_the_folded_arm_is_unreachable(mtm):
    assert mtm.inverse(frame(np.eye(3), (0.0, -0.05, 0.0))).reason == "unreachable"


def test_a_wrist_on_the_axis_of_the_outer_yaw_is_singular(mtm):
    assert mtm.inverse(frame(np.eye(3), (0.0, 0.0, 0.4))).reason == "singular"


@pytest.mark.parametrize("joint", range(3))
def test_a_place_beyond_one_limit_names_the_joint(mtm, joint):
    q = 0.5 * (mtm.lower + mtm.upper)
    q[joint] = mtm.upper[joint] + 0.01
    result = mtm.inverse(mtm.forward(q), q)
    assert (result.reason, result.joint) == ("outside limits", joint)
    np.testing.assert_allclose(result.q[:3], q[:3], atol=1e-12)


def test_the_wrist_gives_every_orientation(mtm):
    T = np.tile(mtm.forward(0.5 * (mtm.lower + mtm.upper)), (20_000, 1, 1))
    T[:, :3, :3] = [quaternion_matrix(v / np.linalg.norm(v)) for v in np.random.default_rng(6).normal(size=(20_000, 4))]
    result = mtm.inverse(T)
    assert result.ok.all()
    assert_same_pose(mtm.forward(result.q), T)


def test_a_roll_axis_along_the_platform_axis_is_met_with_the_platform_of_the_seed(mtm):
    q = 0.5 * (mtm.lower + mtm.upper)
    q[4] = np.pi / 2  # the roll axis then turns with the platform: any platform angle serves
    T = mtm.forward(q * [1, 1, 1, 1, 1, 0, 1])
    result = mtm.inverse(T)
    assert result.ok
    assert_same_pose(mtm.forward(result.q), T)


def test_what_is_no_pose_has_no_joints(mtm):
    result = mtm.inverse(np.diag([1.0, 1.0, -1.0, 1.0]))
    assert result.reason == "not a rigid pose within 1000 km"


def test_left_and_right_differ_in_their_limits_only():
    left, right = Mtm("left"), Mtm("right")
    q = np.linspace(-0.2, 0.3, 7)
    np.testing.assert_array_equal(left.forward(q), right.forward(q))
    assert left.lower[3] == -right.upper[3]
    with pytest.raises(ValueError, match="'middle' is not a side of the console; use 'left' or 'right'"):
        Mtm("middle")
