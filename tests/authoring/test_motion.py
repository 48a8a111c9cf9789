"""Changes of poses applied to what files state: what did not change keeps its digits, what changed is exact."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.adf.frames import axis_rotation, frame, inverse, pose_matrix, rpy_matrix
from ligature.authoring.motion import (
    JointPlace,
    follows,
    moved_direction,
    moved_joint,
    moved_point,
    moved_pose,
    near_rpy,
    new_pose,
    settled,
)
from ligature.authoring.placement import JointKeys, child_pose, joint_pose, same_place

LENGTHS = st.floats(-2.0, 2.0).map(lambda v: round(v, 3))
ANGLES = st.floats(-3.0, 3.0).map(lambda v: round(v, 3))
VECTORS = st.tuples(LENGTHS, LENGTHS, LENGTHS)
TURNS = st.tuples(ANGLES, ANGLES, ANGLES)
POSES = st.tuples(VECTORS, TURNS)
AXES = st.tuples(LENGTHS, LENGTHS, LENGTHS).filter(lambda v: np.linalg.norm(v) > 0.2)
KINDS = st.sampled_from(["revolute", "prismatic", "fixed", "torsion spring", "linear spring"])


def single(T: np.ndarray) -> np.ndarray:
    """A pose as an editor of single precision holds it."""
    return T.astype(np.float32).astype(float)


@given(st.floats(-1e6, 1e6, width=32))
def test_digits_read_back_to_the_same_single_precision_number_and_none_fewer_do(value: float) -> None:
    found = settled(value)
    assert np.float32(found) == np.float32(value)
    text = repr(found).lstrip("-")
    if "e" not in text and len(text.split(".")[1]) > 1:
        assert np.float32(round(found, len(text.split(".")[1]) - 1)) != np.float32(value)


@pytest.mark.parametrize(
    ("value", "was", "noise", "found"),
    [
        (0.13999999, None, 1e-7, 0.14),
        (-1.34e-07, None, 5e-7, 0.0),
        (0.30000001, 0.3000000001, 0.0, 0.3000000001),
        (float(np.float32(0.1)), None, 0.0, 0.1),
        (0.000186, None, 0.0, 0.000186),
    ],
)
def test_dust_is_no_digit(value: float, was: float | None, noise: float, found: float) -> None:
    assert settled(value, was, noise) == found


@given(POSES, VECTORS)
def test_a_shifted_pose_keeps_its_orientation_and_the_places_that_stay(
    was: tuple, shift: tuple[float, float, float]
) -> None:
    before = single(pose_matrix(*was))
    now = before.copy()
    for i, by in enumerate(shift):
        if by > 0.0:
            now[i, 3] = np.float32(before[i, 3] + by)
    found = moved_pose(was, before, now)
    assert found[1] == was[1]
    for i, by in enumerate(shift):
        if by > 0.0:
            assert np.float32(found[0][i]) == np.float32(now[i, 3]) or abs(found[0][i] - now[i, 3]) < 3e-7
        else:
            assert found[0][i] == was[0][i]


@given(TURNS, TURNS)
def test_a_turned_pose_is_as_near_to_the_old_angles_as_can_be(was: tuple, turn: tuple) -> None:
    before = single(pose_matrix((0, 0, 0), was))
    now = single(frame(rpy_matrix(*turn) @ before[:3, :3], (0, 0, 0)))
    position, found = moved_pose(((0.0, 0.0, 0.0), was), before, now)
    np.testing.assert_allclose(rpy_matrix(*found), rpy_matrix(*turn) @ rpy_matrix(*was), atol=3e-6)
    assert position == (0.0, 0.0, 0.0)
    assert abs(found[1] - was[1]) <= math.pi + 1e-6


@pytest.mark.parametrize(
    "was", [(-1.571, -1.57, -1.571), (0.3, math.pi / 2, 0.7), (1.571, 3.141, 0.0), (0.0, 0.0, -2.851)]
)
@given(st.floats(-1.0, 1.0).filter(lambda v: abs(v) > 1e-3))
def test_a_turn_about_the_worlds_z_changes_the_yaw_alone_also_near_the_pole(was: tuple, angle: float) -> None:
    before = single(pose_matrix((0, 0, 0), was))
    now = single(frame(axis_rotation((0, 0, 1), angle) @ before[:3, :3], (0, 0, 0)))
    found = moved_pose(((0.0, 0.0, 0.0), was), before, now)[1]
    assert found[:2] == was[:2] or abs(math.cos(was[1])) < 1e-3
    np.testing.assert_allclose(rpy_matrix(*found), axis_rotation((0, 0, 1), angle) @ rpy_matrix(*was), atol=3e-6)


@given(TURNS)
def test_angles_that_mean_the_same_are_found_again(was: tuple) -> None:
    found = near_rpy(rpy_matrix(*was), was)
    np.testing.assert_allclose(rpy_matrix(*found), rpy_matrix(*was), atol=1e-6)
    if abs(math.cos(was[1])) > 1e-2:
        np.testing.assert_allclose(found, was, atol=1e-9)


@given(POSES, POSES, AXES)
def test_points_and_directions_go_with_their_object(first: tuple, last: tuple, vector: tuple) -> None:
    before, now = pose_matrix(*first), pose_matrix(*last)
    motion = now @ inverse(before)
    np.testing.assert_allclose(moved_direction(vector, before, now), motion[:3, :3] @ vector, atol=5e-6)
    np.testing.assert_allclose(moved_point(vector, before, now), motion[:3, :3] @ vector + motion[:3, 3], atol=2e-5)
    assert moved_direction(vector, before, before) == vector and moved_point(vector, before, before) == vector


@given(st.tuples(VECTORS, VECTORS, AXES, AXES, ANGLES, ANGLES), KINDS, POSES, POSES)
def test_what_does_not_move_keeps_every_digit_of_a_joint(keys: tuple, kind: str, first: tuple, last: tuple) -> None:
    joint, place = JointKeys(*keys), JointPlace(pose_matrix(*first), pose_matrix(*last))
    assert moved_joint(joint, place, place, kind=kind) is joint


@settings(deadline=None)
@given(st.tuples(VECTORS, VECTORS, AXES, AXES, ANGLES, ANGLES), KINDS, POSES, VECTORS, st.booleans())
def test_the_child_of_a_joint_that_follows_takes_the_joint_along(
    keys: tuple, kind: str, motion: tuple, rounding: tuple, turned: bool
) -> None:
    joint, prismatic = JointKeys(*keys), kind == "prismatic"
    T_joint, T_child = joint_pose(joint, prismatic=prismatic), child_pose(joint, prismatic=prismatic)
    off = frame(np.eye(3), np.asarray(rounding) * 1e-6) @ T_child  # what a file rounds away
    before = JointPlace(T_joint, off)
    T_motion = pose_matrix(motion[0], motion[1] if turned else (0, 0, 0))
    now = JointPlace(T_joint, T_motion @ off)
    assert follows(joint, before, kind=kind)
    found = moved_joint(joint, before, now, kind=kind)
    far = 10.0
    assert same_place(joint_pose(found, prismatic=prismatic), T_joint, 1e-5 * far)
    assert same_place(child_pose(found, prismatic=prismatic), T_motion @ T_child, 1e-5 * far)
    assert found.parent_pivot == joint.parent_pivot or turned
    if not turned:
        assert found.parent_axis == joint.parent_axis and found.child_axis == joint.child_axis
        assert found.offset == joint.offset and found.joint_offset == joint.joint_offset


def test_a_joint_whose_bodies_all_stand_in_one_place_does_not_follow_from_them() -> None:
    joint = JointKeys((0.3, 0.0, 0.1), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    before = JointPlace(joint_pose(joint), np.eye(4))
    assert not follows(joint, before)
    now = JointPlace(before.T_parent_joint, frame(np.eye(3), (0.001, 0.0, 0.0)))
    assert moved_joint(joint, before, now) is joint
    moved = moved_joint(joint, before, JointPlace(frame(np.eye(3), (0.3, 0.0, 0.2)), np.eye(4)))
    assert moved.parent_pivot == (0.3, 0.0, 0.2) and moved.child_pivot == (0.0, 0.0, 0.1)


def test_rounded_files_follow_and_keep_what_they_rounded() -> None:
    joint = JointKeys((0.02, 0.0, 0.0), (0.01, 0.0, 0.0), (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), 0.5)
    off = frame(np.eye(3), (0.0007, 0.0, 0.0)) @ child_pose(joint)
    before = JointPlace(joint_pose(joint), off)
    now = JointPlace(before.T_parent_joint, frame(np.eye(3), (0.0, 0.0, 0.001)) @ off)
    found = moved_joint(joint, before, now)
    assert found == JointKeys((0.02, 0.0, 0.0), (0.01, 0.0, -0.001), (0.0, 0.0, 2.0), (0.0, 0.0, 1.0), 0.5)


def test_a_turned_joint_is_open_by_its_own_motion_and_follows() -> None:
    joint = JointKeys((0.1, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0))
    opened = frame(axis_rotation((0, 0, 1), 1.2), (0.1, 0.0, 0.0))
    assert follows(joint, JointPlace(joint_pose(joint), opened))
    assert not follows(joint, JointPlace(joint_pose(joint), opened), kind="fixed")


@settings(deadline=None)
@given(
    st.tuples(VECTORS, VECTORS, AXES, AXES, ANGLES, ANGLES),
    st.sampled_from(["revolute", "prismatic", "torsion spring", "linear spring"]),
    st.tuples(POSES, POSES),
    POSES,
    POSES,
    ANGLES,
    st.sampled_from(["child", "joint", "both"]),
)
def test_a_joint_away_from_zero_keeps_its_position_when_it_or_its_child_moves(
    keys: tuple, kind: str, inertial: tuple, child: tuple, moved: tuple, position: float, what: str
) -> None:
    joint, prismatic = JointKeys(*keys), kind == "prismatic"
    frames = tuple(pose_matrix(*pose) for pose in inertial)

    def held(stated: JointKeys) -> np.ndarray:
        """The child at the joint's position, from the closed form alone."""
        T = joint_pose(stated, *frames, prismatic=prismatic)
        if kind in ("prismatic", "linear spring"):
            motion = frame(np.eye(3), (position, 0, 0) if prismatic else (0, 0, position))
        else:
            motion = frame(axis_rotation((0, 0, 1), position), (0, 0, 0))
        return T @ motion @ inverse(T) @ child_pose(stated, *frames, prismatic=prismatic)

    T_joint, T_child = joint_pose(joint, *frames, prismatic=prismatic), held(joint)
    before = JointPlace(T_joint, T_child)
    now = JointPlace(
        T_joint if what == "child" else pose_matrix(*moved) @ T_joint,
        T_child if what == "joint" else pose_matrix(*child) @ T_child,
    )
    found = moved_joint(joint, before, now, frames, kind)
    assert same_place(joint_pose(found, *frames, prismatic=prismatic), now.T_parent_joint, 1e-4)
    assert same_place(held(found), now.T_parent_child, 2e-4)


def test_a_new_pose_has_short_digits() -> None:
    T = single(pose_matrix((0.1, -0.2, 0.3), (0.1, 0.2, 0.3)))
    assert new_pose(T) == ((0.1, -0.2, 0.3), (0.1, 0.2, 0.3))
