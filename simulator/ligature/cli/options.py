"""The options that all processes of a run share, and how the supervisor passes them on."""

from __future__ import annotations

import json
import math
import re
from dataclasses import asdict, dataclass, replace
from types import UnionType
from typing import TYPE_CHECKING, Any, get_args, get_origin, get_type_hints

import ligature

if TYPE_CHECKING:
    from ligature.model.scene import ArmDescription, Camera, Scene


@dataclass(frozen=True)
class RunOptions:
    """Options of a run.

    Attributes
    ----------
    scene
        Launch file, model file, or name of a bundled scene.
    models, files, roots, prefix, devices, soft
        What is loaded of it, as `ligature.load` takes them.
    rate, speed
        Updates per simulated second, and simulated over wall time.
    bus
        Name of the shared memory block.
    min_hz, max_hz
        Replace the publishing rates of all objects.
    names
        The name policy.
    arms
        Arms, as `arm_entry` reads them, instead of those of the scene.
    only, masters
        Names of the arms that are there (empty: all), and whether master arms are.
    base_frames
        The arm in the frame of whose tip the others give their poses; empty: each in its base.
    src_crtk
        Whether arms also have the names of the suturing challenge's CRTK node.
    cameras
        Whether pictures are published; None: of those cameras for which the scene asks for it.
    window, camera_windows
        Whether a window is shown, and one for each camera.
    task
        A task that is judged.
    record
        A file that all commands are written to.
    cockpit
        Address of the web page; empty: none.
    ros
        Whether ROS is served.
    notes
        Lines for the user at the start.
    haptic_rate, haptic_fixed, haptic_forces
        Parameters for teleoperation: a rate in Hz (0: that of the device), whether one of its periods goes by between
        two forces, however long it was, and whether there are forces (None: as teleoperation has them).
    allow_plugins
        Whether the plug-ins that the scene's files name are run.
    """

    scene: str
    models: tuple[int, ...] | None = None
    files: tuple[str, ...] = ()
    roots: tuple[str, ...] = ()
    prefix: str = ""
    rate: float = 1000.0
    speed: float = 1.0
    bus: str = ""
    min_hz: int | None = None
    max_hz: int | None = None
    names: str = "ambf"
    arms: tuple[str, ...] = ()
    src_crtk: bool = False
    cameras: bool | None = None
    window: bool = False
    camera_windows: bool = False
    task: str = ""
    record: str = ""
    cockpit: str = ""
    ros: bool = True
    notes: tuple[str, ...] = ()
    devices: tuple[int, ...] = ()
    soft: tuple[str, ...] = ()
    only: tuple[str, ...] = ()
    masters: bool = True
    base_frames: str = ""
    haptic_rate: float = 0.0
    haptic_fixed: bool = False
    haptic_forces: bool | None = None
    allow_plugins: bool = False

    def load(self) -> Scene:
        """The scene of this run; raises `ligature.SceneError`."""
        arms = [arm_entry(text) for text in self.arms] if self.arms else None
        scene = ligature.load(
            self.scene, self.models, self.files, self.roots, self.prefix, arms, self.devices, self.soft
        )
        return self._permitted(replace(scene, arms=self._chosen(scene)))

    def _permitted(self, scene: Scene) -> Scene:
        """The scene without its plug-ins, unless they are allowed; a finding then names them."""
        from ligature.adf import Diagnostic, Severity  # the supervisor needs none of it

        if self.allow_plugins or not scene.plugins:
            return scene
        names = ", ".join(plugin.name for plugin in scene.plugins)
        text = f"the scene's plug-ins are not run: {names}"
        note = Diagnostic(Severity.INFO, text, hint="--allow-plugins runs them: their code can do all that you can")
        return replace(scene, plugins=(), diagnostics=(*scene.diagnostics, note))

    def _chosen(self, scene: Scene) -> tuple[ArmDescription, ...]:
        """The arms of a scene that are asked for; raises `ligature.SceneError` for one that is missing."""
        from ligature.adf import Diagnostic, Severity

        known = [arm.name for arm in scene.arms]
        missing = [name for name in self.only if name not in known]
        if missing:
            text = f"--only: the scene has no arm '{missing[0]}'; it has {', '.join(known) or 'none'}"
            raise ligature.SceneError(Diagnostic(Severity.ERROR, text))
        bodied = [arm.name for arm in scene.arms if arm.kind.value != "mtm"]
        if self.base_frames and (self.base_frames not in bodied or self.only and self.base_frames not in self.only):
            text = f"--base-frames: '{self.base_frames}' is not an arm of this run with a tip in the scene; write ECM"
            raise ligature.SceneError(Diagnostic(Severity.ERROR, text))
        return tuple(
            arm
            for arm in scene.arms
            if (not self.only or arm.name in self.only) and (self.masters or arm.kind.value != "mtm")
        )

    def shown_cameras(self, scene: Scene) -> tuple[Camera, ...]:
        """The cameras whose pictures are published."""
        if self.cameras is None:
            return tuple(c for c in scene.cameras if (c.publish_image or c.publish_depth) and not c.identity.passive)
        return scene.cameras if self.cameras else ()

    def to_text(self) -> str:
        """One line for the command line of a process."""
        return json.dumps(asdict(self))

    @classmethod
    def from_text(cls, text: str) -> RunOptions:
        """The options of `to_text`; raises ValueError for any other text, which a record of a stranger may hold."""
        try:
            values = json.loads(text)
        except (ValueError, RecursionError) as error:
            raise ValueError(f"the options of the run are not JSON: {error}") from None
        if not isinstance(values, dict):
            raise ValueError(f"the options of the run are {type(values).__name__}, not names with values")
        types = get_type_hints(cls)
        for name, value in values.items():
            if name not in types:
                raise ValueError(f"the options of the run have an unknown name '{name[:40]}'")
            if isinstance(value, list):
                value = values[name] = tuple(value)
            if not _fits(value, types[name]):
                raise ValueError(f"option '{name}' of the run is {str(value)[:40]!r}, not {types[name]}")
        if not isinstance(values.get("scene"), str):
            raise ValueError("the options of the run name no scene")
        options = cls(**values)
        if not (1.0 <= options.rate <= 1000.0 and 0.0 < options.speed < math.inf):
            raise ValueError(
                f"runs have 1 to 1000 updates per second and speeds above 0, not {options.rate:g} and {options.speed:g}"
            )
        return options


def _fits(value: object, type_: Any) -> bool:
    """Whether ``value`` is of a type such as ``tuple[int, ...] | None``."""
    if get_origin(type_) is UnionType:
        return any(_fits(value, each) for each in get_args(type_))
    if get_origin(type_) is tuple:
        return isinstance(value, tuple) and all(_fits(each, get_args(type_)[0]) for each in value)
    if type_ in (int, float):
        return isinstance(value, int if type_ is int else (int, float)) and not isinstance(value, bool)
    return isinstance(value, type_)


def arm_entry(text: str) -> dict[str, str]:
    """An arm from ``NAME=KIND[:BODY[:TOOL]]``, for example ``PSM1=psm:psm1/BODY base link:420006``.

    ``BODY`` is the base of a PSM or of an ECM with joints (``ecm``), or what carries the cameras (``camera``). Raises
    ValueError for a text that is none of this.
    """
    name, equals, rest = text.partition("=")
    kind, _, place = rest.partition(":")
    body, _, tool = place.partition(":")
    if not equals or kind not in ("psm", "ecm", "camera", "mtm") or bool(body) is (kind == "mtm"):
        raise ValueError(f"'{text}' is not an arm; write PSM1=psm:BODY:TOOL, ECM=ecm:BODY, ECM=camera:BODY or MTML=mtm")
    found = {"name": name, "kind": "ecm" if kind == "camera" else kind}
    if body:
        found["tip" if kind == "camera" else "base"] = body
    return {**found, "tool": tool} if tool else found


def name_prefix(text: str) -> str:
    """``text``, unless names of ROS cannot begin with it: then ValueError."""
    if not re.fullmatch(r"[A-Za-z0-9_/]*", text, re.ASCII):
        raise ValueError(f"'{text}' cannot begin names of ROS; write letters, digits, '_' and '/', such as /left")
    return text


def arm_names(text: str) -> tuple[str, ...]:
    """Names of a list such as ``PSM1, PSM2``; raises ValueError for one without any."""
    found = tuple(dict.fromkeys(part.strip() for part in text.split(",") if part.strip()))
    if text and not found:
        raise ValueError(f"'{text}' is not a list of arms such as PSM1,PSM2")
    return found


def model_indices(text: str) -> tuple[int, ...]:
    """Indices of a list such as ``10, 11,6``; raises ValueError."""
    try:
        found = tuple(int(part) for part in text.split(",") if part.strip())
    except ValueError:
        found = (-1,)
    if min(found, default=0) < 0:
        raise ValueError(f"'{text}' is not a list of whole numbers such as 10,11,6")
    return found


def rate_notes(rate: float) -> tuple[str, ...]:
    """The note about a rate of updates that is no whole number of ticks."""
    ticks = max(1, round(1000.0 / rate))
    if abs(1000.0 / rate - ticks) < 1e-6:
        return ()
    return (
        f"-p {rate:g}: an update is a whole number of 1 ms ticks; "
        f"using {ticks} ms, {1000.0 / ticks:.4g} updates per second",
    )
