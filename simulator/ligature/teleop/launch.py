"""The input devices of a scene's launch file as a teleoperation.

The hardware's name determines the kind and the topics, the root link the arm. Metres, radians, newtons.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf.diagnostics import AdfError, Diagnostic, Severity
from ligature.model.frames import rpy_matrix
from ligature.model.load import load as load_scene
from ligature.model.optics import T_CAMERA_OPTICAL
from ligature.model.scene import ArmKind, InputDevice, Scene
from ligature.teleop.calibration import Calibration
from ligature.teleop.config import GRIP, TOPICS, DeviceSpec, ProxySpec, TeleopConfig
from ligature.teleop.devices import module
from ligature.teleop.feedback import FeedbackSettings
from ligature.teleop.pairing import Settings

Array = NDArray[np.float64]

HARDWARE = (
    ("mtm", "mtm"), ("omni", "touch"), ("phantom", "touch"), ("touch", "touch"), ("geomagic", "touch"),
    ("falcon", "touch"), ("hydra", "hydra"), ("spacenav", "spacenav"), ("spacemouse", "spacenav"), ("joy", "joy"),
    ("pad", "joy"), ("keyboard", "keyboard"), ("mouse", "mouse"),
)  # fmt: skip
"""Parts of hardware names, in lower case, and the kinds of devices that they mean."""

BUTTONS = {"a1": "clutch", "a2": "camera", "g1": "close", "next mode": "next", "prev mode": "previous"}
NAMES_OF_BUTTONS = {
    "mtm": (), "touch": ("grey", "white"), "hydra": ("bumper", "1", "2", "3", "4", "middle", "stick"),
}  # fmt: skip
"""By their indices; a master arm has pedals instead."""

PADDLES = ("left", "right")
"""Of a Razer Hydra, as its input devices claim them one after the other."""

HAPTIC_GAIN = 10.0
"""Gain in N/m that means forces as they are, and in N·m/rad torques; others scale them."""


def of_launch_file(path: Path, indices: tuple[int, ...] | None = None) -> TeleopConfig:
    """The teleoperation of a launch file.

    ``indices`` choose among its devices, as AMBF's ``-i`` does. Raises `AdfError` when none can drive an arm.
    """
    devices = load_scene(path).input_devices
    for index in indices or ():
        if not 0 <= index < len(devices):
            raise _problem(path, f"input device {index} does not exist", f"there are {len(devices)}, counted from 0")
    chosen = tuple(range(len(devices))) if indices is None else indices
    scene = load_scene(path, devices=chosen)
    return of_devices(scene, [scene.input_devices[index] for index in chosen], path)


def of_devices(scene: Scene, devices: Sequence[InputDevice], path: Path) -> TeleopConfig:
    """The teleoperation of some devices of a scene.

    A device drives the arm that has its root link, one without a root link the first arm that is free; it may be
    switched to all others. Where no arm is left it drives its proxy, if the scene has it. Devices that cannot drive are
    passed over; the notes give the reason, and what of the others has no effect.
    """
    arms = [arm.name for arm in scene.arms if arm.kind is ArmKind.PSM]
    specs, wanted, notes = _specs(scene, devices)
    pairs: dict[str, tuple[str, ...]] = {}
    proxies: dict[str, ProxySpec] = {}
    for number, (device, spec) in enumerate(specs):
        taken = {followers[0] for followers in pairs.values()}
        free = [arm for arm in arms if arm not in taken and arm not in wanted.values()]
        first = wanted.get(spec.name) or next(iter(free), None)
        if first is None and device.proxy >= 0:
            name = f"Proxy{len(proxies)}"
            pairs[spec.name], proxies[name] = (name,), _proxy(scene, device)
            force = spec.force and replace(spec.force, gain=1.0, torque_gain=1.0)  # the proxy's springs have the gains
            specs[number] = device, replace(spec, settings=replace(spec.settings, jaw=GRIP), force=force)
            continue
        if first is None or first in taken:
            why = f"{first} is driven already" if first else "no arm is left" if arms else "the scene has no arm"
            notes.append(f"{device.key}: not used, because {why}")
            continue
        pairs[spec.name] = (first, *(arm for arm in arms if arm != first))
        notes += [f"{device.key}: {note}" for note in _without_effect(device)]
    if not pairs:
        raise _problem(path, "none of its input devices can drive an arm", "; ".join(notes) or "it has none")
    chosen = [(device, spec) for device, spec in specs if spec.name in pairs]
    camera, T_world_camera = _view(scene, [device for device, _ in chosen], notes)
    return TeleopConfig(
        {spec.name: spec for _, spec in chosen}, pairs, camera, T_world_camera, notes=tuple(dict.fromkeys(notes)),
        proxies=proxies,
    )  # fmt: skip


def _proxy(scene: Scene, device: InputDevice) -> ProxySpec:
    """The proxy of a device; its grip drives the joints with limits, unless the device disables that."""
    root = scene.bodies[device.proxy]
    joints = [scene.joints[index] for index in root.joints]
    limits = np.array([[joint.low or 0.0, joint.high or 0.0] for joint in joints]).reshape(-1, 2).T
    if str(device.settings.get("enable joint control", True)).lower() in ("false", "0"):
        limits = limits[:, :0]
    gains = device.settings.get("haptic gain") or {}
    stiffness = float(gains.get("linear", 0.0)), float(gains.get("angular", 0.0))
    return ProxySpec(root.identity.topic, limits, stiffness)


def _specs(
    scene: Scene, devices: Sequence[InputDevice]
) -> tuple[list[tuple[InputDevice, DeviceSpec]], dict[str, str], list[str]]:
    """Devices that can drive, the arms that some of them name, and why the others cannot."""
    found: list[tuple[InputDevice, DeviceSpec]] = []
    wanted: dict[str, str] = {}
    notes: list[str] = []
    claimed: Counter[str] = Counter()
    for device in devices:
        kind = next((kind for part, kind in HARDWARE if part in device.hardware_name.lower()), None)
        if kind is None:
            known = ", ".join(part for part, _ in HARDWARE)
            notes.append(f"{device.key}: hardware '{device.hardware_name}' is unknown; known names contain {known}")
            continue
        one = kind if kind in TOPICS else device.hardware_name if kind == "mtm" else device.key
        if claimed[one] >= (len(PADDLES) if kind == "hydra" else 1):
            notes.append(f"{device.key}: '{device.hardware_name}' is claimed by another input device")
            continue
        arm = _arm_of(scene, device)
        if device.root_link and arm is None and "simulated multibody" not in device.settings:
            notes.append(f"{device.key}: its root link '{device.root_link}' belongs to no arm; only arms can be driven")
            continue
        spec = _spec(device, kind, claimed[one])
        claimed[one] += 1
        found.append((device, spec))
        if arm is not None:
            wanted[spec.name] = arm
    return found, wanted, notes


def _without_effect(device: InputDevice) -> list[str]:
    """Settings of a device that have no effect when arms are driven."""
    settings = device.settings
    notes = []
    if settings.get("simulated multibody"):
        notes.append("it drives the arm itself and not its proxy")
    unused = [key for key in ("controller gain", "location", "max force", "max jerk") if key in settings]
    if unused:
        notes.append(f"{', '.join(unused)}: no effect on an arm")
    if str(settings.get("enable joint control", True)).lower() in ("false", "0"):
        notes.append("enable joint control: ignored, the grip always drives the jaw")
    return notes


def _view(scene: Scene, devices: Sequence[InputDevice], notes: list[str]) -> tuple[str, Array | None]:
    """The arm that makes the view; in a scene without one, the pose (4, 4) of the first camera of a pair, or of all."""
    wanted = [name for device in devices for name in device.settings.get("pair cameras") or ()]
    cameras = {camera.identity.topic.rpartition("/")[2]: camera for camera in scene.cameras}
    notes += [f"pair cameras: the scene has no camera '{name}'" for name in wanted if name not in cameras]
    ecm = next((arm.name for arm in scene.arms if arm.kind is ArmKind.ECM), "")
    if ecm:
        return ecm, None
    chosen = next((name for name in wanted if name in cameras), next(iter(cameras), None))
    if chosen is None:
        return "ECM", None
    attachment = cameras[chosen].attachment
    T_world_camera = attachment.T_parent_object
    if attachment.parent is not None and attachment.parent[0] == "body":
        T_world_camera = scene.bodies[attachment.parent[1]].T_world_body @ T_world_camera
    notes.append(f"the view is that of the camera '{chosen}' where the scene has it")
    return "", T_world_camera @ T_CAMERA_OPTICAL


def _arm_of(scene: Scene, device: InputDevice) -> str | None:
    """The arm that has the root link among its bodies, found as AMBF finds bodies: by the end of the name."""
    wanted = device.root_link.replace("BODY ", "").replace("_", " ").lower()
    for arm in scene.arms if wanted else ():
        if arm.kind is not ArmKind.PSM:
            continue
        space = scene.bodies[arm.base].identity.topic.rpartition("/")[0]
        for body in scene.bodies:
            topic = body.identity.topic
            if topic.rpartition("/")[0] == space and topic.replace("_", " ").lower().endswith(wanted):
                return arm.name
    return None


def _spec(device: InputDevice, kind: str, number: int) -> DeviceSpec:
    """The device of a kind; ``number`` counts those that share its topics."""
    adapter, settings = module(kind), device.settings
    name = device.hardware_name if kind == "mtm" else device.key.replace(" ", "_")
    options = dict(adapter.OPTIONS)
    if kind == "hydra":
        options["paddle"] = PADDLES[number]
    base: Calibration = adapter.DEFAULTS
    offset = settings.get("orientation offset") or {}
    handle = rpy_matrix(*(float(offset.get(axis, 0.0)) for axis in "rpy"))
    return DeviceSpec(
        name, kind, TOPICS.get(kind, f"/{name}/"), options, Calibration(base.axes, handle, base.closed, base.opened),
        _buttons(settings, kind), _force(settings), Settings(scale=float(settings.get("workspace scaling", 1.0))),
    )  # fmt: skip


def _buttons(settings: Mapping[str, Any], kind: str) -> dict[str, str]:
    found: dict[str, str] = {}
    names = NAMES_OF_BUTTONS.get(kind)
    for key, action in BUTTONS.items():
        index = int((settings.get("button mapping") or {}).get(key, -1))
        if index < 0 or (action == "close" and index == 0):
            continue
        if names is None:
            found[str(index)] = action
        elif index < len(names):
            found[names[index]] = action
    return found


def _force(settings: Mapping[str, Any]) -> FeedbackSettings | None:
    haptic = settings.get("haptic gain")
    if not haptic:
        return None
    gain, torque_gain = (max(float(haptic.get(key, 0.0)), 0.0) / HAPTIC_GAIN for key in ("linear", "angular"))
    deadband = max(float(settings.get("deadband", 0.0)), 0.0)
    return FeedbackSettings(gain=gain, deadband=deadband, torque_gain=torque_gain)


def _problem(path: Path, message: str, hint: str) -> AdfError:
    return AdfError(Diagnostic(Severity.ERROR, f"{path}: {message}", None, hint, "teleop"))
