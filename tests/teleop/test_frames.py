"""Frames of arms: what different tellers state fits together."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import axis_rotation, frame, inverse
from ligature.teleop.frames import Frames

T_WORLD_PSM = frame(axis_rotation((0, 0, 1), 0.3), (0.1, 0.2, 0.3))
T_WORLD_ECM = frame(axis_rotation((1, 0, 0), 2.0), (0.0, 0.0, 0.5))
T_ECM_TIP = frame(axis_rotation((0, 1, 0), 0.2), (0.0, 0.0, -0.12))


def test_two_branches_meet_in_the_world() -> None:
    frames = Frames()
    frames.put("world", "PSM1_base", T_WORLD_PSM)
    frames.put("world", "ECM_base", T_WORLD_ECM)
    frames.put("ECM_base", "ECM", T_ECM_TIP)
    T = frames.between("ECM", "PSM1_base")
    assert pytest.approx(inverse(T_WORLD_ECM @ T_ECM_TIP) @ T_WORLD_PSM) == T
    assert frames.between("ECM", "MTMR") is None


def test_arms_reported_in_the_camera_need_no_world() -> None:
    frames = Frames()
    frames.put("ECM", "PSM1_base", T_WORLD_PSM, 1)
    assert frames.between("ECM", "PSM1_base") == pytest.approx(T_WORLD_PSM)
    assert frames.between("ECM", "ECM") == pytest.approx(np.eye(4))


@pytest.mark.parametrize("written", ["left/{}", "/left/{}", "{}"])
def test_frames_of_a_simulator_with_a_prefix_are_the_arms_own(written: str) -> None:
    frames = Frames("left/")
    frames.put(written.format("world"), written.format("PSM1_base"), T_WORLD_PSM)
    assert frames.between("world", "PSM1_base") == pytest.approx(T_WORLD_PSM)
    assert frames.has_prefix("left/PSM1_base") and not frames.has_prefix("PSM1_base")
    assert Frames().has_prefix("PSM1_base")


def test_tf_counts_more_than_set_up_joints_and_nonsense_counts_nothing() -> None:
    frames = Frames()
    frames.put("ECM", "PSM1_base", np.eye(4), 1)
    frames.put("world", "PSM1_base", T_WORLD_PSM)
    frames.put("ECM", "PSM1_base", np.eye(4), 1)
    frames.put("world", "PSM1_base", np.full((4, 4), np.nan))
    assert frames.between("world", "PSM1_base") == pytest.approx(T_WORLD_PSM)
    assert frames.between("ECM", "PSM1_base") is None


def test_frames_that_go_round_in_a_circle_end() -> None:
    frames = Frames()
    frames.put("a", "b", np.eye(4))
    frames.put("b", "a", np.eye(4))
    assert frames.between("a", "c") is None
