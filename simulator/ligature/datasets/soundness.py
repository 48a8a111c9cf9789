"""Whether a file of a stranger is a dataset: what it must hold, with types and shapes, before anybody reads it.

A well-formed HDF5 file may claim arrays of terabytes, lead around in circles, take its numbers from other files of the
machine, or lack what every reader counts on. Arrays are described by the number ``n`` of samples of their episode and
``j`` of joints of their arm; another letter is any length, equal in all arrays of an episode that name it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from ligature.paths import printable

MOST_LEVELS = 6
MOST_ITEMS = 1_000_000
MOST_CHUNK = 1 << 28
"""Bytes of a piece that HDF5 unpacks at a time; a picture of 8192 by 8192 has 192 MiB."""

MOST_PACKED = 2_000
"""How many times as large as on the disk an array may be: deflate packs at most 1032 bytes into one."""

SMALL = 1 << 20
"""Bytes that an array may have however it is stored."""

NUMBERS, WHOLE, TEXTS = "iufb", "iub", "OSU"

ARRAYS: dict[str, str] = {"time": "n", "phase": "n"}
"""Of an episode, in every format."""

ARM_ARRAYS: dict[str, str] = {
    "measured_js": "n 3 j", "setpoint_js": "n 3 j", "action_js": "n j", "local_measured_cp": "n 7",
    "local_setpoint_cp": "n 7", "local_action_cp": "n 7", "spatial_measured_cf": "n 6", "phase": "n", "activity": "n",
    "events": "n 3",
}  # fmt: skip

JAW_ARRAYS: dict[str, str] = {
    "jaw/measured_js": "n 3", "jaw/setpoint_js": "n 3", "jaw/action_js": "n", "jaw/force": "n"
}  # fmt: skip
"""Of an instrument."""

OTHER_ARRAYS: dict[str, str] = {
    "needle/pose": "n 7", "needle/twist": "n 6", "needle/tissue_force": "n 3", "needle/events": "n 3",
    "thread/points": "n e 3", "thread/tension": "n e",
}  # fmt: skip
"""Where the episode has the group that the name begins with."""

CAMERA_ARRAYS: dict[str, str] = {"pose": "n 7", "intrinsics": "n 3 3", "rgb": "n h w 3"}

NOT_REPORTED = frozenset({"spatial_measured_cf", "force", "twist", "tissue_force"})
"""Arrays that a dataset of a recording may lack, as cameras the pose: what was recorded reports them to nobody."""

LATER = frozenset({"events"})
"""Arrays that datasets of earlier releases lack."""

PHASES = frozenset({"phase"})
"""Arrays of numbers of phases."""

POSES, FARTHEST = frozenset({"local_measured_cp", "local_setpoint_cp", "local_action_cp", "pose"}), 1e6
"""Arrays of poses, and the largest number in one."""


EPISODE = "episode_"
"""What names of episodes begin with."""

UNREADABLE = (OSError, RuntimeError, KeyError, UnicodeError)
"""Errors of HDF5 for bytes that it cannot read."""


class Unsound(ValueError):
    """What a dataset lacks, or has and must not have."""


def check(file: h5py.File, path: Path, bad: dict[str, str]) -> None:
    """Raise `Unsound` unless every reader can read the dataset ``file``, which is the file ``path``.

    Episodes that are not sound are added to ``bad``, with the reasons; those that are in it are not looked at.
    """
    _Walk(f"{path.name}.episodes").visit(file, bad)
    phases = _described(file)
    arms = {name: _arm(arm, name) for name, arm in file.get("arms", {}).items()}
    whole, recorded = file.attrs["format"] == "ligature dataset 2", bool(file.attrs.get("recorded", False))
    for name in episode_names(file, bad):
        with held_against(name, bad):
            _Episode(_group(file, name), name, phases, recorded).check(arms if whole else {})


def episode_names(file: h5py.File, bad: Collection[str] = ()) -> list[str]:
    """The episodes of a dataset, in their order, without the ``bad`` ones."""
    names = [name for name in file if name.startswith(EPISODE) and name not in bad]
    return sorted(names, key=lambda name: (len(name), name))


@contextmanager
def held_against(name: str, bad: dict[str, str]) -> Iterator[None]:
    """Adds what is wrong with the episode ``name``, or with an item that is none, to ``bad`` or raises it."""
    try:
        yield
    except (Unsound, *UNREADABLE) as error:
        if not name.startswith(EPISODE) or isinstance(error, TooMany):
            raise
        bad[name] = why(error)


def why(error: Exception) -> str:
    """What was wrong, as a text."""
    return printable(error.args[0] if error.args and not isinstance(error, UnicodeError) else error)


class TooMany(Unsound):
    """More than a reader looks at, wherever it is."""


class _Walk:
    """Visits all items of a file once; rejects cycles, data in other files and arrays far larger than their bytes."""

    def __init__(self, episodes: str) -> None:
        self._episodes, self._seen, self._count = episodes, set[tuple[int, int]](), 0

    def visit(self, file: h5py.File, bad: dict[str, str]) -> None:
        """Visit all; episodes in which something is wrong are added to ``bad``."""
        for key in file:
            if key not in bad:
                with held_against(key, bad):
                    self._enter(file, key, key, 0)

    def _enter(self, group: Any, key: str, name: str, level: int) -> None:
        self._count += 1
        if self._count > MOST_ITEMS:
            raise TooMany(f"it has more than {MOST_ITEMS} items")
        item = self._item(group, key, name, level)
        if isinstance(item, h5py.Group):
            if level == MOST_LEVELS:
                raise Unsound(f"'{name}' is nested in more than {MOST_LEVELS} groups")
            for inner in item:
                self._enter(item, inner, f"{name}/{inner}", level + 1)
        elif isinstance(item, h5py.Dataset):
            _check_stored(item, name)
        else:
            raise Unsound(f"'{name}' is neither a group nor an array")

    def _item(self, group: Any, key: str, name: str, level: int) -> Any:
        link = group.get(key, getlink=True)
        if isinstance(link, h5py.ExternalLink):
            if level or link.path != "/" or link.filename != f"{self._episodes}/{key}.h5":
                raise Unsound(f"'{name}' is a link to '{link.filename}'; an episode lies in '{self._episodes}'")
        elif not isinstance(link, h5py.HardLink):
            raise Unsound(f"'{name}' is a link")
        item = group[key]
        info = h5py.h5o.get_info(item.id)
        if (place := (info.fileno, info.addr)) in self._seen:
            raise Unsound(f"'{name}' occurs twice")
        self._seen.add(place)
        return item


def _check_stored(array: Any, name: str) -> None:
    """Raise `Unsound` unless the bytes of an array are in this file, and about as many as its shape states."""
    if array.external or array.is_virtual:
        raise Unsound(f"'{name}' refers to data in another file")
    size = math.prod(array.shape or (0,)) * array.dtype.itemsize
    if size > SMALL and size > MOST_PACKED * array.id.get_storage_size():
        raise Unsound(f"'{name}' claims {size} bytes and has {array.id.get_storage_size()}")
    if array.chunks and math.prod(array.chunks) * array.dtype.itemsize > MOST_CHUNK:
        raise Unsound(f"'{name}' has pieces of more than {MOST_CHUNK >> 20} MiB")


def _described(file: Any) -> int:
    """Check what holds for all episodes; returns how many phases there are."""
    for key in ("format", "version", "scene"):
        _attribute(file, key, "a text", _is_text)
    _attribute(file, "rate", "a number above 0 and at most 1000", lambda v: _is_number(v) and 0.0 < float(v) <= 1000.0)
    if "recorded" in file.attrs:
        _attribute(file, "recorded", "true or false", lambda v: _is_number(v, WHOLE))
    for key in ("phases", *(("gestures", "activities") if "gestures" in file.attrs else ())):
        _attribute(file, key, "a list of texts", _are_texts)
    if not isinstance(file.get("arms", file), h5py.Group):
        raise Unsound("'arms' is not a group")
    names = file.get("id_names")
    if names is not None and (not isinstance(names, h5py.Dataset) or names.dtype.kind not in TEXTS or names.ndim != 1):
        raise Unsound("'id_names' is not a list of strings")
    if "gestures" in file.attrs and len(file.attrs["gestures"]) != len(file.attrs["phases"]):
        raise Unsound(f"it has {len(file.attrs['phases'])} phases and {len(file.attrs['gestures'])} gestures of them")
    return len(file.attrs["phases"])


def _arm(arm: Any, name: str) -> tuple[int, bool]:
    """How many joints an arm has, and whether it has a jaw."""
    if not isinstance(arm, h5py.Group):
        raise Unsound(f"'arms/{name}' is not a group")
    for key in ("kind", "tool"):
        _attribute(arm, key, "a text", _is_text)
    for key in ("joint_names", "joint_units"):
        _attribute(arm, key, "a list of texts", _are_texts)
    if "base_pose" in arm.attrs:
        _attribute(arm, "base_pose", "seven numbers", lambda v: _numbers(v) and np.shape(v) == (7,))
    names, units = len(arm.attrs["joint_names"]), len(arm.attrs["joint_units"])
    if names != units or names == 0:
        raise Unsound(f"'arms/{name}' has {names} names of joints and {units} units")
    return names, str(arm.attrs["kind"]) == "psm"


class _Episode:
    """An episode: its attributes, and arrays of as many rows as it has samples."""

    def __init__(self, group: Any, name: str, phases: int, recorded: bool) -> None:
        self._group, self._name, self._phases, self._lengths = group, name, phases, dict[str, int]()
        self._recorded = recorded

    def check(self, arms: dict[str, tuple[int, bool]]) -> None:
        """Check all that the format asks for; ``arms`` are joints and jaw of each arm."""
        group = self._group
        _attribute(group, "samples", "a whole number", lambda v: _is_number(v, WHOLE) and v >= 0, self._name)
        for key in ("success", "judged") if "judged" in group.attrs else ("success",):
            _attribute(group, key, "true or false", lambda v: _is_number(v, WHOLE), self._name)
        if "task" in group.attrs or arms:
            _attribute(group, "task", "a text", _is_text, self._name)
        self._lengths["n"] = int(group.attrs["samples"])
        for name, shape in ARRAYS.items():
            self._array(name, shape)
        for arm, (joints, jaw) in arms.items():
            self._lengths["j"] = joints
            for name, shape in {**ARM_ARRAYS, **(JAW_ARRAYS if jaw else {})}.items():
                self._array(f"arms/{arm}/{name}", shape)
        for name, shape in OTHER_ARRAYS.items():
            if name.partition("/")[0] in group:
                self._array(name, shape)
        for camera in self._inner("cameras"):
            for size in "hw":
                self._lengths.pop(size, None)
            for name, shape in CAMERA_ARRAYS.items():
                self._array(f"cameras/{camera}/{name}", shape)
        for name in self._inner("extra"):
            self._array(f"extra/{name}", "n …")

    def _inner(self, name: str) -> Iterator[str]:
        if name in self._group:
            yield from _group(self._group, name)

    def _array(self, name: str, shape: str) -> None:
        place, last = f"{self._name}/{name}", name.rpartition("/")[2]
        array = self._group.get(name)
        unreported = last in NOT_REPORTED or name.startswith("cameras/") and last == "pose"
        if array is None and (last in LATER or self._recorded and unreported):
            return
        if not isinstance(array, h5py.Dataset):
            raise Unsound(f"'{place}' is missing or not an array")
        wanted, found = shape.split(), array.shape or ()
        free = wanted[-1] == "…"
        kinds = WHOLE if last in ("phase", "activity", "events") else NUMBERS
        fits = len(found) >= 1 if free else len(found) == len(wanted)
        for letter, length in zip(wanted, found, strict=False):
            if not letter.isdigit() and letter != "…":
                self._lengths.setdefault(letter, length)
            fits = fits and (letter == "…" or length == (int(letter) if letter.isdigit() else self._lengths[letter]))
        if not fits or array.dtype.kind not in kinds:
            means = " × ".join(str(self._lengths.get(letter, letter)) for letter in wanted)
            raise Unsound(f"'{place}' is {found} of {array.dtype}; it must be {means} numbers")
        if last in POSES and not (np.abs(array[:]) <= FARTHEST).all():
            raise Unsound(f"'{place}' has values that are not a valid pose")
        if name == "time":
            _check_times(array[:], place)
        if last in PHASES and len(array) and not 0 <= int(array[:].max()) < self._phases:
            raise Unsound(f"'{place}' has phase {int(array[:].max())}; the number of phases is {self._phases}")


def _check_times(times: Any, place: str) -> None:
    """Raise `Unsound` unless times ascend."""
    ascends = np.diff(times) > 0.0
    if not np.isfinite(times).all() or not ascends.all():
        k = int(np.argmax(~np.isfinite(times))) if ascends.all() else int(np.argmin(ascends)) + 1
        raise Unsound(f"'{place}' does not ascend at sample {k}, where it is {times[k]:g}")


def _group(file: Any, name: str) -> Any:
    if not isinstance(file[name], h5py.Group):
        raise Unsound(f"'{name}' is not a group")
    return file[name]


def _attribute(item: Any, key: str, what: str, holds: Callable[[Any], bool], name: str = "") -> None:
    """Check an attribute; ``name`` is that of an item whose file may be its own, where it is called ``/``."""
    place = f"attribute '{key}' of '{name or item.name}'"
    if key not in item.attrs:
        raise Unsound(f"{place} is missing; it is {what}")
    if not holds(item.attrs[key]):
        raise Unsound(f"{place} must be {what}")


def _is_text(value: Any) -> bool:
    return isinstance(value, str)


def _are_texts(value: Any) -> bool:
    return isinstance(value, np.ndarray) and value.ndim == 1 and all(isinstance(text, str) for text in value)


def _numbers(value: Any, kinds: str = NUMBERS) -> bool:
    return isinstance(value, np.ndarray | np.generic) and value.dtype.kind in kinds and bool(np.isfinite(value).all())


def _is_number(value: Any, kinds: str = NUMBERS) -> bool:
    return _numbers(value, kinds) and np.shape(value) == ()
