"""Input devices of launch files as teleoperations."""

from __future__ import annotations

from pathlib import Path

import ligature
import pytest
from ligature.adf.diagnostics import AdfError
from ligature.model.scene import InputDevice
from ligature.teleop.launch import of_devices

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


@pytest.fixture(scope="module")
def scene() -> ligature.Scene:
    return ligature.load(SMALL, models=[1, 2, 3])


def device(key: str, hardware: str, root: str = "", **settings: object) -> InputDevice:
    return InputDevice(key, hardware, root, settings)


def test_a_device_leads_the_arm_of_its_root_link_with_its_gains_and_buttons(scene: ligature.Scene) -> None:
    pen = device(
        "my pen", "PHANTOM Omni", "psm2/toolyawlink", **{"workspace scaling": 2.0, "haptic gain": {"linear": 5.0},
        "deadband": 0.2, "button mapping": {"a1": 0, "a2": -1, "g1": 1}},
    )  # fmt: skip
    config = of_devices(scene, [device("right", "MTMR"), pen], SMALL)
    assert config.pairs["my_pen"][0] == "PSM2"
    assert config.pairs["MTMR"][0] == "PSM1"
    spec = config.devices["my_pen"]
    assert (spec.kind, spec.topic, spec.settings.scale) == ("touch", "/my_pen/", 2.0)
    assert spec.buttons == {"grey": "clutch", "white": "close"}
    assert spec.force is not None
    assert (spec.force.gain, spec.force.deadband) == (0.5, 0.2)
    assert config.devices["MTMR"].topic == "/MTMR/"


def test_devices_that_nobody_knows_are_passed_over_and_none_at_all_is_told(scene: ligature.Scene) -> None:
    config = of_devices(scene, [device("a", "Abacus"), device("b", "Razer Hydra")], SMALL)
    assert list(config.pairs) == ["b"]
    with pytest.raises(AdfError, match="none of its input devices can lead an arm; arms: PSM1"):
        of_devices(scene, [device("a", "Abacus")], SMALL)
