"""Axes of devices: given by words, or by the motions of a hand."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import axis_rotation
from ligature.teleop.calibration import Calibration, Unclear, axes_of_motions, axes_of_words
from ligature.teleop.pairing import is_pose


def test_a_pen_s_up_is_up_in_the_picture() -> None:
    calibration = Calibration(axes_of_words("right", "up", "near"))
    hand = calibration.hand(0.0, np.array([0, 0.1, 0, 0, 0, 0, 1.0]), None)
    assert hand.T_view_hand[:3, 3] == pytest.approx([0, -0.1, 0])


def test_two_motions_report_the_axes_of_a_device_that_stands_askew() -> None:
    R_view_device = axis_rotation((0.6, 0.0, 0.8), 1.1)
    right, up = R_view_device.T @ [0.1, 0.004, 0], R_view_device.T @ [0.0, -0.12, 0.004]
    assert axes_of_motions(right, up) == pytest.approx(R_view_device, abs=0.05)
    assert np.linalg.det(axes_of_motions(right, up)) == pytest.approx(1.0)


def test_motions_that_report_nothing_are_refused() -> None:
    x = np.array([0.1, 0.0, 0.0])
    with pytest.raises(Unclear, match="moved 10 mm to the right; move at least 30 mm"):
        axes_of_motions(x / 10, np.array([0, 0.1, 0]))
    with pytest.raises(Unclear, match="must be about 90°"):
        axes_of_motions(x, np.array([0.1, 0.05, 0.0]))
    with pytest.raises(Unclear, match="do not form a right-handed frame"):
        axes_of_words("right", "up", "away")


def test_forces_and_orientations_go_back_the_way_that_poses_came() -> None:
    calibration = Calibration(axis_rotation((0, 0, 1), 0.7), axis_rotation((1, 0, 0), 0.3))
    assert calibration.axes @ calibration.force_on_device(np.array([1.0, 2.0, 3.0])) == pytest.approx([1, 2, 3])
    R = axis_rotation((0, 1, 0), 0.5)
    assert calibration.axes @ calibration.orientation_on_device(R) @ calibration.handle == pytest.approx(R)


@pytest.mark.parametrize("values", [[np.nan, 0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0, 0], [0, 0, 0, np.inf, 0, 0, 1]])
def test_numbers_that_are_no_pose_stay_none(values: list[float]) -> None:
    assert not is_pose(Calibration().hand(0.0, np.array(values), 0.5).T_view_hand)


def test_a_grip_is_read_between_closed_and_open() -> None:
    calibration = Calibration(closed=1.0, opened=0.0)
    assert calibration.hand(0.0, np.array([0, 0, 0, 0, 0, 0, 1.0]), 0.25).grip == pytest.approx(0.75)
    assert "grip: [1, 0]" in calibration.text()
