"""A ring of messages in shared memory with one producer and one consumer.

Each side moves only its own counter. A full ring refuses the newest message and counts it: the
consumer empties it every update, so that only a dead or flooded consumer fills it.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

SLOT_BYTES = 1280
SLOTS = 1024
_HEADER = 64
RING_BYTES = _HEADER + SLOTS * SLOT_BYTES


class Ring:
    """One ring over ``memory`` of `RING_BYTES`."""

    def __init__(self, memory: memoryview) -> None:
        self._memory = memory
        self._counters: NDArray[np.uint64] = np.ndarray(4, "u8", memory[:32])
        self._beat: NDArray[np.float64] = np.ndarray(1, "f8", memory[32:40])

    def push(self, data: bytes) -> bool:
        """Append a message; False, counted, when the ring is full or the message too large."""
        head, tail = int(self._counters[0]), int(self._counters[1])
        if head - tail >= SLOTS or len(data) > SLOT_BYTES - 4:
            self._counters[2] += 1
            return False
        at = _HEADER + (head % SLOTS) * SLOT_BYTES
        self._memory[at : at + 4 + len(data)] = struct.pack("<I", len(data)) + data
        self._counters[0] = head + 1
        return True

    def drain(self) -> Iterator[bytes]:
        """Take all messages that wait."""
        while True:
            head, tail = int(self._counters[0]), int(self._counters[1])
            if tail == head:
                return
            at = _HEADER + (tail % SLOTS) * SLOT_BYTES
            (size,) = struct.unpack_from("<I", self._memory, at)
            data = bytes(self._memory[at + 4 : at + 4 + min(size, SLOT_BYTES - 4)])
            self._counters[1] = tail + 1
            yield data

    @property
    def refused(self) -> int:
        """Messages that did not fit."""
        return int(self._counters[2])

    def beat(self) -> None:
        """Give a sign of life of the producer."""
        self._beat[0] = time.monotonic()

    @property
    def silence(self) -> float:
        """Seconds since the producer's last sign of life; 0 when there never was one."""
        return time.monotonic() - float(self._beat[0]) if self._beat[0] else 0.0

    def forget(self) -> None:
        """Count the producer as never having lived, until its next sign of life."""
        self._beat[0] = 0.0

    def release(self) -> None:
        """Let go of the memory."""
        del self._counters, self._beat
        self._memory.release()
