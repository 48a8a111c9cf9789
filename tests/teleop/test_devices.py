"""Devices without ROS: sticks, keys, buttons, and what was recorded of them."""

from __future__ import annotations

import io
import os
import pty
from pathlib import Path

import numpy as np
import pytest
from ligature.teleop.calibration import Calibration
from ligature.teleop.devices import KINDS, module
from ligature.teleop.devices.device import STILL, Device, RateHand, Reading
from ligature.teleop.devices.keyboard import Adapter as Keyboard
from ligature.teleop.handset import Handset, Press
from ligature.teleop.record import Recorder, Replay, recording


def test_every_kind_has_an_adapter() -> None:
    for kind in KINDS:
        found = module(kind)
        assert issubclass(found.Adapter, Device)
        assert isinstance(found.DEFAULTS, Calibration)
        assert isinstance(found.OPTIONS, dict)


def test_a_stick_moves_its_hand_as_fast_as_it_is_deflected() -> None:
    hand = RateHand(speed=0.1, turn=1.0)
    assert hand.pose(0.0) is None
    hand.deflect(0.0, np.array([1.0, 0, 0, 0, 0, 0.5]))
    hand.pose(0.0)
    poses = []
    for k in range(1, 11):
        hand.deflect(0.01 * k, np.array([1.0, 0, 0, 0, 0, 0.5]))
        poses.append(hand.pose(0.01 * k))
    assert poses[-1] is not None
    start = poses[0]
    assert start is not None
    assert poses[-1][0] - start[0] == pytest.approx(0.009)
    assert 2 * np.arcsin(poses[-1][5]) - 2 * np.arcsin(start[5]) == pytest.approx(0.045)


def test_a_stick_that_is_lost_while_deflected_speaks_no_more_and_one_at_rest_does() -> None:
    hand = RateHand(0.1, 1.0, timeout=0.2)
    hand.deflect(0.0, np.array([1.0, 0, 0, 0, 0, 0]))
    assert hand.pose(0.1) is not None
    assert hand.pose(0.3) is None
    hand.deflect(0.4, np.full(6, 0.01))
    assert hand.pose(10.0) is not None


def test_a_stick_that_sends_nan_gives_no_pose() -> None:
    hand = RateHand(0.1, 1.0)
    hand.deflect(0.0, np.array([np.nan, 0, 0, 0, 0, 0]))
    pose = hand.pose(0.0)
    assert pose is not None
    assert np.isnan(pose).all()


def test_keys_move_the_hand_and_press_buttons() -> None:
    master, slave = pty.openpty()
    readings: list[Reading] = []
    keyboard = Keyboard(os.ttyname(slave), {"step": 0.01, "turn": 0.1}, readings.append)
    os.write(master, b"ddw c\t")
    keyboard.poll(0.0)
    keyboard.close()
    os.close(master)
    os.close(slave)
    assert readings[0].buttons["tab"]
    assert readings[-1].pose[:3] == pytest.approx([0.02, -0.01, 0.0])
    assert readings[-1].buttons == {
        "space": True, "c": True, "v": False, "tab": False, "p": False, "P": False,
    }  # fmt: skip


def test_a_keyboard_without_a_terminal_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(ValueError, match="needs a terminal"):
        Keyboard(str(tmp_path / "file"), {"step": 0.01, "turn": 0.1}, lambda reading: None)


def test_buttons_are_pedals_and_close_the_grip() -> None:
    handset = Handset(Calibration(), {"grey": "clutch", "white": "toggle"})
    hand, presses = handset.take(Reading(0.0, STILL, None, {"grey": True, "white": False}))
    assert presses == [Press("clutch", True)]
    assert hand.grip == 1.0
    grips = []
    for down in (True, True, False, True):
        hand, presses = handset.take(Reading(0.0, STILL, None, {"grey": True, "white": down}))
        assert presses == []
        grips.append(hand.grip)
    assert grips == [0.0, 0.0, 0.0, 1.0]


def test_what_was_recorded_is_replayed_at_its_pace(tmp_path: Path) -> None:
    out = io.StringIO()
    recorder = Recorder(out)
    poses = [np.array([0.01 * k, 0, 0, 0, 0, 0, 1.0]) for k in range(3)]
    poses[2][0] = np.nan
    for k, pose in enumerate(poses):
        recorder.reading("pen", Reading(5.0 + 0.1 * k, pose, 0.5, {"grey": k == 1}))
    recorder.event(5.25, "pair", ("MTMR", "PSM2"))
    (tmp_path / "record.jsonl").write_text(out.getvalue())
    replay = Replay(tmp_path / "record.jsonl")
    assert replay.devices == {"pen"}
    assert len(list(replay.due(100.0))) == 1
    ((name, (device, reading)),) = list(replay.due(100.15))
    assert (name, device, reading.grip, reading.buttons) == ("reading", "pen", 0.5, {"grey": True})
    assert reading.time == pytest.approx(100.1)
    assert reading.pose == pytest.approx(poses[1])
    assert not replay.finished
    (_, (_, broken)), event = list(replay.due(101.0))
    assert np.isnan(broken.pose[0])
    assert event == ("pair", ("MTMR", "PSM2"))
    assert replay.finished


@pytest.mark.parametrize("line", ["{", '{"t": 0, "device": "pen", "pose": [1, 2], "buttons": {}}', '{"t": 0}', "[1]"])
def test_a_file_that_is_no_record_is_reported_with_its_line(tmp_path: Path, line: str) -> None:
    (tmp_path / "record.jsonl").write_text('{"t": 0, "event": "clutch", "value": true}\n' + line + "\n")
    with pytest.raises(ValueError, match=r"record.jsonl:2: neither a reading of a device nor an event"):
        Replay(tmp_path / "record.jsonl")


@pytest.mark.parametrize("name", ["input.jsonl", "input.jsonl.active", ""])
def test_what_is_recorded_replaces_nothing_and_is_kept_whatever_ends_it(tmp_path: Path, name: str) -> None:
    path = tmp_path / "input.jsonl"
    if name:
        (tmp_path / name).write_text("mine")
        with pytest.raises(FileExistsError, match="choose another name"), recording(path):
            pass
        assert [(file.name, file.read_text()) for file in tmp_path.iterdir()] == [(name, "mine")]
        return
    with pytest.raises(KeyboardInterrupt), recording(path) as recorder:
        recorder.event(1.0, "enable", True)
        raise KeyboardInterrupt
    assert [file.name for file in tmp_path.iterdir()] == ["input.jsonl"]
    assert list(Replay(path).due(1.0)) == [("enable", True)]
    path.unlink()
    with recording(path):
        pass
    assert not list(tmp_path.iterdir())
