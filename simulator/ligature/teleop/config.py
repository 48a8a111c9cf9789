"""Reads teleoperation files (YAML): devices, pairs, settings; reports every error with its file, line and column.

Metres, radians, newtons, seconds. `docs/teleoperation.md` shows a file.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf.diagnostics import AdfError, Diagnostic, Mark, Severity
from ligature.adf.nodes import Mapping as Block
from ligature.adf.nodes import Node, Scalar, Sequence, parse
from ligature.adf.scalars import flag, number
from ligature.model.commands import MarkPhase
from ligature.model.frames import frame, rpy_matrix
from ligature.paths import open_file
from ligature.teleop.calibration import Calibration, Unclear, axes_of_angles, axes_of_words
from ligature.teleop.devices import KINDS, module
from ligature.teleop.feedback import FeedbackSettings
from ligature.teleop.handset import ACTIONS, MARKS
from ligature.teleop.pairing import Settings

Array = NDArray[np.float64]

TOPICS = {"hydra": "/hydra_calib", "joy": "/joy", "spacenav": "/spacenav/joy", "keyboard": "", "mouse": ""}
"""Topics of devices whose name does not show it."""

NOBODY = "none"
"""First in a list of followers: the device waits until a follower is selected."""


@dataclass(frozen=True, eq=False)
class DeviceSpec:
    """One device: its kind, topics, options, calibration, buttons, forces, and the settings of its pairings."""

    name: str
    kind: str
    topic: str
    options: Mapping[str, Any] = field(default_factory=dict)
    calibration: Calibration = field(default_factory=Calibration)
    buttons: Mapping[str, str] = field(default_factory=dict)
    force: FeedbackSettings | None = None
    settings: Settings = field(default_factory=Settings)


GRIP = (0.0, 1.0)
"""Angles of a proxy's grip that mean closed and open."""


@dataclass(frozen=True, eq=False)
class ProxySpec:
    """A proxy's root link on ROS.

    ``limits`` (2, n) are those of the joints that the grip drives, in the order of its commands. ``stiffness`` is that
    of the springs between proxy and hand which the hand feels, in N/m and N·m/rad.
    """

    topic: str
    limits: Array
    stiffness: tuple[float, float] = (0.0, 0.0)


FORMER_KEYS = {"patience": "timeout", "fastest": "max velocity", "quickest": "max angular velocity"}
"""Keys as version 0.1 called them, and their names now."""


@dataclass(frozen=True, eq=False)
class TeleopConfig:
    """A whole teleoperation.

    ``pairs`` are the followers that each device may drive, the first one first; those ``waiting`` drive none until they
    are selected. ``camera`` is the arm whose tip makes the view, or, when there is none, ``T_world_camera`` (4, 4) the
    view in the world. ``rcm_guard`` is the least distance of a tip from its remote centre in metres. ``notes`` are
    lines for the user. ``phases`` are those of the work, which buttons mark one after the other, and so does the pedal
    with the topic ``phase_pedal``. ``proxies`` are the followers that are no arms.
    """

    devices: Mapping[str, DeviceSpec]
    pairs: Mapping[str, tuple[str, ...]]
    camera: str = "ECM"
    T_world_camera: Array | None = None
    camera_scale: float = 1.0
    enabled: bool = True
    prefix: str = "/"
    rcm_guard: float = 0.05
    notes: tuple[str, ...] = ()
    waiting: frozenset[str] = frozenset()
    phases: tuple[str, ...] = ()
    phase_pedal: str = ""
    proxies: Mapping[str, ProxySpec] = field(default_factory=dict)

    def begins_with(self, leader: str) -> str:
        """The follower of ``leader`` at the start; empty when it waits, or drives the camera alone."""
        return next(iter(self.pairs[leader]), "") if leader not in self.waiting else ""


def with_timeout(config: TeleopConfig, seconds: float) -> TeleopConfig:
    """The same with another `Settings.timeout` for all devices; raises `ValueError` for one that is not positive."""
    if not 0.0 < seconds < np.inf:
        raise ValueError(f"the timeout must be above 0 s, not {seconds:g}")
    devices = {
        name: replace(spec, settings=replace(spec.settings, timeout=seconds)) for name, spec in config.devices.items()
    }
    return replace(config, devices=devices)


def with_prefix(config: TeleopConfig, text: str) -> TeleopConfig:
    """The same for arms and a console whose topics begin with ``text``, such as ``/left``."""
    return replace(config, prefix=_folder(text))


def _folder(text: str) -> str:
    return "/" + "".join(f"{part}/" for part in text.split("/") if part)


def read(path: Path) -> TeleopConfig:
    """The configuration in a file; raises `AdfError`, whose diagnostics name file, line and what would be right."""
    return from_text(text_of(path), path)


def text_of(path: Path) -> str:
    """What is in a text file; raises `AdfError` with the place of what is no text."""
    with open_file(path) as file:
        data = file.read()
    try:
        return data.decode("utf-8")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        mark = Mark(path, line, error.start - (data.rfind(b"\n", 0, error.start) + 1) + 1)
        raise AdfError(
            Diagnostic(Severity.ERROR, f"byte {data[error.start]:#04x} is not UTF-8", mark, "", "teleop")
        ) from None


def from_text(text: str, path: Path) -> TeleopConfig:
    """The configuration in a text; ``path`` is where it would be."""
    return _Reader(path).config(parse(text, path))


class _Reader:
    """Walks the nodes; the first thing that is wrong raises `AdfError`."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._notes: list[str] = []

    # --- values

    def fail(self, mark: Mark, message: str, hint: str = "") -> AdfError:
        return AdfError(Diagnostic(Severity.ERROR, message, mark, hint, "teleop"))

    def known(self, block: Block, keys: tuple[str, ...], what: str) -> None:
        """Raise for keys that ``what`` lacks; keys of version 0.1 get the name that they have now, with a note."""
        for former, key in FORMER_KEYS.items():
            if former in block.entries and key in keys:
                name, value = block.entries.pop(former)
                if key in block.entries:
                    raise self.fail(name.mark, f"{what} has both '{former}' and '{key}'", f"keep '{key}'")
                block.entries[key] = name, value
                self._notes.append(f"{name.mark}: '{former}' is deprecated; write '{key}'")
        for key, (name, _) in block.entries.items():
            if key not in keys:
                raise self.fail(name.mark, f"{what} has no key '{key}'", f"choose one of {', '.join(keys)}")

    def block(self, node: Node, what: str) -> Block:
        if not isinstance(node, Block):
            raise self.fail(node.mark, f"{what} must be a mapping", "write 'key: value' lines")
        return node

    def text(self, node: Node, what: str) -> str:
        if not isinstance(node, Scalar):
            raise self.fail(node.mark, f"{what} must be one word", "write it without brackets and lists")
        return node.text

    def number(self, node: Node, what: str, low: float = -np.inf, high: float = np.inf) -> float:
        try:
            value = number(self.text(node, what))
        except ValueError:
            raise self.fail(
                node.mark, f"{what} must be a number, not '{self.text(node, what)}'", "such as 0.5"
            ) from None
        if not (np.isfinite(value) and low <= value <= high):
            raise self.fail(node.mark, f"{what} must be within {low:g} … {high:g}, not {value:g}")
        return value

    def flag(self, node: Node, what: str) -> bool:
        try:
            return flag(self.text(node, what))
        except ValueError:
            raise self.fail(node.mark, f"{what} must be true or false, not '{self.text(node, what)}'") from None

    def items(self, node: Node, what: str, count: int | None = None) -> list[Node]:
        if not isinstance(node, Sequence) or (count is not None and len(node.items) != count):
            raise self.fail(
                node.mark, f"{what} must be a list" + (f" of {count}" if count else ""), "write '[a, b, c]'"
            )
        return node.items

    def numbers(self, node: Node, what: str, count: int) -> tuple[float, ...]:
        return tuple(self.number(item, what) for item in self.items(node, what, count))

    # --- parts

    def config(self, root: Block) -> TeleopConfig:
        self.known(root, ("devices", "pairs", "settings", "camera", "camera scale", "enabled", "prefix", "rcm guard",
                          "phases", "phase pedal"), "a teleoperation")  # fmt: skip
        settings = self.settings(root, Settings())
        found = root.get("devices")
        if found is None:
            raise self.fail(root.mark, "there are no devices", "write 'devices: {MTMR: {kind: mtm}}'")
        devices = {
            name: self.device(name, self.block(node, f"device {name}"), settings)
            for name, (_, node) in self.block(found, "devices").entries.items()
        }
        extra: dict[str, Any] = {}
        if (node := root.get("camera")) is not None:
            extra.update(self.camera(node))
        if (node := root.get("camera scale")) is not None:
            extra["camera_scale"] = self.number(node, "camera scale", 1e-3, 100.0)
        if (node := root.get("enabled")) is not None:
            extra["enabled"] = self.flag(node, "enabled")
        if (node := root.get("prefix")) is not None:
            extra["prefix"] = _folder(self.text(node, "prefix"))
        if (node := root.get("rcm guard")) is not None:
            extra["rcm_guard"] = self.number(node, "rcm guard", 0.0, 0.2)
        extra.update(self.phases(root, devices))
        pairs, waiting = self.pairs(root, devices)
        return TeleopConfig(devices, pairs, waiting=waiting, notes=tuple(self._notes), **extra)

    def pairs(
        self, root: Block, devices: Mapping[str, DeviceSpec]
    ) -> tuple[dict[str, tuple[str, ...]], frozenset[str]]:
        found = root.get("pairs")
        if found is None:
            raise self.fail(root.mark, "there are no pairs", "write 'pairs: {MTMR: [PSM1, PSM3]}'")
        pairs: dict[str, tuple[str, ...]] = {}
        waiting: set[str] = set()
        for name, (key, node) in self.block(found, "pairs").entries.items():
            if name not in devices:
                raise self.fail(key.mark, f"unknown device '{name}'", f"choose one of {', '.join(devices)}")
            arms = self.items(node, f"followers of {name}") if isinstance(node, Sequence) else [node]
            followers = tuple(self.text(arm, "a follower") for arm in arms)
            if followers[:1] == (NOBODY,):
                waiting.add(name)
                followers = followers[1:]
            for other, others in pairs.items():
                if followers and followers[:1] == others[:1] and not waiting & {name, other}:
                    raise self.fail(
                        node.mark, f"{name} and {other} would both start with {followers[0]}",
                        f"begin one of the lists with another arm, or with '{NOBODY}' to make it wait",
                    )  # fmt: skip
            pairs[name] = followers
        return pairs, frozenset(waiting)

    def phases(self, root: Block, devices: Mapping[str, DeviceSpec]) -> dict[str, Any]:
        """The list of phases, and the pedal that marks them."""
        listed, pedal = root.get("phases"), root.get("phase pedal")
        phases = []
        for node in self.items(listed, "phases") if listed is not None else []:
            try:
                phases.append(MarkPhase.of(self.text(node, "a phase")).phase)
            except ValueError as error:
                raise self.fail(node.mark, str(error)) from None
            if not phases[-1] or phases[-1] in phases[:-1]:
                raise self.fail(node.mark, f"the phase '{phases[-1]}' is empty or listed twice", "name each phase once")
        marking = next((name for name, spec in devices.items() if set(MARKS) & set(spec.buttons.values())), "")
        if not phases and (pedal is not None or marking):
            raise self.fail(
                root.mark if pedal is None else pedal.mark,
                f"{f'a button of {marking}' if marking else 'the pedal'} marks phases, and there are none",
                "list them: 'phases: [reach, grasp, drive]'",
            )
        return {
            "phases": tuple(phases),
            "phase_pedal": self.text(pedal, "phase pedal").strip("/") if pedal is not None else "",
        }

    def camera(self, node: Node) -> dict[str, Any]:
        if isinstance(node, Scalar):
            return {"camera": node.text}
        block = self.block(node, "camera")
        self.known(block, ("position", "rpy"), "a camera")
        values = {key: (0.0, 0.0, 0.0) for key in ("position", "rpy")}
        for key, (_, value) in block.entries.items():
            values[key] = self.numbers(value, key, 3)  # type: ignore[assignment]
        return {"camera": "", "T_world_camera": frame(rpy_matrix(*values["rpy"]), values["position"])}

    def device(self, name: str, block: Block, settings: Settings) -> DeviceSpec:
        node = block.get("kind")
        kind = self.text(node, "kind") if node is not None else ""
        if kind not in KINDS:
            mark = node.mark if node is not None else block.mark
            raise self.fail(mark, f"device {name} has the unknown kind '{kind}'", f"choose one of {', '.join(KINDS)}")
        adapter = module(kind)
        own = ("kind", "topic", "axes", "handle", "grip", "buttons", "force", "settings")
        self.known(block, (*own, *adapter.OPTIONS), f"device {name}")
        options = dict(adapter.OPTIONS)
        for key in adapter.OPTIONS:
            if (value := block.get(key)) is not None:
                options[key] = self.like(value, adapter.OPTIONS[key], key)
        topic = self.text(block.entries["topic"][1], "topic") if "topic" in block.entries else TOPICS.get(kind)
        force = self.force(block.get("force"))
        return DeviceSpec(
            name, kind, f"/{name}/" if topic is None else topic, options,
            self.calibration(block, adapter.DEFAULTS), self.buttons(block.get("buttons")), force,
            self.settings(block, settings),
        )  # fmt: skip

    def like(self, node: Node, default: Any, what: str) -> Any:
        if isinstance(default, float):
            return self.number(node, what, 0.0)
        if isinstance(default, list):
            return [self.text(item, what) for item in self.items(node, what, len(default))]
        return self.text(node, what)

    def calibration(self, block: Block, default: Calibration) -> Calibration:
        axes, handle = default.axes, default.handle
        if (node := block.get("axes")) is not None:
            axes = self.axes(node)
        if (node := block.get("handle")) is not None:
            handle = axes_of_angles(self.numbers(node, "handle", 3))
        closed, opened = default.closed, default.opened
        if (node := block.get("grip")) is not None:
            closed, opened = self.numbers(node, "grip", 2)
            if closed == opened:
                raise self.fail(node.mark, "a closed and an open grip must differ")
        return Calibration(axes, handle, closed, opened)

    def axes(self, node: Node) -> Array:
        texts = [self.text(item, "axes") for item in self.items(node, "axes", 3)]
        try:
            return axes_of_angles([number(text) for text in texts])
        except ValueError:
            pass
        try:
            return axes_of_words(*texts)
        except Unclear as error:
            raise self.fail(node.mark, str(error), "write three words or three angles") from None

    def buttons(self, node: Node | None) -> dict[str, str]:
        if node is None:
            return {}
        found = {}
        for button, (_, action) in self.block(node, "buttons").entries.items():
            found[button] = self.text(action, f"button {button}")
            if found[button] not in ACTIONS:
                raise self.fail(
                    action.mark, f"a button cannot '{found[button]}'", f"it can {', '.join(ACTIONS)}"
                )  # fmt: skip
        return found

    def force(self, node: Node | None) -> FeedbackSettings | None:
        if node is None:
            return None
        block = self.block(node, "force")
        names = {f.name.replace("_", " "): f.name for f in fields(FeedbackSettings)}
        self.known(block, tuple(names), "a force")
        values = {names[key]: self.number(value, key, 0.0) for key, (_, value) in block.entries.items()}
        return FeedbackSettings(**values)

    def settings(self, block: Block, base: Settings) -> Settings:
        node = block.get("settings")
        if node is None:
            return base
        own = self.block(node, "settings")
        names = {f.name.replace("_", " "): f.name for f in fields(Settings)}
        self.known(own, tuple(names), "settings")
        values: dict[str, Any] = {f.name: getattr(base, f.name) for f in fields(Settings)}
        for key, (_, value) in own.entries.items():
            values[names[key]] = self.setting(names[key], value, key)
        return Settings(**values)

    def setting(self, name: str, node: Node, what: str) -> Any:
        if name == "workspace":
            low, high = (self.numbers(corner, what, 3) for corner in self.items(node, what, 2))
            if not np.all(np.array(low) < np.array(high)):
                raise self.fail(node.mark, "the first corner of the workspace must be below the second one")
            return low, high
        if name == "jaw":
            return self.numbers(node, what, 2)
        if isinstance(getattr(Settings(), name), bool):
            return self.flag(node, what)
        return self.number(node, what, 0.0)
