"""Object parameters on the parameter server (interface reference §2.6)."""

from __future__ import annotations

import time
from typing import Any

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
        for name, value in self._values.items():
            rospy.set_param(name, value)

    def poll(self) -> None:
        """Every two seconds: write what a restarted master has lost, tell what a user changed in vain."""
        now = time.monotonic()
        if now < self._next:
            return
        self._next = now + PERIOD
        tree = rospy.get_param("/")
        for name, value in self._values.items():
            found = _look_up(tree, name)
            if found is None:
                rospy.set_param(name, value)
            elif found != value:
                rospy.logwarn(f"{name} was set to {found!r}: a running scene does not follow its parameters yet")
                self._values[name] = found

    def _add(self, topic: str, values: dict[str, Value]) -> None:
        self._values.update({f"{topic}/{name}": value for name, value in values.items()})


def _look_up(tree: Any, name: str) -> Any:
    """The value of a parameter in the tree of all; None when it is not there."""
    for part in name.strip("/").split("/"):
        if not isinstance(tree, dict):
            return None
        tree = tree.get(part)
    return tree
