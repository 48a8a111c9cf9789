"""What a run is: the options that all processes of one run share, and how they travel to them."""

from __future__ import annotations

import json
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING

import ligature

if TYPE_CHECKING:
    from ligature.model.scene import Camera, Scene


@dataclass(frozen=True)
class RunOptions:
    """Options of a run.

    ``models`` are indices of the launch file (None: all), ``rate`` the updates per simulated second,
    ``speed`` simulated over wall time, ``bus`` the name of the shared memory block, ``min_hz`` and
    ``max_hz`` replace the publishing rates of all objects, ``names`` is the name policy,
    ``arms`` are arms as `arm_entry` reads them instead of those of the scene, ``src_crtk``
    whether arms also have the names of the suturing challenge's CRTK node, ``cameras``
    whether pictures are published (None: of those cameras for which the scene asks for it), ``window`` whether
    one is shown, ``task`` is a task that is judged, ``record`` a file that all commands are written to, ``cockpit`` is
    the address of the web page (empty: none), ``ros`` whether ROS is served, ``notes`` are lines for the user at
    the start, ``devices`` are indices of the input devices whose proxies are there, ``soft`` bodies
    that are soft tissue.
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
    task: str = ""
    record: str = ""
    cockpit: str = ""
    ros: bool = True
    notes: tuple[str, ...] = ()
    devices: tuple[int, ...] = ()
    soft: tuple[str, ...] = ()

    def load(self) -> Scene:
        """The scene of this run; raises `ligature.SceneError`."""
        arms = [arm_entry(text) for text in self.arms] if self.arms else None
        return ligature.load(
            self.scene, self.models, self.files, self.roots, self.prefix, arms, self.devices, self.soft
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
        """The options of `to_text`."""
        values = json.loads(text)
        for name in ("models", "files", "roots", "arms", "notes", "devices", "soft"):
            if values.get(name) is not None:
                values[name] = tuple(values[name])
        return cls(**values)


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
