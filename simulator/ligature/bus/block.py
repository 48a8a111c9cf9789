"""The shared memory block: newest state under a sequence lock, figures, and command rings.

The writer never waits. A reader copies the state and tries again when the writer was at it
meanwhile. Files live in ``/dev/shm`` and carry the supervisor's process id, so that the leftovers
of a killed run are found and removed by the next one.
"""

from __future__ import annotations

import mmap
import os
import re
import time
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.bus.ring import RING_BYTES, Ring
from ligature.model.state import StateDtype, StateRecord

FOLDER = Path("/dev/shm")
PRODUCERS = ("ros", "cockpit", "teleop", "spare")
MAGIC = 0x4C494741
_NAME = re.compile(r"ligature-(\d+)-[0-9a-f]+\Z")

FIGURES = np.dtype(
    [
        ("magic", "u8"),
        ("state_bytes", "u8"),
        ("sequence", "u8"),
        ("physics_beat", "f8"),
        ("loop_hz", "f8"),
        ("real_time_factor", "f8"),
        ("tick_p50", "f8"),
        ("tick_p99", "f8"),
        ("tick_max", "f8"),
        ("behind", "f8"),
        ("received", "u8"),
        ("coalesced", "u8"),
        ("rejected", "u8"),
        ("throttled", "u8"),
        ("published", "u8"),
        ("publish_late", "u8"),
        ("malformed", "u8"),
    ]
)
"""Figures of the running loop; times in seconds, ``physics_beat`` on the monotonic clock."""

_STATE_AT = 4096
RETRIES = 1000


class BusError(RuntimeError):
    """The shared memory block is missing or belongs to another scene; the message says which."""


class Block:
    """One mapped block; made by `create` or `attach`."""

    def __init__(self, path: Path, dtype: StateDtype, owner: bool) -> None:
        self.path = path
        self._owner = owner
        self._dtype = dtype
        ring_at = _STATE_AT + -(-dtype.itemsize // 64) * 64
        size = ring_at + RING_BYTES * len(PRODUCERS)
        descriptor = os.open(path, os.O_RDWR | (os.O_CREAT | os.O_EXCL if owner else 0), 0o600)
        try:
            if owner:
                os.ftruncate(descriptor, size)
            elif os.fstat(descriptor).st_size != size:
                raise BusError(f"shared memory '{path}' belongs to another scene or version")
            self._map = mmap.mmap(descriptor, size)
        finally:
            os.close(descriptor)
        self.figures: NDArray[np.void] = np.ndarray(1, FIGURES, self._map, 0)
        self._state: StateRecord = np.ndarray(1, dtype, self._map, _STATE_AT)
        self.rings = {
            name: Ring(memoryview(self._map)[ring_at + i * RING_BYTES : ring_at + (i + 1) * RING_BYTES])
            for i, name in enumerate(PRODUCERS)
        }
        if owner:
            self.figures["magic"], self.figures["state_bytes"] = MAGIC, dtype.itemsize

    @classmethod
    def create(cls, name: str, dtype: StateDtype) -> Block:
        """Make the block ``name`` for states of ``dtype``."""
        return cls(FOLDER / name, dtype, True)

    @classmethod
    def attach(cls, name: str, dtype: StateDtype, patience: float = 10.0) -> Block:
        """Map the block ``name``, waiting up to ``patience`` seconds for it; raises `BusError`."""
        deadline = time.monotonic() + patience
        while True:
            try:
                block = cls(FOLDER / name, dtype, False)
                if int(block.figures["sequence"][0]) > 0:
                    return block
                block.close()
            except (FileNotFoundError, ValueError):
                pass
            if time.monotonic() > deadline:
                raise BusError(f"no simulator writes to shared memory '{name}'")
            time.sleep(0.01)

    def write(self, state: StateRecord) -> None:
        """Publish ``state`` as the newest."""
        self.figures["sequence"] += 1
        self._state[:] = state
        self.figures["sequence"] += 1

    def read(self, into: StateRecord) -> bool:
        """Copy the newest state; False when the writer was too busy `RETRIES` times in a row."""
        sequence = self.figures["sequence"]
        for _ in range(RETRIES):
            before = int(sequence[0])
            if before % 2 == 0:
                into[:] = self._state
                if int(sequence[0]) == before:
                    return True
            time.sleep(0)
        return False

    @property
    def age(self) -> float:
        """Seconds since the physics process last gave a sign of life."""
        return time.monotonic() - float(self.figures["physics_beat"][0])

    def beat(self) -> None:
        """Give a sign of life of the physics process."""
        self.figures["physics_beat"] = time.monotonic()

    def close(self) -> None:
        """Unmap; the owner also removes the file."""
        for ring in self.rings.values():
            ring.release()
        del self.figures, self._state
        self._map.close()
        if self._owner:
            self.path.unlink(missing_ok=True)


def remove_leftovers() -> list[str]:
    """Remove blocks whose supervisor no longer lives; returns their names."""
    removed = []
    for path in FOLDER.glob("ligature-*"):
        match = _NAME.match(path.name)
        if match and not Path(f"/proc/{match.group(1)}").exists():
            path.unlink(missing_ok=True)
            removed.append(path.name)
    return removed
