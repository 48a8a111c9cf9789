"""Run-time parameters of cameras and lights: what they mean, and what is stated of nonsense."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import ligature
import pytest
from ligature.model.scene import Camera, Light
from ligature.ros import parameters

SMALL = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"


@pytest.fixture(scope="module")
def camera() -> Camera:
    return ligature.load(SMALL).cameras[0]


@pytest.fixture(scope="module")
def light() -> Light:
    return ligature.load(SMALL).lights[0]


def test_the_parameters_written_at_start_change_nothing(camera: Camera, light: Light) -> None:
    for lens in (camera, replace(camera, stereo=(0.01, 0.2)), replace(camera, orthographic_width=3.0)):
        again = parameters.camera_with(lens, parameters.camera_parameters(lens))
        assert parameters.camera_parameters(again) == parameters.camera_parameters(lens)
    found = parameters.light_with(light, parameters.light_parameters(light))
    assert found == parameters.LightValues("SPOT", light.cutoff, light.attenuation)


def test_zero_means_the_references_defaults(camera: Camera) -> None:
    assert parameters.camera_with(camera, {"field_view_angle": 0.0}).field_of_view == 0.7
    flat = parameters.camera_with(camera, {"projection": "ORTHOGRAPHIC", "orthographic_view_width": 0})
    assert flat.orthographic_width == 10.0


def test_projection_and_mode_switch(camera: Camera, light: Light) -> None:
    double = parameters.camera_with(camera, {"mode": "STEREO", "stereo_eye_separation": 0.01})
    assert double.stereo == (0.01, 0.5)
    assert parameters.camera_with(double, {"mode": "MONO"}).stereo is None
    assert parameters.light_with(light, {"type": "POINT"}).type == "POINT"
    assert parameters.light_with(light, {"cutoff_angle": 3.0}).cutoff == pytest.approx(math.pi / 2)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"near_plane": -1.0}, "near_plane is -1.0; expected a number of at least 0"),
        ({"near_plane": 5.0, "far_plane": 2.0}, "near_plane 5 and far_plane 2 must satisfy 0 < near < far"),
        ({"field_view_angle": 4.0}, "field_view_angle 4 must be below pi"),
        ({"field_view_angle": "wide"}, "field_view_angle is 'wide'; expected a number of at least 0"),
        ({"projection": "FISHEYE"}, "projection is 'FISHEYE'; expected PERSPECTIVE or ORTHOGRAPHIC"),
        ({"mode": True}, "mode is True; expected MONO or STEREO"),
    ],
)
def test_a_camera_parameter_that_is_invalid_is_named(camera: Camera, values: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parameters.camera_with(camera, values)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"sensor/distortion": [1, 2]}, r"sensor/distortion is \[1, 2\]; expected the 5 numbers k1, k2, p1, p2, k3"),
        ({"sensor/noise": -0.1}, "sensor/noise is -0.1; expected a number of at least 0"),
        ({"sensor/exposure": float("nan")}, "sensor/exposure is nan; expected a finite number"),
    ],
)
def test_a_sensor_parameter_that_is_invalid_is_named(values: dict, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        parameters.sensor_with(values)


def test_a_light_without_any_attenuation_is_refused(light: Light) -> None:
    with pytest.raises(ValueError, match="must not all be 0"):
        parameters.light_with(light, {"attenuation/constant": 0})
