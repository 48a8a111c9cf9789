"""Rotations and joint frames against worked examples."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.frames import (
    axis_rotation,
    joint_frames,
    matrix_pose7,
    matrix_quaternion,
    matrix_rpy,
    minimal_rotation,
    pose7_matrix,
    pose_matrix,
    quaternion_matrix,
    rpy_matrix,
)

ANGLE = st.floats(-3.1, 3.1)


@given(ANGLE, ANGLE, ANGLE)
def test_quaternions_and_angles_give_back_the_rotation(r: float, p: float, y: float) -> None:
    R = rpy_matrix(r, p, y)
    assert np.allclose(quaternion_matrix(matrix_quaternion(R)), R, atol=1e-12)
    assert np.allclose(rpy_matrix(*matrix_rpy(R)), R, atol=1e-9)


def test_orientation_is_roll_then_pitch_then_yaw_about_fixed_axes() -> None:
    x, y, z = np.eye(3)
    assert np.allclose(
        rpy_matrix(0.1, 0.2, 0.3), axis_rotation(z, 0.3) @ axis_rotation(y, 0.2) @ axis_rotation(x, 0.1), atol=1e-15
    )


def test_poses_survive_the_way_to_seven_numbers_and_back() -> None:
    T = pose_matrix((1, 2, 3), (0.4, -0.5, 2.8))
    assert np.allclose(pose7_matrix(matrix_pose7(T)), T, atol=1e-14)


def test_minimal_rotation_turns_one_vector_to_the_other() -> None:
    rng = np.random.default_rng(1)
    for _ in range(100):
        u, v = rng.normal(size=(2, 3))
        assert np.allclose(minimal_rotation(u, v) @ (u / np.linalg.norm(u)), v / np.linalg.norm(v), atol=1e-12)


@pytest.mark.parametrize(
    ("u", "expected"),
    [((0, 0, 1), (0, 1, 0)), ((0, 1, 0), (0, 0, -1)), ((1, 0, 0), (0, 0, -1)), ((-1, 0, 0), (0, 0, 1))],
)
def test_the_axis_for_opposite_vectors_is_the_formats_own(u: tuple, expected: tuple) -> None:
    R = minimal_rotation(u, -np.array(u, dtype=float))
    axis = np.array(expected, dtype=float)
    assert np.allclose(R, axis_rotation(axis, np.pi), atol=1e-6)


def test_nearly_equal_vectors_are_not_turned_apart() -> None:
    assert np.allclose(minimal_rotation((0, 0, 1), (1e-5, 0, 1)), np.eye(3), atol=2e-5)


def test_worked_example_1_offset_and_joint_offset_together() -> None:
    T_parent, T_child = pose_matrix((0, -0.00628, 0), (0, 0, 0)), pose_matrix((0, 0, -0.02166), (0, 0, 0))
    frames = joint_frames(
        T_parent, T_child, (0.0517999455, 5.22e-8, 1.79e-8), (-8.2e-8, -9.66e-8, -0.2149300873),
        (1, -1.267e-7, 2.028e-7), (2.831e-7, 6.88e-8, 1), -1.5793735981, -0.0084290477,
    )  # fmt: skip
    assert np.allclose(frames.T_parent_a[:3, 3], (0.0517999455, 0.0062800522, 1.8e-8), atol=1e-9)
    assert np.allclose(frames.T_child_b[:3, 3], (-8.2e-8, -9.7e-8, -0.1932700873), atol=1e-9)
    R_a = [[0, 0, 1], [-0.0084289, 0.9999645, 0], [-0.9999645, -0.0084289, 0]]
    R_b = [[-0.000148, -1, 0], [1, -0.000148, 0], [0, 0, 1]]
    R_pc = [[0, 0, 1], [-0.99996322, -0.00857711, 0], [0.00857711, -0.99996322, 0]]
    assert np.allclose(frames.T_parent_a[:3, :3], R_a, atol=1e-6)
    assert np.allclose(frames.T_child_b[:3, :3], R_b, atol=1e-6)
    assert np.allclose(frames.T_parent_child[:3, :3], R_pc, atol=1e-6)
    T_zero = T_parent @ frames.T_parent_child @ np.linalg.inv(T_child)
    assert np.allclose(T_zero[:3, 3], (0.26673003, 0, 0), atol=1e-6)
    T_world_parent = pose_matrix(
        (0.2947271764, 0.6744363308, 1.1651391983), (0.8525903225, 0.7283706069, -2.1026675701)
    )
    T_world_child = T_world_parent @ T_zero
    assert np.allclose(T_world_child[:3, 3], (0.1937796, 0.5028832, 0.9875891), atol=1e-6)
    assert np.allclose(T_world_child[:3, :3], rpy_matrix(0.6402495, 2.5499902, -1.1745069), atol=1e-6)
    turned = T_parent @ frames.T_parent_child
    turned[:3, :3] = T_parent[:3, :3] @ axis_rotation(frames.axis, 0.3) @ frames.T_parent_child[:3, :3]
    assert np.allclose((T_world_parent @ turned)[:3, :3], rpy_matrix(-2.7070995, 0.7468385, 1.6382439), atol=1e-6)


def test_worked_example_2_prismatic() -> None:
    identity = np.eye(4)
    frames = joint_frames(
        identity, identity, (0, -0.4318, 0), (0, 0, 0), (0, 1, 0), (1, 0, 0), -3.1331560612, prismatic=True
    )
    expected = [[0, 0.9999644, -0.008436], [1, 0, 0], [0, -0.008436, -0.9999644]]
    assert np.allclose(frames.T_parent_child[:3, :3], expected, atol=1e-6)
    T_world_parent = pose_matrix((0.2947271764, 0.6744363308, 1.1651391983), (0, 0, 0))
    assert np.allclose((T_world_parent @ frames.T_parent_child)[1, 3], 0.6744363308 - 0.4318, atol=1e-9)
    assert np.allclose(frames.T_parent_a[:3, 0], (0, 1, 0), atol=1e-12)


def test_worked_example_3_opposite_axes() -> None:
    identity = np.eye(4)
    frames = joint_frames(identity, identity, (0, 0, 0), (0, 0, 0), (0, 0, -1), (0, 0, 1), -np.pi)
    assert np.allclose(minimal_rotation((0, 0, 1), (0, 0, -1)), np.diag([-1, 1, -1]), atol=1e-6)
    assert np.allclose(frames.T_parent_child[:3, :3], np.diag([1, -1, -1]), atol=1e-6)


def test_both_constraint_frames_coincide_at_zero() -> None:
    rng = np.random.default_rng(3)
    for prismatic in (False, True):
        axes, pivots = rng.normal(size=(2, 3)), rng.normal(size=(2, 3))
        frames = joint_frames(
            pose_matrix(rng.normal(size=3), rng.normal(size=3)), pose_matrix(rng.normal(size=3), rng.normal(size=3)),
            pivots[0], pivots[1], axes[0], axes[1], 0.4, 0.7, prismatic,
        )  # fmt: skip
        assert np.allclose(frames.T_parent_child @ frames.T_child_b, frames.T_parent_a, atol=1e-12)
