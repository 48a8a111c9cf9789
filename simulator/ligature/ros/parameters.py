"""Object parameters on the parameter server (interface reference §2.6)."""

from __future__ import annotations

from collections.abc import Callable

import rospy

from ligature.model.scene import Camera, Light, Scene

Value = float | str | list[str]

PERIOD = 2.0
"""Seconds between looks at the server, as in the reference."""


def camera_parameters(camera: Camera) -> dict[str, Value]:
    """Name and value of every parameter of a camera."""
    separation, focal = camera.stereo or (0.2, 0.5)
    return {
        "near_plane": camera.near,
        "far_plane": camera.far,
        "field_view_angle": camera.field_of_view,
        "orthographic_view_width": camera.orthographic_width or 0.0,
        "stereo_eye_separation": separation,
        "stereo_focal_length": focal,
        "projection": "PERSPECTIVE" if camera.orthographic_width is None else "ORTHOGRAPHIC",
        "mode": "MONO" if camera.stereo is None else "STEREO",
        "parent_name": camera.identity.parent_text,
    }


def light_parameters(light: Light) -> dict[str, Value]:
    """Name and value of every parameter of a light."""
    return {
        "cutoff_angle": light.cutoff,
        "parent_name": light.identity.parent_text,
        "type": "SPOT",
        "attenuation/constant": light.attenuation[0],
        "attenuation/linear": light.attenuation[1],
        "attenuation/quadratic": light.attenuation[2],
    }


class Parameters:
    """Writes the parameters of a scene at start-up, and again when the server has lost them."""

    def __init__(self, scene: Scene) -> None:
        self._values: dict[str, Value] = {
            f"{scene.world.topic}/point_cloud_topics": [f"{scene.world.topic}/point_cloud"]
        }
        for camera in scene.cameras:
            self._add(camera.identity.topic, camera_parameters(camera))
        for light in scene.lights:
            self._add(light.identity.topic, light_parameters(light))
        self._next = 0.0
        self._write()

    def poll(self, now: float, push: Callable[..., None]) -> None:
        """Every two seconds: write parameters that a restarted master has lost."""
        del push
        if now < self._next:
            return
        self._next = now + PERIOD
        try:
            lost = [name for name in self._values if not rospy.has_param(name)]
            for name in lost:
                rospy.set_param(name, self._values[name])
        except (OSError, rospy.ROSException):
            return

    def _add(self, topic: str, values: dict[str, Value]) -> None:
        self._values.update({f"{topic}/{name}": value for name, value in values.items()})

    def _write(self) -> None:
        for name, value in self._values.items():
            rospy.set_param(name, value)
