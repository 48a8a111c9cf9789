"""Inverse kinematics of the endoscope manipulator and of the challenge's camera."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.frames import axis_rotation, frame
from ligature.robots.ecm import ENDOSCOPES, LIMITS, OFF_THE_LINE, Ecm, SrcCamera

from tests.robots.poses import assert_same_pose, distances

Q = np.array([0.3, -0.2, 0.12, 0.4])


ANGLE = st.floats(-np.pi, np.pi)
PUBLISHED = {
    "Classic": [(-1.5708, 1.5708), (-0.76794, 1.1344), (0.0, 0.255), (-1.552, 1.552)],
    "Si": [(-2.964, 2.964), (-1.10, 1.04), (0.001, 0.259), (-1.54, 1.54)],
}
"""Limits in ECM.json of the dVRK's software 2.4, and of its Si version."""


def tilted(T, angle, way):
    """``T`` with the line of sight turned by ``angle``, towards the direction ``way`` of the picture."""
    return T @ frame(axis_rotation((np.cos(way), np.sin(way), 0.0), angle), (0.0, 0.0, 0.0))


@pytest.mark.parametrize("model", PUBLISHED)
def test_limits_are_the_published_ones(model):
    ecm = Ecm(model=model)
    assert list(zip(ecm.lower, ecm.upper, strict=True)) == PUBLISHED[model]


def test_limits_of_the_challenges_camera_are_those_of_its_program():
    camera = SrcCamera()
    assert (-camera.lower).tolist() == camera.upper.tolist() == [1.5, 1.5, 0.1, 1.57]


@pytest.mark.machine_code
@pytest.mark.parametrize("endoscope", ENDOSCOPES)
@pytest.mark.parametrize("model", LIMITS)
def test_the_inverse_undoes_the_forward_for_100000_poses(endoscope, model):
    ecm = Ecm(endoscope, model)
    lower = np.maximum(ecm.lower, [-10, -10, ecm.insertion_at(1e-3), -10])
    q = np.random.default_rng(3).uniform(lower, ecm.upper, (100_000, 4))
    result = ecm.inverse(ecm.forward(q))
    assert result.ok.all()
    assert result.residual.max() < 1e-9
    np.testing.assert_allclose(result.q, q, rtol=0, atol=1e-9)


def test_an_orientation_that_four_joints_cannot_give_is_met_as_closely_as_they_can():
    ecm = Ecm()
    T = ecm.forward(Q) @ frame(axis_rotation((1.0, 0.0, 0.0), 0.25), (0.0, 0.0, 0.0))
    result = ecm.inverse(T)
    assert result.ok
    metres, radians = distances(ecm.forward(result.q), T)
    assert metres < 1e-12
    assert radians == pytest.approx(result.residual, abs=1e-9) == pytest.approx(0.25, abs=1e-9)
    for nudge in (-1e-3, 1e-3):
        assert distances(ecm.forward(result.q + [0, 0, 0, nudge]), T)[1] > result.residual


@pytest.mark.parametrize("joint", range(4))
@pytest.mark.parametrize("end", ["lower", "upper"])
def test_a_pose_beyond_one_limit_names_the_joint(joint, end):
    ecm = Ecm("Custom_STRAIGHT")
    q = Q.copy()
    q[joint] = getattr(ecm, end)[joint] + (0.01 if end == "upper" else -0.01)
    result = ecm.inverse(ecm.forward(q))
    assert (result.ok, result.reason, result.joint) == (False, "outside limits", joint)
    np.testing.assert_allclose(result.q, q, atol=1e-12)


@given(st.integers(0, 3), st.sampled_from(["lower", "upper"]), st.floats(0.05, 1.5), ANGLE)
def test_a_limit_is_named_though_the_orientation_is_not_met_either(joint, end, angle, way):
    ecm = Ecm("Custom_STRAIGHT")
    q = Q.copy()
    q[joint] = getattr(ecm, end)[joint] + (0.01 if end == "upper" else -0.01)
    result = ecm.inverse(tilted(ecm.forward(q), angle, way))
    assert (result.reason, result.joint) == ("outside limits", joint)
    assert result.residual == pytest.approx(angle, abs=1e-9)


@given(st.floats(0.05, np.pi - 0.05).filter(lambda a: abs(a - np.pi / 2) > 0.05), ANGLE)
def test_a_tip_above_the_remote_centre_counts_where_it_comes_closer_to_the_orientation(angle, way):
    """Below the centre the shaft points the other way: it leaves the rest of half a turn, out of the yaw's limits."""
    ecm = Ecm()
    above = ecm.forward([0.3, 0.2, ecm.insertion_at(-0.02), 0.1])
    result = ecm.inverse(tilted(above, angle, way))
    if angle < np.pi / 2:
        assert (result.reason, result.joint, result.residual) == ("above the remote centre", -1, 0.0)
        assert np.isnan(result.q).all()
    else:
        assert (result.reason, result.joint) == ("outside limits", 0)
        assert result.residual == pytest.approx(np.pi - angle, abs=1e-9)


def test_a_tip_above_the_remote_centre_is_answered_as_such():
    ecm = Ecm()
    result = ecm.inverse(ecm.forward([0.3, 0.2, ecm.insertion_at(-0.02), 0.1]))
    assert result.reason == "above the remote centre"
    assert np.isnan(result.q).all()


def test_singular_poses_have_no_joints():
    ecm = Ecm()
    at_the_centre = ecm.forward([0.3, 0.2, ecm.insertion_at(0.0), 0.1])
    looking_back = ecm.forward(Q) @ frame(axis_rotation((1.0, 0.0, 0.0), np.pi), (0.0, 0.0, 0.0))
    result = ecm.inverse(np.array([at_the_centre, looking_back]))
    assert result.reason.tolist() == ["singular", "singular"]
    assert np.isnan(result.q).all()


@pytest.mark.parametrize("arm", [Ecm(), SrcCamera()], ids=["ECM", "challenge camera"])
def test_what_is_no_pose_has_no_joints(arm):
    result = arm.inverse(np.full((4, 4), np.nan))
    assert (result.reason, result.joint) == ("not a rigid pose within 1000 km", -1)
    assert np.isnan(result.q).all()


def test_at_zero_the_endoscope_looks_down_the_shaft():
    T = Ecm().forward(np.zeros(4))
    np.testing.assert_allclose(T[:3, :3], np.diag([1.0, -1.0, -1.0]), atol=1e-15)


def test_an_endoscope_or_a_model_that_does_not_exist_is_refused():
    with pytest.raises(ValueError, match="unknown endoscope 'ERROR'; choose one of Classic_SD_STRAIGHT, "):
        Ecm("ERROR")
    with pytest.raises(ValueError, match="unknown ECM model 'Xi'; choose one of Classic, Si"):
        Ecm(model="Xi")


@pytest.mark.machine_code
def test_the_camera_of_the_challenge_inverts_for_100000_poses():
    camera = SrcCamera()
    q = np.random.default_rng(4).uniform(camera.lower, camera.upper, (100_000, 4))
    result = camera.inverse(camera.forward(q))
    assert result.ok.all()
    np.testing.assert_allclose(result.q, q, rtol=0, atol=1e-9)


def test_the_camera_of_the_challenge_moves_forward_along_its_line_of_sight_only():
    camera = SrcCamera()
    np.testing.assert_allclose(camera.forward([0, 0, 0.05, 0]), frame(np.eye(3), (0, 0, -0.05)), atol=1e-15)
    T = frame(np.eye(3), (0.01, 0.0, -0.05))
    assert camera.inverse(T).reason == "unreachable"
    beyond = camera.inverse(camera.forward([0, 0, 0.11, 0]))
    assert (beyond.reason, beyond.joint) == ("outside limits", 2)
    assert_same_pose(camera.forward(beyond.q), camera.forward([0, 0, 0.11, 0]))


@given(st.tuples(*[st.floats(-1.0, 1.0)] * 4), st.floats(0.0, 3.0), ANGLE)
def test_a_camera_off_its_line_of_sight_is_unreachable_from_a_micrometre_on(shares, micrometres, way):
    camera = SrcCamera()
    q = np.array(shares) * camera.upper
    T = camera.forward(q)
    off = 1e-6 * micrometres
    T[:3, 3] += off * (np.cos(way) * T[:3, 0] + np.sin(way) * T[:3, 1])
    result = camera.inverse(T)
    if off > 1.001 * OFF_THE_LINE:
        assert (result.reason, result.joint) == ("unreachable", -1)
        assert np.isnan(result.q).all()
    elif off < 0.999 * OFF_THE_LINE:
        assert result.ok
        np.testing.assert_allclose(result.q, q, atol=1e-9)


@pytest.mark.parametrize("joint", range(4))
@pytest.mark.parametrize("side", [-1, 1])
def test_a_pose_of_the_camera_beyond_one_limit_names_the_joint(joint, side):
    camera = SrcCamera()
    q = np.array([0.3, -0.2, 0.05, 0.4])
    q[joint] = side * (camera.upper[joint] + 0.01)
    result = camera.inverse(camera.forward(q))
    assert (result.reason, result.joint) == ("outside limits", joint)
    np.testing.assert_allclose(result.q, q, atol=1e-9)
