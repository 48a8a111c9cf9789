"""Impedances: the wrench of springs and dampers, on both sides of each axis, in whichever frame they are stated."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.frames import axis_rotation, frame, rpy_matrix
from ligature.robots.impedance import CartesianImpedance

NUMBERS = st.sampled_from([-2.0, -0.5, 0.0, 0.25, 1.0])
THREE = st.tuples(NUMBERS, NUMBERS, NUMBERS)
GAINS = st.tuples(*[THREE] * 16).map(lambda rows: np.array(rows).reshape(4, 4, 3))


@given(GAINS, THREE, THREE, THREE, st.sampled_from([0.0, 0.3, -0.7]), st.integers(0, 2))
def test_springs_act_along_their_axes_by_side_and_beyond_their_dead_band(
    gains: np.ndarray,
    offset: tuple[float, ...],
    speed: tuple[float, ...],
    turning: tuple[float, ...],
    angle: float,
    about: int,
) -> None:
    """All frames are turned against each other; offsets and speeds are stated along the springs' own axes."""
    gains = gains.copy()
    gains[:, 3] = np.abs(gains[:, 3])
    T_reference, R_force, R_torque = (
        frame(rpy_matrix(0.3, -0.4, 1.2), (1, 2, 3)),
        rpy_matrix(1, 0.2, 0.1),
        rpy_matrix(0, 1, 2),
    )
    rest = np.array([0.1, 0.2, -0.3])
    R_f, R_t = T_reference[:3, :3] @ R_force, T_reference[:3, :3] @ R_torque
    turned = angle * np.eye(3)[about]
    tip = frame(
        R_t @ axis_rotation(np.eye(3)[about], angle),
        T_reference[:3, :3] @ rest + T_reference[:3, 3] + R_f @ np.array(offset),
    )
    impedance = CartesianImpedance(rest, R_force, R_torque, gains)
    wrench = impedance.wrench(T_reference, tip, np.concatenate([R_f @ np.array(speed), R_t @ np.array(turning)]))
    for off, rate, R, found, (above, below) in (
        (np.array(offset), speed, R_f, wrench[:3], gains[:2]),
        (turned, turning, R_t, wrench[3:], gains[2:]),
    ):
        for i, along in enumerate(R.T @ found):
            if abs(off[i]) > 1e-9:  # within rounding of zero either side may act
                p, d, bias, band = (above if off[i] > 0.0 else below)[:, i]
                spring = p * np.sign(off[i]) * max(abs(off[i]) - band, 0.0)
                np.testing.assert_allclose(along, spring + d * rate[i] + bias, atol=1e-9)


def test_at_rest_the_positive_side_acts() -> None:
    gains = np.arange(48.0).reshape(4, 4, 3)
    wrench = CartesianImpedance(np.zeros(3), np.eye(3), np.eye(3), gains).wrench(np.eye(4), np.eye(4), np.ones(6))
    np.testing.assert_allclose(wrench, [*(gains[0, 1] + gains[0, 2]), *(gains[2, 1] + gains[2, 2])])
