"""Streams of devices and pedals as lines of JSON, and their replay: a demonstration on another scene.

A line is ``{"t": seconds since the start, "device": name, "pose": [x y z qx qy qz qw], "grip": …, "buttons": {…}}`` or
``{"t": …, "event": name, "value": …}``. Poses are the device's own, before calibration. Numbers that are none are
written as JSON's ``NaN``, because a device may send them.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from ligature.paths import give_name, open_file, part_of
from ligature.teleop.devices.device import Reading


class Recorder:
    """Writes the input of devices and pedals to a text file; the first entry is second zero."""

    def __init__(self, out: TextIO) -> None:
        self._out = out
        self._start: float | None = None

    def _line(self, now: float, **values: Any) -> None:
        if self._start is None:
            self._start = now
        self._out.write(json.dumps({"t": round(now - self._start, 6), **values}) + "\n")

    def reading(self, device: str, reading: Reading) -> None:
        """Write a reading of a device."""
        buttons = {name: True for name, down in reading.buttons.items() if down}
        self._line(reading.time, device=device, pose=reading.pose.tolist(), grip=reading.grip, buttons=buttons)

    def event(self, now: float, name: str, value: Any) -> None:
        """Write a pedal or a switch."""
        self._line(now, event=name, value=value)


@contextmanager
def recording(path: Path) -> Iterator[Recorder]:
    """Records to ``path``, which is called so at the end, however that comes; raises OSError where it exists."""
    part = part_of(path)
    with part.open("x", encoding="utf-8") as out:
        try:
            yield Recorder(out)
        finally:
            out.flush()
            if part.stat().st_size:
                give_name(part, path)
            else:
                part.unlink()


class Replay:
    """Plays a recorded file at its pace; raises ValueError with the line that is invalid."""

    def __init__(self, path: Path) -> None:
        self._rows = list(_rows(path))
        self._next = 0
        self._start: float | None = None

    @property
    def devices(self) -> set[str]:
        """The devices that speak."""
        return {row["device"] for row in self._rows if "device" in row}

    @property
    def started(self) -> bool:
        """Whether the file has begun to speak."""
        return self._start is not None

    @property
    def finished(self) -> bool:
        """Whether everything was sent."""
        return self._next >= len(self._rows)

    def due(self, now: float) -> Iterator[tuple[str, Any]]:
        """What is due up to ``now``: ``("reading", (device, Reading))`` or the name and value of an event."""
        if self._start is None:
            self._start = now
        while self._next < len(self._rows) and self._rows[self._next]["t"] <= now - self._start:
            row = self._rows[self._next]
            self._next += 1
            if "device" in row:
                time = self._start + row["t"]
                yield "reading", (row["device"], Reading(time, np.array(row["pose"]), row["grip"], row["buttons"]))
            else:
                value = row["value"]
                yield row["event"], tuple(value) if isinstance(value, list) else value


VALUES: dict[str, type] = {
    "enable": bool, "scale": float, "select": str, "unselect": str, "cycle": str, "clutch": bool, "camera": bool,
    "present": bool, "phase": bool,
}  # fmt: skip
"""Events with one value, and its kind."""

LISTS = {"pair": 2, "component": 3, "drive camera": 2}
"""Events with a list of values: names, and at the end of the last two a verb and what it is about."""

VERBS: dict[str, type] = {
    "state_command": str, "scale": float, "lock_rotation": bool, "lock_translation": bool, "align": bool,
}  # fmt: skip


def _rows(path: Path) -> Iterator[dict[str, Any]]:
    with open_file(path) as file:
        for number, line in enumerate(file, 1):
            try:
                row = json.loads(line)
                valid = _is_reading(row) if "device" in row else _is_event(row)
                valid = valid and _is(row["t"], float) and np.isfinite(row["t"])
            except (ValueError, KeyError, TypeError, RecursionError, OverflowError):
                valid = False
            if not valid:
                raise ValueError(f"{path}:{number}: neither a reading of a device nor an event")
            yield row


def _is_reading(row: dict[str, Any]) -> bool:
    """Whether a line has the fields of a reading; its numbers may be invalid, as those of a device may be."""
    pose, grip, buttons = row["pose"], row["grip"], row["buttons"]
    return (
        isinstance(row["device"], str)
        and isinstance(pose, list)
        and len([float(x) for x in pose if _is(x, float)]) == len(pose) == 7
        and (grip is None or _is(grip, float))
        and isinstance(buttons, dict)
        and all(isinstance(down, bool) for down in buttons.values())
    )


def _is_event(row: dict[str, Any]) -> bool:
    """Whether a line is an event that teleoperation knows, with a value of its kind."""
    name, value = row["event"], row["value"]
    if name in VALUES:
        return _is(value, VALUES[name])
    if not (isinstance(value, list) and len(value) == LISTS[name]):
        return False
    if name == "pair":
        return all(isinstance(each, str) for each in value)
    *names, verb, what = value
    return all(isinstance(each, str) for each in names) and _is(what, VERBS[verb])


def _is(value: Any, kind: type) -> bool:
    if kind is float:
        return isinstance(value, int | float) and not isinstance(value, bool)
    return isinstance(value, kind)
