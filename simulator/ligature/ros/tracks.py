"""What arms, the needle and cameras reported in a bag, as rows over time. Radians, metres, newtons; seconds of stamps.

Topics are those of CRTK and AMBF, so that bags of a da Vinci Research Kit are read as those of the simulator.
"""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from PIL import Image as Pixels

from ligature.model.commands import PHASE_TOPIC, MarkPhase
from ligature.ros import conversion
from ligature.ros.bags import BagError, messages, opened, topics

Array = NDArray[np.float64]

CLOCK = "/World/State"
"""End of the topic that has simulated time."""

NEEDLE = "/Needle/State"

EARLY = 1e-5
"""Seconds by which a message may be later than a sample that has it: stamps and simulated times are rounded."""

PICTURES = ("ImageData", "ImageData/compressed", "image_raw", "image_raw/compressed", "image_rect_color")
"""Ends of topics with colour pictures, the best first; the name before them is that of the camera."""


@dataclass(frozen=True, eq=False)
class Track:
    """Rows ``values`` (n, …) at ``times`` (n,), which do not fall."""

    times: Array
    values: Array

    def at(self, times: Array) -> Array:
        """The newest row at each of ``times``; before the first, the first."""
        return np.asarray(self.values[np.maximum(np.searchsorted(self.times, times + EARLY, "right") - 1, 0)])


@dataclass(frozen=True, eq=False)
class ArmTracks:
    """What one arm with a jaw reported, by the names of `ligature.datasets`, and the names of its joints."""

    joints: tuple[str, ...]
    tracks: Mapping[str, Track]


@dataclass(frozen=True, eq=False)
class Session:
    """Arms by their names, why others were left out, the needle's pose (n, 7), topics of cameras, and the clock.

    ``clock`` has simulated seconds by stamps; without it stamps are the time. ``phases`` are the stamps and names of
    those that the operator marked.
    """

    arms: Mapping[str, ArmTracks]
    left_out: Mapping[str, str]
    needle: Track | None
    cameras: Mapping[str, str]
    clock: Track | None
    phases: tuple[tuple[float, str], ...] = ()

    def span(self) -> tuple[float, float]:
        """From when to when all arms report."""
        every = [track.times for arm in self.arms.values() for track in arm.tracks.values()]
        return max(times[0] for times in every), min(times[-1] for times in every)


def _joints(message: Any) -> Array:
    """Position, velocity and effort (3, k); what is not reported is 0."""
    rows = np.zeros((3, len(message.position)))
    for row, values in zip(rows, (message.position, message.velocity, message.effort), strict=True):
        if len(values) == len(row):
            row[:] = values
    return rows


def _pose(message: Any) -> Array:
    return np.array(conversion.pose7(getattr(message.pose, "pose", message.pose)))


def _wrench(message: Any) -> Array:
    f, t = message.wrench.force, message.wrench.torque
    return np.array([f.x, f.y, f.z, t.x, t.y, t.z])


def _sim_time(message: Any) -> Array:
    return np.array(float(message.sim_time))


Read = Callable[[Any], Array]
NEEDED: Mapping[str, tuple[tuple[str, ...], Read]] = {
    "measured_js": (("measured_js",), _joints),
    "setpoint_js": (("setpoint_js",), _joints),
    "local_measured_cp": (("local/measured_cp", "measured_cp"), _pose),
    "local_setpoint_cp": (("local/setpoint_cp", "setpoint_cp"), _pose),
    "jaw/measured_js": (("jaw/measured_js",), _joints),
    "jaw/setpoint_js": (("jaw/setpoint_js",), _joints),
}
"""What a dataset needs of an arm: topics below it, the best first, and what a message means."""

EVERY = {**NEEDED, "spatial_measured_cf": (("spatial/measured_cf",), _wrench)}
"""The same with what an arm may lack."""


def session(path: Path) -> Session:
    """What the bag ``path`` has of arms with a jaw, of the needle and of cameras.

    Raises `BagError` for a damaged bag, for one without such an arm, and for readings that are no numbers.
    """
    with opened(path) as bag:
        found = topics(bag)
        names = sorted(topic[1 : -len("/measured_js")] for topic in found if topic.endswith("/measured_js"))
        names = [name for name in names if not name.endswith(("/jaw", "/gripper"))]
        chosen = {name: _chosen(f"/{name}", found) for name in names}
        lacking = {
            name: ", ".join(NEEDED[what][0][0] for what in NEEDED if what not in each) for name, each in chosen.items()
        }
        arms = {name: each for name, each in chosen.items() if not lacking[name]}
        if not arms:
            why = "; ".join(f"{name} lacks {what}" for name, what in lacking.items())
            raise BagError(
                f"{path}: has no arm with a jaw that reports what a dataset needs{': ' + why if why else ''}"
            )
        reads = {topic: EVERY[what][1] for each in arms.values() for what, topic in each.items()}
        needle, clock = (min((t for t in found if t.endswith(end)), default="") for end in (NEEDLE, CLOCK))
        reads |= {topic: read for topic, read in ((needle, _pose), (clock, _sim_time)) if topic}
        tracks, joints = _tracks(path, messages(bag, list(reads)), reads)
        marked = sorted(topic for topic in found if topic.endswith(f"/{PHASE_TOPIC}"))
        phases = _phases(path, messages(bag, marked)) if marked else ()
    empty = [topic for each in arms.values() for topic in each.values() if topic not in tracks]
    if empty:
        raise BagError(f"{path}: has no message on {', '.join(empty)}")
    return Session(
        {
            name: ArmTracks(joints[each["measured_js"]], {what: tracks[topic] for what, topic in each.items()})
            for name, each in arms.items()
        },
        {name: what for name, what in lacking.items() if what},
        tracks.get(needle), _cameras(found), _clock(tracks.get(clock)), phases,
    )  # fmt: skip


def _chosen(root: str, found: set[str]) -> dict[str, str]:
    """The topics of an arm, by what they are."""
    best = {
        what: next((f"{root}/{end}" for end in ends if f"{root}/{end}" in found), "")
        for what, (ends, _) in EVERY.items()
    }
    return {what: topic for what, topic in best.items() if topic}


def _tracks(
    path: Path, rows: Iterator[tuple[str, Any, float]], reads: Mapping[str, Read]
) -> tuple[dict[str, Track], dict[str, tuple[str, ...]]]:
    """Tracks by topic, and the names of joints."""
    times: dict[str, list[float]] = {}
    values: dict[str, list[Array]] = {}
    joints: dict[str, tuple[str, ...]] = {}
    for topic, message, stamp in rows:
        try:
            value = reads[topic](message)
        except (AttributeError, TypeError, ValueError):
            raise BagError(f"{path}: {topic} has messages of the type {message._type}, which is not its own") from None
        if not np.isfinite(value).all() or (topic in values and value.shape != values[topic][0].shape):
            raise BagError(f"{path}: {topic}, {stamp:.3f} s: numbers that are not finite, or more or fewer than before")
        joints.setdefault(topic, tuple(getattr(message, "name", ()) if reads[topic] is _joints else ()))
        times.setdefault(topic, []).append(_stamp(message, stamp))
        values.setdefault(topic, []).append(value)
    found = {}
    for topic, each in times.items():
        order = np.argsort(each, kind="stable")
        found[topic] = Track(np.array(each)[order], np.array(values[topic])[order])
    for topic, names in joints.items():
        k = found[topic].values.shape[-1]
        joints[topic] = names if len(names) == k else tuple(f"joint_{j}" for j in range(k))
    return found, joints


def _phases(path: Path, rows: Iterator[tuple[str, Any, float]]) -> tuple[tuple[float, str], ...]:
    """When which phase was marked."""
    marks = []
    for topic, message, stamp in rows:
        try:
            marks.append((stamp, MarkPhase.of(message.data).phase))
        except AttributeError:
            raise BagError(f"{path}: {topic} has messages of the type {message._type}, not std_msgs/String") from None
        except ValueError as error:
            raise BagError(f"{path}: {topic}, {stamp:.3f} s: {error}") from None
    return tuple(marks)


def _stamp(message: Any, received: float) -> float:
    """The stamp of a message; its time of reception when it has none."""
    header = getattr(message, "header", None)
    return float(header.stamp.to_sec()) or received if header is not None else received


def _clock(found: Track | None) -> Track | None:
    """Simulated time of the stamps, if it never decreases."""
    if found is None or (np.diff(found.values) < 0.0).any() or found.values[-1] == found.values[0]:
        return None
    return found


def _cameras(found: set[str]) -> dict[str, str]:
    """Cameras and the topics of their pictures."""
    cameras: dict[str, str] = {}
    for end in PICTURES:
        for topic in sorted(topic for topic in found if topic.endswith(f"/{end}")):
            cameras.setdefault(topic[: -len(end) - 1].rsplit("/", 1)[1], topic)
    return cameras


def first_stamp(path: Path, topic: str) -> float:
    """When the first message of a topic was true; raises `BagError` without one."""
    with opened(path) as bag:
        for _, message, stamp in messages(bag, [topic]):
            return _stamp(message, stamp)
    raise BagError(f"{path}: has no message on {topic}")


def pictures(path: Path, topic: str, times: Sequence[float], size: tuple[int, int]) -> Iterator[NDArray[np.uint8]]:
    """The newest picture (h, w, 3) of a topic at each of ``times``, scaled to width and height ``size``.

    Raises `BagError` for pictures that are none, or in an encoding other than rgb8, bgr8 and mono8.
    """
    with opened(path) as bag:
        due, last, rgb = iter([*times, np.inf]), None, None
        time = next(due)
        for _, message, stamp in messages(bag, [topic]):
            while last is not None and _stamp(message, stamp) > time + EARLY:
                rgb = _scaled(path, topic, last, size) if rgb is None else rgb
                yield rgb
                time = next(due)
            last, rgb = message, None
        while last is not None and time < np.inf:
            rgb = _scaled(path, topic, last, size) if rgb is None else rgb
            yield rgb
            time = next(due)


def intrinsics(path: Path, topic: str, size: tuple[int, int]) -> Array | None:
    """Pinhole matrix (3, 3) of the first calibration of a camera, for pictures of ``size``; None without one."""
    info = topic.removesuffix("/compressed").rsplit("/", 1)[0] + "/CameraInfo"
    with opened(path) as bag:
        names = topics(bag) & {info, info.replace("/CameraInfo", "/camera_info")}
        for _, message, _ in messages(bag, sorted(names)) if names else ():
            if not message.width * message.height:
                return None  # not calibrated
            scale = np.array([size[0] / message.width, size[1] / message.height])
            K = np.array(message.K, dtype=float).reshape(3, 3)
            K[:2, :2] *= scale[:, None]
            K[:2, 2] = (K[:2, 2] + 0.5) * scale - 0.5  # ROS counts pixels from the centre of the first
            return K
    return None


def _scaled(path: Path, topic: str, message: Any, size: tuple[int, int]) -> NDArray[np.uint8]:
    try:
        picture = _decoded(message)
    except (ValueError, OSError, AttributeError) as error:
        raise BagError(f"{path}: {topic}: a picture that cannot be read: {error}") from None
    if picture.size != size:
        picture = picture.resize(size, Pixels.Resampling.BOX)
    return np.asarray(picture)


def _decoded(message: Any) -> Pixels.Image:
    if hasattr(message, "format"):
        return Pixels.open(io.BytesIO(message.data)).convert("RGB")
    channels = {"rgb8": 3, "bgr8": 3, "mono8": 1}.get(message.encoding)
    if channels is None:
        raise ValueError(f"its encoding is '{message.encoding}', not rgb8, bgr8 or mono8")
    rows = np.frombuffer(message.data, np.uint8).reshape(message.height, message.step)[:, : message.width * channels]
    pixels = rows.reshape(message.height, message.width, channels)
    if message.encoding == "bgr8":
        pixels = pixels[:, :, ::-1]
    return Pixels.fromarray(np.ascontiguousarray(np.broadcast_to(pixels, (*pixels.shape[:2], 3))))
