"""Euler angles against scipy, for all 24 orders of axes."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest
from ligature.client.euler import euler_from_quaternion, quaternion_from_euler
from scipy.spatial.transform import Rotation

ORDERS = [
    kind + "".join(letters)
    for kind in "sr"
    for letters in itertools.product("xyz", repeat=3)
    if letters[0] != letters[1] != letters[2]
]


def scipy_rotation(angles: np.ndarray, axes: str) -> Rotation:
    return Rotation.from_euler(axes[1:] if axes[0] == "s" else axes[1:].upper(), angles)


def distance(a: Rotation, b: Rotation) -> float:
    return float((a * b.inv()).magnitude())


@pytest.mark.parametrize("axes", ORDERS)
def test_both_ways_agree_with_scipy_also_where_axes_coincide(axes: str) -> None:
    rng = np.random.default_rng(3)
    quarter_turns = np.array(list(itertools.product([-2, -1, 0, 1, 2], repeat=3))) * math.pi / 2
    for angles in [*quarter_turns, *rng.uniform(-math.pi, math.pi, (100, 3))]:
        quaternion = np.array(quaternion_from_euler(*angles, axes))
        assert distance(Rotation.from_quat(quaternion), scipy_rotation(angles, axes)) < 1e-12
        back = euler_from_quaternion(quaternion * rng.choice([-2.0, 1.0]), axes)
        assert distance(scipy_rotation(np.array(back), axes), scipy_rotation(angles, axes)) < 1e-7


def test_quaternions_are_x_y_z_w() -> None:
    assert quaternion_from_euler(0.0, 0.0, math.pi) == pytest.approx((0, 0, 1, 0))
    assert euler_from_quaternion([math.sin(0.1), 0, 0, math.cos(0.1)]) == pytest.approx((0.2, 0, 0))


def test_the_default_turns_about_fixed_x_then_y_then_z() -> None:
    expected = Rotation.from_euler("xyz", [0.3, -0.4, 0.5]).as_quat()
    assert quaternion_from_euler(0.3, -0.4, 0.5) == pytest.approx(expected)


def test_a_quaternion_of_an_empty_message_is_no_rotation() -> None:
    assert euler_from_quaternion([0, 0, 0, 0]) == (0, 0, 0)


@pytest.mark.parametrize("axes", ["xyz", "sxxy", "sxy", "qxyz", "sabc", ""])
def test_unknown_axes_are_refused_with_what_they_must_be(axes: str) -> None:
    with pytest.raises(ValueError, match="must be 's' or 'r' and three letters"):
        quaternion_from_euler(0, 0, 0, axes)
