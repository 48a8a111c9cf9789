"""Teleoperation files: what they mean, and the errors of invalid ones."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from ligature.adf.diagnostics import AdfError
from ligature.teleop.config import TeleopConfig, from_text

GOOD = """
camera: ECM
camera scale: 0.5
settings: {scale: 0.3, workspace: [[-1, -1, 0], [1, 1, 1]]}
devices:
  MTMR: {kind: mtm, force: {gain: 0.5, most damping: 10}}
  pen: {kind: touch, topic: /arm1/, unit: 0.001, axes: [right, up, near], buttons: {grey: clutch}, settings: {scale: 1}}
  pad: {kind: joy, moves: ["-0", "-1", "+7"], speed: 0.2}
pairs: {MTMR: [PSM1, PSM3], pen: PSM2, pad: []}
"""


def read(text: str) -> TeleopConfig:
    return from_text(text, Path("teleop.yaml"))


def test_a_file_states_who_drives_whom_and_how() -> None:
    config = read(GOOD)
    assert config.pairs == {"MTMR": ("PSM1", "PSM3"), "pen": ("PSM2",), "pad": ()}
    assert config.camera_scale == 0.5
    assert config.devices["MTMR"].topic == "/MTMR/"
    assert config.devices["MTMR"].force is not None
    assert config.devices["MTMR"].force.most_damping == 10.0
    pen = config.devices["pen"]
    assert (pen.settings.scale, pen.settings.workspace) == (1.0, ((-1, -1, 0), (1, 1, 1)))
    assert pen.options["unit"] == 0.001
    assert pen.calibration.axes == pytest.approx(np.diag([1.0, -1.0, -1.0]))
    assert config.devices["pad"].topic == "/joy"
    assert config.devices["pad"].options["speed"] == 0.2


def test_more_devices_than_arms_wait_until_they_are_reported_whom_to_drive() -> None:
    config = read(GOOD.replace("pad: []", "pad: [none, PSM1, PSM2]"))
    assert config.pairs["pad"] == ("PSM1", "PSM2")
    assert config.waiting == {"pad"}
    assert [config.begins_with(leader) for leader in config.pairs] == ["PSM1", "PSM2", ""]
    assert read(GOOD).begins_with("pad") == ""


def test_buttons_and_a_pedal_mark_phases_of_the_work() -> None:
    text = GOOD.replace("{grey: clutch}", "{grey: phase, white: phase back}")
    config = read(text + "phases: [G1 reach, drive]\nphase pedal: /footpedals/coag\n")
    assert (config.phases, config.phase_pedal) == (("G1 reach", "drive"), "footpedals/coag")
    assert (read(GOOD).phases, read(GOOD).phase_pedal) == ((), "")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (GOOD.replace("grey: clutch", "grey: phase"), "a button of pen marks phases, and there are none"),
        (GOOD + "phase pedal: footpedals/coag\n", "the pedal marks phases, and there are none"),
        (GOOD + "phases: reach\n", "phases must be a list"),
        (GOOD + "phases: [reach, reach]\n", "'reach' is empty or listed twice"),
        (GOOD + "phases: ['']\n", "'' is empty or listed twice"),
        (GOOD + 'phases: ["a\\nb"]\n', "a phase is printable text"),
        (GOOD + f"phases: [{'x' * 300}]\n", "a text has at most 200 bytes"),
    ],
)
def test_phases_that_cannot_be_marked_are_an_error(text: str, message: str) -> None:
    with pytest.raises(AdfError, match=message):
        read(text)


def test_a_fixed_camera_stands_in_the_world() -> None:
    config = read(GOOD.replace("camera: ECM", "camera: {position: [0, 0, 1], rpy: [3.14159265, 0, 0]}"))
    assert config.camera == ""
    assert config.T_world_camera is not None
    assert config.T_world_camera[:3, 3] == pytest.approx([0, 0, 1])
    assert config.T_world_camera[2, 2] == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("wrong", "right", "message"),
    [
        ("kind: mtm", "kind: glove", "6:16: error: device MTMR has the unknown kind 'glove'; choose one of mtm, touch"),
        ("scale: 0.3", "size: 0.3", "settings has no key 'size'; choose one of scale"),
        ("scale: 0.3", "scale: big", "4:19: error: scale must be a number, not 'big'"),
        ("scale: 0.3", "scale: -1", "scale must be within 0"),
        ("grey: clutch", "grey: fly", "a button cannot 'fly'; it can clutch, camera"),
        ("[right, up, near]", "[right, up, away]", "axes right, up, away do not form a right-handed frame"),
        ("pen: PSM2", "pen: PSM1", "pen and MTMR would both start with PSM1"),
        ("pen: PSM2", "pan: PSM2", "unknown device 'pan'; choose one of MTMR, pen, pad"),
        ('["-0", "-1", "+7"]', '["-0", "-1"]', "moves must be a list of 3"),
        ("[[-1, -1, 0], [1, 1, 1]]", "[[1, 1, 1], [0, 0, 0]]", "first corner of the workspace must be below"),
        ("pairs:", "pears:", "a teleoperation has no key 'pears'"),
    ],
)
def test_what_is_wrong_is_reported_with_its_place_and_what_would_be_right(wrong: str, right: str, message: str) -> None:
    with pytest.raises(AdfError) as error:
        read(GOOD.replace(wrong, right, 1))
    assert message in str(error.value)
    assert str(error.value).startswith("teleop.yaml:")


def test_keys_of_version_0_1_are_accepted_with_a_note(tmp_path: Path) -> None:
    text = (
        "devices: {MTMR: {kind: mtm}}\npairs: {MTMR: [PSM1]}\nsettings: {patience: 2.0, fastest: 0.3, quickest: 4.0}\n"
    )
    config = from_text(text, tmp_path / "old.yaml")
    settings = config.devices["MTMR"].settings
    assert (settings.timeout, settings.max_velocity, settings.max_angular_velocity) == (2.0, 0.3, 4.0)
    assert len(config.notes) == 3
    assert config.notes[0].endswith("old.yaml:3:12: 'patience' is deprecated; write 'timeout'")


def test_a_key_and_its_former_name_together_are_rejected(tmp_path: Path) -> None:
    text = "devices: {MTMR: {kind: mtm}}\npairs: {MTMR: [PSM1]}\nsettings: {patience: 2.0, timeout: 1.0}\n"
    with pytest.raises(AdfError, match="both 'patience' and 'timeout'"):
        from_text(text, tmp_path / "both.yaml")
