"""Input devices of launch files as teleoperations."""

from __future__ import annotations

import shutil
from dataclasses import replace
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.adf.diagnostics import AdfError
from ligature.model.scene import InputDevice
from ligature.teleop.launch import of_devices, of_launch_file

from tests.model.test_proxies import write_scene

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


@pytest.fixture(scope="module")
def scene() -> ligature.Scene:
    return ligature.load(SMALL)


def device(key: str, hardware: str, root: str = "", **settings: object) -> InputDevice:
    return InputDevice(key, hardware, root, settings)


def test_a_device_drives_the_arm_of_its_root_link_with_its_gains_and_buttons(scene: ligature.Scene) -> None:
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


def test_devices_that_nobody_knows_are_passed_over_and_none_at_all_is_reported(scene: ligature.Scene) -> None:
    config = of_devices(scene, [device("a", "Abacus"), device("b", "Razer Hydra")], SMALL)
    assert list(config.pairs) == ["b"]
    assert config.notes[0].startswith("a: hardware 'Abacus' is unknown; known names contain mtm")
    with pytest.raises(AdfError, match="none of its input devices can drive an arm; a: hardware 'Abacus' is unknown"):
        of_devices(scene, [device("a", "Abacus")], SMALL)


def test_a_hydra_is_claimed_paddle_by_paddle_and_a_master_once(scene: ligature.Scene) -> None:
    hydras = [device(f"Razer Hydra{k}", "Razer Hydra") for k in range(3)]
    config = of_devices(scene, hydras, SMALL)
    assert [spec.options["paddle"] for spec in config.devices.values()] == ["left", "right"]
    assert config.notes == ("Razer Hydra2: 'Razer Hydra' is claimed by another input device",)
    config = of_devices(scene, [device("a", "MTMR"), device("b", "MTMR")], SMALL)
    assert list(config.devices) == ["MTMR"]


def test_a_root_link_that_is_of_no_arm_is_refused_and_too_many_devices_are_reported(scene: ligature.Scene) -> None:
    lost = device("lost", "Falcon", "/ambf/env/BODY gripper palm link")
    config = of_devices(scene, [lost, *(device(f"pen{k}", "Falcon") for k in range(3))], SMALL)
    assert config.notes == (
        "lost: its root link '/ambf/env/BODY gripper palm link' belongs to no arm; only arms can be driven",
        "pen2: not used, because no arm is left",
    )


def test_what_has_no_effect_on_an_arm_is_reported(scene: ligature.Scene) -> None:
    settings = {
        "simulated multibody": "pr2.yaml", "controller gain": {}, "max force": "2", "enable joint control": "False",
        "pair cameras": ["nowhere", "cameraR"], "button mapping": {"prev mode": "1"},
    }  # fmt: skip
    config = of_devices(scene, [device("pen", "PHANTOM Omni", **settings)], SMALL)
    assert config.notes == (
        "pen: it drives the arm itself and not its proxy",
        "pen: controller gain, max force: no effect on an arm",
        "pen: enable joint control: ignored, the grip always drives the jaw",
        "pair cameras: the scene has no camera 'nowhere'",
    )
    assert config.camera == "ECM"
    assert config.devices["pen"].buttons == {"white": "previous"}


def test_where_no_arm_is_left_a_device_drives_its_proxy(tmp_path: Path) -> None:
    config = of_launch_file(write_scene(tmp_path))
    assert config.pairs == {"arm1": ("Proxy0",), "second": ("Proxy1",)}
    assert [spec.topic for spec in config.proxies.values()] == [
        "/ambf/env/simulated_device/palm", "/ambf/env/simulated_device/palm1",
    ]  # fmt: skip
    assert config.proxies["Proxy0"].limits.tolist() == [[-0.3, 0.0], [0.5, 0.7]]
    assert (config.devices["arm1"].settings.jaw, config.devices["arm1"].settings.scale) == ((0.0, 1.0), 0.5)
    assert "third: not used, because the scene has no arm" in config.notes
    (tmp_path / "devices.yaml").write_text(
        (tmp_path / "devices.yaml").read_text().replace("  workspace", "  enable joint control: false\n  workspace")
    )
    assert of_launch_file(tmp_path / "launch.yaml", (0,)).proxies["Proxy0"].limits.shape == (2, 0)


def test_the_paired_camera_makes_the_view_of_a_scene_without_an_endoscope(scene: ligature.Scene) -> None:
    blind = replace(scene, arms=tuple(arm for arm in scene.arms if arm.name != "ECM"))
    config = of_devices(blind, [device("pen", "Falcon", **{"pair cameras": ["cameraR"]})], SMALL)
    assert config.camera == ""
    assert config.notes == ("the view is that of the camera 'cameraR' where the scene has it",)
    T = config.T_world_camera
    assert T is not None
    block = next(body for body in scene.bodies if body.identity.topic.endswith("/Block")).T_world_body[:3, 3]
    ahead = T[:3, :3].T @ (block - T[:3, 3])
    assert ahead[2] > np.hypot(ahead[0], ahead[1])


@pytest.mark.corpus
def test_each_input_device_of_others_is_understood_or_refused_with_a_reason(
    scene: ligature.Scene, corpus: Path, tmp_path: Path
) -> None:
    files = sorted(corpus.rglob("input_devices/*.yaml"))
    assert files
    for name in ("world", "environment", "colors"):
        shutil.copy(SMALL.parent / f"{name}.yaml", tmp_path)
    launch = tmp_path / "launch.yaml"
    launch.write_text(
        "world config: world.yaml\ncolor config: colors.yaml\ninput devices config: devices.yaml\nmultibody configs: []\n"
    )
    for file in files:
        shutil.copy(file, tmp_path / "devices.yaml")
        devices = ligature.load(launch).input_devices
        assert len(devices) == 7, file
        for each in devices:  # alone, as chosen with -i
            try:
                config = of_devices(scene, [each], file)
            except AdfError as error:
                assert each.root_link, each
                assert f"{each.key}: its root link '{each.root_link}' belongs to no arm" in str(error)
                continue
            (spec,) = config.devices.values()
            assert spec.settings.scale == float(each.settings["workspace scaling"])
            assert spec.force is not None
        notes = "\n".join(of_devices(scene, devices, file).notes)
        assert notes.count("because no arm is left") + notes.count("belongs to no arm") == 5, file
