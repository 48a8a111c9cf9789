"""The input devices of a scene's launch file as a teleoperation (§8 of the format).

The hardware's name tells the kind and the topics, the root link the arm. Metres, radians, newtons.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from ligature.adf.diagnostics import AdfError, Diagnostic, Severity
from ligature.model.frames import rpy_matrix
from ligature.model.load import load as load_scene
from ligature.model.scene import ArmKind, InputDevice, Scene
from ligature.teleop.calibration import Calibration
from ligature.teleop.config import TOPICS, DeviceSpec, TeleopConfig
from ligature.teleop.devices import module
from ligature.teleop.feedback import FeedbackSettings
from ligature.teleop.pairing import Settings

HARDWARE = (
    ("mtm", "mtm"), ("omni", "touch"), ("phantom", "touch"), ("touch", "touch"), ("geomagic", "touch"),
    ("falcon", "touch"), ("hydra", "hydra"), ("spacenav", "spacenav"), ("spacemouse", "spacenav"), ("joy", "joy"),
    ("pad", "joy"), ("keyboard", "keyboard"),
)  # fmt: skip
"""Parts of hardware names, in lower case, and the kinds of devices that they mean."""

BUTTONS = {"a1": "clutch", "a2": "camera", "g1": "close", "next mode": "next"}
NAMES_OF_BUTTONS = {"touch": ("grey", "white"), "hydra": ("bumper", "1", "2", "3", "4", "middle", "stick")}
HAPTIC_GAIN = 10.0
"""Linear gain in N/m that means forces as they are; others scale them."""


def of_launch_file(path: Path, indices: tuple[int, ...] | None = None) -> TeleopConfig:
    """The teleoperation of a launch file.

    ``indices`` choose among its devices, as AMBF's ``-i`` does. Raises `AdfError` when none can lead an arm.
    """
    scene = load_scene(path)
    devices = scene.input_devices
    for index in indices or ():
        if index >= len(devices):
            raise _problem(path, f"there is no input device {index}", f"there are {len(devices)}, from 0")
    return of_devices(scene, devices if indices is None else [devices[index] for index in indices], path)


def of_devices(scene: Scene, devices: Sequence[InputDevice], path: Path) -> TeleopConfig:
    """The teleoperation of some devices of a scene.

    A device leads the arm that has its root link, else the first arm that is free; it may be switched to all others.
    Devices that no adapter knows, and those for which no arm is left, are passed over.
    """
    arms = [arm.name for arm in scene.arms if arm.kind is ArmKind.PSM]
    known = [(device, spec) for device in devices if (spec := _spec(device)) is not None]
    wanted = {spec.name: arm for device, spec in known if (arm := _arm_of(scene, device)) is not None}
    pairs: dict[str, tuple[str, ...]] = {}
    for _, spec in known:
        taken = {followers[0] for followers in pairs.values()}
        free = [arm for arm in arms if arm not in taken and arm not in wanted.values()]
        first = wanted.get(spec.name) or next(iter(free), None)
        if first is not None and first not in taken:
            pairs[spec.name] = (first, *(arm for arm in arms if arm != first))
    if not pairs:
        raise _problem(
            path, "none of its input devices can lead an arm",
            f"arms: {', '.join(arms) or 'none'}; known names hold {', '.join(part for part, _ in HARDWARE)}",
        )  # fmt: skip
    cameras = [arm.name for arm in scene.arms if arm.kind is ArmKind.ECM]
    specs = {spec.name: spec for _, spec in known if spec.name in pairs}
    return TeleopConfig(specs, pairs, camera=cameras[0] if cameras else "ECM")


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


def _spec(device: InputDevice) -> DeviceSpec | None:
    hardware = device.hardware_name
    kind = next((kind for part, kind in HARDWARE if part in hardware.lower()), None)
    if kind is None:
        return None
    adapter, settings = module(kind), device.settings
    name = hardware if kind == "mtm" else device.key.replace(" ", "_")
    base: Calibration = adapter.DEFAULTS
    offset = settings.get("orientation offset") or {}
    handle = rpy_matrix(*(float(offset.get(axis, 0.0)) for axis in "rpy"))
    return DeviceSpec(
        name, kind, TOPICS.get(kind, f"/{name}/"), dict(adapter.OPTIONS),
        Calibration(base.axes, handle, base.closed, base.opened), _buttons(settings, kind), _force(settings),
        Settings(scale=float(settings.get("workspace scaling", 1.0))),
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
    gain = float(haptic.get("linear", HAPTIC_GAIN)) / HAPTIC_GAIN
    return FeedbackSettings(gain=gain, deadband=max(float(settings.get("deadband", 0.0)), 0.0))


def _problem(path: Path, message: str, hint: str) -> AdfError:
    return AdfError(Diagnostic(Severity.ERROR, f"{path}: {message}", None, hint, "teleop"))
