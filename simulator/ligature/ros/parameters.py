"""Object parameters on the parameter server (as in AMBF): written at start, followed while running.

The ROS process writes them and follows ``parent_name``; the camera process follows what pictures depend on.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import rosgraph
import rospy

from ligature.model.commands import ParentCommand
from ligature.model.lookup import find_by_text
from ligature.model.scene import Camera, Light, Scene

Value = float | str | list[Any]
Values = Mapping[str, Any]

PERIOD = 2.0
"""Seconds between reads of the parameter server, as in the reference."""

DEFAULT_STEREO = (0.2, 0.5)
DEFAULT_ANGLE, DEFAULT_WIDTH = 0.7, 10.0
"""What zero means for the field of view (radians) and the width of an orthographic view (metres)."""

LIGHT_TYPES = ("SPOT", "POINT", "DIRECTIONAL")
SENSOR: dict[str, Value] = {
    "exposure": 0.0,
    "noise": 0.0,
    "distortion": [0.0] * 5,
    "depth_noise": 0.0,
    "seed": 0,
}
"""Faults of a camera's lens and sensor, below ``<camera>/sensor``; none at start."""


@dataclass(frozen=True)
class LightValues:
    """What the parameters of a light state: type, half angle in radians, attenuation."""

    type: str
    cutoff: float
    attenuation: tuple[float, float, float]


def camera_parameters(camera: Camera) -> dict[str, Value]:
    """Name and value of every parameter of a camera."""
    separation, focal = camera.stereo or DEFAULT_STEREO
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
        **{f"sensor/{name}": value for name, value in SENSOR.items()},
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


def camera_with(camera: Camera, values: Values) -> Camera:
    """``camera`` with the parameters in ``values``; raises ValueError that names what is wrong.

    A lens that the file gives by ``camera intrinsics`` or ``projection matrix`` keeps its angle.
    """
    get = {**camera_parameters(camera), **values}
    near, far = _number(get, "near_plane", 0.0), _number(get, "far_plane", 0.0)
    if not 0.0 < near < far:
        raise ValueError(f"near_plane {near:g} and far_plane {far:g} must satisfy 0 < near < far")
    angle = _number(get, "field_view_angle", 0.0) or DEFAULT_ANGLE
    if angle >= math.pi:
        raise ValueError(f"field_view_angle {angle:g} must be below pi")
    width = _number(get, "orthographic_view_width", 0.0) or DEFAULT_WIDTH
    separation, focal = _number(get, "stereo_eye_separation", 0.0), _number(get, "stereo_focal_length", 1e-6)
    flat = _choice(get, "projection", ("PERSPECTIVE", "ORTHOGRAPHIC")) == "ORTHOGRAPHIC"
    double = _choice(get, "mode", ("MONO", "STEREO")) == "STEREO"
    return replace(
        camera,
        near=near,
        far=far,
        field_of_view=angle,
        orthographic_width=width if flat else None,
        stereo=(separation, focal) if double else None,
    )


def light_with(light: Light, values: Values) -> LightValues:
    """What the parameters state of ``light``; raises ValueError that names what is wrong."""
    get = {**light_parameters(light), **values}
    cutoff = min(_number(get, "cutoff_angle", 0.0), math.pi / 2)
    attenuation = [_number(get, f"attenuation/{name}", 0.0) for name in ("constant", "linear", "quadratic")]
    if not any(attenuation):
        raise ValueError("attenuation: constant, linear and quadratic must not all be 0")
    return LightValues(_choice(get, "type", LIGHT_TYPES), cutoff, (attenuation[0], attenuation[1], attenuation[2]))


def sensor_with(values: Values) -> dict[str, Any]:
    """The faults of a camera in ``values``, by the names of `SENSOR`; raises ValueError that names what is wrong."""
    get = {f"sensor/{name}": value for name, value in SENSOR.items()} | dict(values)
    lens = get["sensor/distortion"]
    if not isinstance(lens, list) or len(lens) != len(SENSOR["distortion"]):  # type: ignore[arg-type]
        raise ValueError(f"sensor/distortion is {lens!r}; expected the 5 numbers k1, k2, p1, p2, k3")
    numbers = {f"sensor/distortion {i}": value for i, value in enumerate(lens)}
    return {
        "exposure": _number(get, "sensor/exposure", -math.inf),
        "noise": _number(get, "sensor/noise", 0.0),
        "distortion": tuple(_number(numbers, name, -math.inf) for name in numbers),
        "depth_noise": _number(get, "sensor/depth_noise", 0.0),
        "seed": int(_number(get, "sensor/seed", 0.0)),
    }


class Server:
    """The parameter server, which is read every two seconds."""

    def __init__(self) -> None:
        self._next = 0.0

    def read(self) -> Any:
        """The tree of all parameters when it is due, else None; from the server itself.

        ``rospy.get_param("/")`` answers from a cache that holds a single entry once the node has logged a warning.
        """
        now = time.monotonic()
        if now < self._next:
            return None
        self._next = now + PERIOD
        return rosgraph.Master(rospy.get_name()).getParam("/")


class Parameters:
    """Writes the parameters of a scene at start-up, and again when the server has lost them.

    A changed ``parent_name`` becomes a command for ``send``.
    """

    def __init__(self, scene: Scene, send: Callable[[ParentCommand], None]) -> None:
        self._send = send
        self._scene = scene
        self._values: dict[str, Value] = {
            f"{scene.world.topic}/point_cloud_topics": [f"{scene.world.topic}/point_cloud"]
        }
        self._children: dict[str, tuple[str, int]] = {}
        for camera in scene.cameras:
            self._add(camera.identity.topic, camera_parameters(camera), ("camera", camera.index))
        for light in scene.lights:
            self._add(light.identity.topic, light_parameters(light), ("light", light.index))
        self._server = Server()
        for name, value in self._values.items():
            rospy.set_param(name, value)

    def poll(self) -> None:
        """Every two seconds: write what a restarted master has lost, follow new parents."""
        tree = self._server.read()
        if tree is None:
            return
        for name, value in self._values.items():
            found = look_up(tree, name)
            if found is None:
                rospy.set_param(name, value)
            elif found != value:
                self._values[name] = found
                if name in self._children:
                    self._adopt(name, found)

    def _adopt(self, name: str, text: object) -> None:
        """Give an object the parent that ``text`` means."""
        kind, index = self._children[name]
        if text == "":
            self._send(ParentCommand(kind, index, None))
            return
        identifiers = [body.identity.identifier for body in self._scene.bodies]
        found = find_by_text(identifiers, text) if isinstance(text, str) else None
        if found is None:
            rospy.logwarn(f"{name} is {text!r}: no body or several bodies match; keeping the parent")
            return
        self._send(ParentCommand(kind, index, found))

    def _add(self, topic: str, values: dict[str, Value], child: tuple[str, int]) -> None:
        self._values.update({f"{topic}/{name}": value for name, value in values.items()})
        self._children[f"{topic}/parent_name"] = child


class Follower:
    """Reads the parameters of cameras and lights; what cannot be used is reported once and left out."""

    def __init__(self, scene: Scene) -> None:
        self._scene = scene
        self._server = Server()
        self._reported: set[str] = set()
        self.cameras = {camera.index: camera for camera in scene.cameras}
        self.lights = {light.index: light_with(light, {}) for light in scene.lights}
        self.sensors = {camera.index: sensor_with({}) for camera in scene.cameras}

    def poll(self) -> None:
        """Every two seconds: read what users have set."""
        tree = self._server.read()
        if tree is None:
            return
        for camera in self._scene.cameras:
            values = _below(tree, camera.identity.topic, camera_parameters(camera))
            self._read(camera, values, partial(camera_with, camera), self.cameras)
            self._read(camera, values, sensor_with, self.sensors)
        for light in self._scene.lights:
            values = _below(tree, light.identity.topic, light_parameters(light))
            self._read(light, values, partial(light_with, light), self.lights)

    def _read(self, item: Camera | Light, values: Values, make: Callable[[Values], Any], into: dict[int, Any]) -> None:
        try:
            into[item.index] = make(values)
        except ValueError as error:
            text = f"{item.identity.topic}: {error}; keeping the previous values"
            if text not in self._reported:
                rospy.logwarn(text)
            self._reported.add(text)


def _below(tree: Any, topic: str, names: Values) -> dict[str, Any]:
    """The parameters of ``names`` that the server has below ``topic``."""
    found = {name: look_up(tree, f"{topic}/{name}") for name in names}
    return {name: value for name, value in found.items() if value is not None}


def look_up(tree: Any, name: str) -> Any:
    """The value of a parameter in the tree of all; None when it is missing."""
    for part in name.strip("/").split("/"):
        if not isinstance(tree, dict):
            return None
        tree = tree.get(part)
    return tree


def _number(values: Values, name: str, least: float) -> float:
    value = values[name]
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value) or value < least:
        expected = "a finite number" if math.isinf(least) else f"a number of at least {least:g}"
        raise ValueError(f"{name} is {value!r}; expected {expected}")
    return float(value)


def _choice(values: Values, name: str, choices: tuple[str, ...]) -> str:
    value = values[name]
    if value not in choices:
        raise ValueError(f"{name} is {value!r}; expected {' or '.join(choices)}")
    return str(value)
