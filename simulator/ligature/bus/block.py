"""The shared memory block: newest state in one of two places, figures, command rings, events.

Nobody waits for anybody. The writer fills the older of two places and then counts one state more; a reader copies the
newest one and tries again when another was finished meanwhile, so a writer that the machine stops in the middle of a
state holds up no reader, whatever their priorities. That rests on stores and loads being seen in program order, as on
x86-64. Files live in ``/dev/shm`` and carry the supervisor's process id, so that the leftovers of a killed run are
found and removed by the next one. Times are seconds on the monotonic clock.
"""

from __future__ import annotations

import errno
import mmap
import os
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.bus.events import LOG_BYTES, EventLog
from ligature.bus.leftovers import FOLDER
from ligature.bus.ring import RING_BYTES, Ring
from ligature.deprecation import warn_deprecated
from ligature.model.state import StateDtype, StateRecord
from ligature.paths import printable

PRODUCERS = ("ros", "cockpit", "teleop", "window", "spare")
MAGIC = 0x4C494741

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
        ("frames", "u8"),
        ("frames_dropped", "u8"),
        ("frame_seconds", "f8"),
        ("recording", "u8"),
        ("alarms", "u8"),
        ("alarm", "S240"),
        ("findings", [("time", "f8"), ("severity", "u1"), ("text", "S400")], 8),
    ]
)
"""Figures of the running loop; times in seconds, ``physics_beat`` on the monotonic clock.

``frames`` are pictures drawn for clients, ``frame_seconds`` is how long the last round of them took. ``recording`` is 1
while a recording goes on that was asked for during the run. ``alarms`` counts bodies that moved as no command asks for
or diverged; ``alarm`` is the newest, in UTF-8. ``findings`` are the last different ones of all kinds, each with the
time at which it was noted last on the monotonic clock, 0 for none.
"""

_STATE_AT = 4096
RETRIES = 1000
"""Attempts of one reading; one fails when a state is finished while another is copied, which takes microseconds."""

PHYSICS_TIMEOUT = 5.0
"""Seconds without a sign of life of the physics process after which the other processes of its run end."""

TIMEOUT = 120.0
"""Seconds to wait for the first state: the first start of all compiles the solvers."""


class BusError(RuntimeError):
    """The shared memory block is missing or belongs to another scene; the message names which."""


class Block:
    """One mapped block; made by `create` or `attach`.

    Parameters
    ----------
    path
        The file in shared memory.
    dtype
        Layout of the states.
    owner
        Whether this process creates the file, and removes it in the end.
    """

    def __init__(self, path: Path, dtype: StateDtype, owner: bool) -> None:
        self.path = path
        self._owner = owner
        self._dtype = dtype
        state_bytes = -(-dtype.itemsize // 64) * 64
        ring_at = _STATE_AT + 2 * state_bytes
        log_at = ring_at + RING_BYTES * len(PRODUCERS)
        size = log_at + LOG_BYTES
        try:
            descriptor = os.open(path, os.O_RDWR | (os.O_CREAT | os.O_EXCL if owner else 0), 0o600)
        except OSError as error:
            if owner and error.errno in (errno.EROFS, errno.EACCES, errno.ENOENT, errno.ENOSPC):
                raise BusError(f"cannot make the shared memory '{path}': {error.strerror}") from error
            raise
        try:
            if owner:
                _reserve(descriptor, path, size)
            found = os.fstat(descriptor).st_size
            if found == 0:
                raise FileNotFoundError(path)
            if found != size:
                raise BusError(f"shared memory '{path}' belongs to another scene or version; end that run first")
            self._map = mmap.mmap(descriptor, size)
        finally:
            os.close(descriptor)
        self.figures: NDArray[np.void] = np.ndarray(1, FIGURES, self._map, 0)
        self._states: list[NDArray[np.uint8]] = [
            np.ndarray(dtype.itemsize, "u1", self._map, _STATE_AT + place * state_bytes) for place in range(2)
        ]
        self.retried = 0
        self.rings = {
            name: Ring(memoryview(self._map)[ring_at + i * RING_BYTES : ring_at + (i + 1) * RING_BYTES])
            for i, name in enumerate(PRODUCERS)
        }
        self.events = EventLog(memoryview(self._map)[log_at:])
        if owner:
            self.figures["magic"], self.figures["state_bytes"] = MAGIC, dtype.itemsize

    @classmethod
    def create(cls, name: str, dtype: StateDtype) -> Block:
        """Make the block ``name`` for states of ``dtype``."""
        return cls(FOLDER / name, dtype, True)

    @classmethod
    def attach(
        cls,
        name: str,
        dtype: StateDtype,
        timeout: float = TIMEOUT,
        cancelled: Callable[[], bool] = lambda: False,
        patience: float | None = None,
        empty: bool = False,
    ) -> Block:
        """Map the block ``name`` as soon as it holds a state.

        Parameters
        ----------
        name, dtype
            Name of the file and layout of the states, as for `create`.
        timeout
            Longest wait in seconds.
        cancelled
            Is called during the wait; the wait ends if it returns True.
        patience
            The former name of ``timeout``.
        empty
            Whether a block without a state is enough.

        Returns
        -------
        Block
            The mapped block.

        Raises
        ------
        BusError
            If the wait ends without a state, or if the block has another layout.
        """
        if patience is not None:
            warn_deprecated("patience", "timeout")
            timeout = patience
        deadline = time.monotonic() + timeout
        while True:
            with suppress(FileNotFoundError):
                block = cls(FOLDER / name, dtype, False)
                if empty or block.filled:
                    return block
                block.close()
            if cancelled() or time.monotonic() > deadline:
                raise BusError(f"no simulator writes to shared memory '{name}'; start it with 'ligature run'")
            time.sleep(0.01)

    @property
    def filled(self) -> bool:
        """Whether the first state has been written."""
        return int(self.figures["sequence"][0]) > 0

    def write(self, state: StateRecord) -> None:
        """Publish ``state`` (1,) as the newest."""
        following = int(self.figures["sequence"][0]) + 1
        self._states[following % 2][:] = state.view("u1")
        self.figures["sequence"] = following

    def read(self, into: StateRecord) -> bool:
        """Copy the newest state into ``into`` (1,); False when one was finished meanwhile `RETRIES` times in a row.

        ``retried`` counts the attempts in which one was.
        """
        sequence, target = self.figures["sequence"], into.view("u1")
        for _ in range(RETRIES):
            newest = int(sequence[0])
            target[:] = self._states[newest % 2]
            if int(sequence[0]) == newest:
                return True
            self.retried += 1
            time.sleep(0)
        return False

    @property
    def age(self) -> float:
        """Seconds since the physics process last gave a sign of life."""
        return time.monotonic() - float(self.figures["physics_beat"][0])

    @property
    def active(self) -> bool:
        """Whether the physics process gave a sign of life within `PHYSICS_TIMEOUT`."""
        return self.age < PHYSICS_TIMEOUT

    def note(self, severity: int, text: str) -> None:
        """Keep the finding ``text`` of ``severity`` for `/diagnostics`, in place of the same one or of the oldest."""
        findings = self.figures["findings"][0]
        words = printable(text).encode("utf-8")[: findings.dtype["text"].itemsize]
        same = np.flatnonzero(findings["text"] == words)
        place = int(same[0]) if len(same) else int(np.argmin(findings["time"]))
        findings["text"][place], findings["severity"][place] = words, severity
        findings["time"][place] = time.monotonic()

    def beat(self) -> None:
        """Give a sign of life of the physics process."""
        self.figures["physics_beat"] = time.monotonic()

    def close(self) -> None:
        """Unmap; the owner also removes the file."""
        for ring in self.rings.values():
            ring.release()
        self.events.release()
        del self.figures, self._states
        self._map.close()
        if self._owner:
            self.path.unlink(missing_ok=True)


def _reserve(descriptor: int, path: Path, size: int) -> None:
    """Allocate all pages now: a page that could not be allocated later would kill the process that writes to it."""
    try:
        os.posix_fallocate(descriptor, 0, size)
    except OSError as error:
        path.unlink(missing_ok=True)
        raise BusError(
            f"cannot allocate {size / 1e6:.0f} MB of shared memory for '{path}': {error.strerror}"
        ) from error
