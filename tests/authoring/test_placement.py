"""Joints, cameras and lights: what the keys state and where things stand are two forms of one thing."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from ligature.adf import Resolver, read_any
from ligature.adf.frames import axis_rotation, frame, pose_matrix, quaternion_matrix
from ligature.authoring.placement import (
    JointKeys,
    child_pose,
    joint_keys,
    joint_pose,
    light_keys,
    light_pose,
    matrix_of,
    moved_child_pose,
    pose_of,
    rigid,
    same_place,
    view_keys,
    view_pose,
)


def poses() -> st.SearchStrategy[np.ndarray]:
    number = st.floats(-1, 1, allow_nan=False, width=32)
    quaternion = st.tuples(number, number, number, number).filter(lambda q: np.linalg.norm(q) > 0.1)
    return st.builds(
        lambda q, p: frame(quaternion_matrix(np.array(q) / np.linalg.norm(q)), p),
        quaternion,
        st.tuples(number, number, number),
    )


def distinct(a: np.ndarray, b: np.ndarray) -> bool:
    """Whether the format turns one axis into the other as they are, so that no tilt is lost."""
    return 0.0011 < np.arccos(np.clip(a @ b, -1, 1)) < 3.1399


def representable(keys: JointKeys, parent_inertial: np.ndarray, child_inertial: np.ndarray) -> bool:
    """Whether the format puts the child where it stands."""
    return distinct(parent_inertial[:3, :3].T @ keys.parent_axis, child_inertial[:3, :3].T @ keys.child_axis)


@settings(max_examples=60, deadline=None)
@given(poses(), poses(), poses(), poses(), st.booleans())
def test_solved_keys_put_joint_and_child_where_they_stand(
    joint, child, parent_inertial, child_inertial, prismatic
) -> None:
    keys = joint_keys(joint, child, parent_inertial, child_inertial, prismatic)
    axis = parent_inertial[:3, :3].T @ keys.parent_axis
    exact = distinct(np.eye(3)[0 if prismatic else 2], axis)
    placed = joint_pose(keys, parent_inertial, child_inertial, prismatic)
    np.testing.assert_allclose(placed, joint, atol=1e-5 if exact else 5e-3)
    error = np.abs(child_pose(keys, parent_inertial, child_inertial, prismatic) - child).max()
    assert error < (1e-9 if representable(keys, parent_inertial, child_inertial) else 5e-3)


OPPOSITE = frame(quaternion_matrix(np.array([0.0, 0.5, 0.0, 2.5e-4]) / np.hypot(0.5, 2.5e-4)), np.zeros(3))
"""A joint whose axis along x lies 0.001 rad from the opposite of the parent's."""


@settings(max_examples=30, deadline=None)
@given(poses(), poses(), st.floats(-1, 1))
@example(OPPOSITE, frame(np.diag([-1.0, -1.0, 1.0]), np.zeros(3)), 1.0)
def test_a_moved_joint_turns_the_child_about_the_axis_or_shifts_it_along(joint, child, position) -> None:
    for prismatic in (False, True):
        keys = joint_keys(joint, child, prismatic=prismatic)
        moved = moved_child_pose(keys, position, prismatic=prismatic)
        axis = joint[:3, 0] if prismatic else joint[:3, 2]
        if prismatic:
            expected = frame(child[:3, :3], child[:3, 3] + position * axis)
        else:
            turn = axis_rotation(axis, position)
            expected = frame(turn @ child[:3, :3], joint[:3, 3] + turn @ (child[:3, 3] - joint[:3, 3]))
        exact = representable(keys, np.eye(4), np.eye(4)) and distinct(
            np.eye(3)[0 if prismatic else 2], keys.parent_axis
        )
        close = 1e-5 if exact else 5e-3
        np.testing.assert_allclose(moved, expected, atol=close)


def test_axes_that_are_exactly_parallel_or_antiparallel_are_exact() -> None:
    for turn in (np.eye(3), axis_rotation((0, 0, 1), 1.0), np.diag([1.0, -1.0, -1.0])):
        child = frame(turn, (0.1, 0.2, 0.3))
        keys = joint_keys(frame(np.eye(3), (1.0, 0.0, 0.0)), child)
        np.testing.assert_allclose(child_pose(keys), child, atol=1e-12)


def test_the_jaws_of_a_real_instrument_stand_where_their_file_states(corpus: Path) -> None:
    file = next(corpus.rglob("LND_400006_SIMPLE/psm1.yaml"))
    document = read_any(file, Resolver([corpus]))
    bodies = {body.key: body for body in document.elements("bodies")}
    checked = 0
    for joint in document.elements("joints"):
        parent, child = bodies[joint.text("parent")], bodies[joint.text("child")]
        keys = JointKeys(
            joint.vector("parent pivot"), joint.vector("child pivot"), joint.vector("parent axis"), joint.vector("child axis"),
            joint.number("offset"), joint.number("joint offset"),
        )  # fmt: skip
        T_child = matrix_of(parent.pose("location")) @ child_pose(
            keys, matrix_of(parent.value("inertial offset")), matrix_of(child.value("inertial offset")),
            joint.value("type") == "prismatic",
        )  # fmt: skip
        assert same_place(T_child, matrix_of(child.pose("location")), 1e-4), joint.key
        checked += 1
    assert checked >= 7


@settings(max_examples=30, deadline=None)
@given(poses())
def test_views_and_lights_come_back_from_their_keys(T) -> None:
    np.testing.assert_allclose(view_pose(*view_keys(T)), T, atol=1e-6)
    location, direction = light_keys(T)
    np.testing.assert_allclose(light_pose(location, direction)[:3, 2:], T[:3, 2:], atol=1e-6)


def test_a_view_that_looks_nowhere_has_the_formats_identity() -> None:
    T = view_pose((1.0, 2.0, 3.0), (1.0, 2.0, 3.0), (0.0, 0.0, 1.0))
    np.testing.assert_array_equal(T[:3, 2], [1.0, 0.0, 0.0])  # looks along -X
    np.testing.assert_array_equal(T[:3, 1], [0.0, 0.0, 1.0])


def test_poses_are_distinguished_beyond_single_precision() -> None:
    A = pose_matrix((1, 2, 3), (0.1, 0.2, 0.3))
    assert same_place(A, A.astype(np.float32).astype(float))
    assert not same_place(A, pose_matrix((1, 2, 3.0001), (0.1, 0.2, 0.3)))
    assert not same_place(A, pose_matrix((1, 2, 3), (0.1, 0.2001, 0.3)))


def test_the_rigid_part_of_a_scaled_and_mirrored_matrix_is_a_rotation() -> None:
    A = pose_matrix((1, 2, 3), (0.1, 0.2, 0.3))
    np.testing.assert_allclose(rigid(A @ np.diag([2.0, 3.0, 0.5, 1.0])), A, atol=1e-12)
    assert np.linalg.det(rigid(A @ np.diag([-1.0, 1.0, 1.0, 1.0]))[:3, :3]) == pytest.approx(1.0)


def test_positions_and_angles_come_back_from_a_matrix() -> None:
    position, orientation = pose_of(pose_matrix((1, -2, 0), (0.3, -0.2, 1.0)))
    assert position == (1.0, -2.0, 0.0)
    np.testing.assert_allclose(orientation, (0.3, -0.2, 1.0), atol=1e-12)
