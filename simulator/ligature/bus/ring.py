"""A ring of messages in shared memory with one producer and one consumer.

Each side moves only its own counter. A full ring rejects the newest message; `Outbox` keeps it until
there is room.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

SLOT_BYTES = 2560
MOST_BYTES = SLOT_BYTES - 4
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
        """Append a message of at most `MOST_BYTES`; False when the ring is full."""
        head, tail = int(self._counters[0]), int(self._counters[1])
        if head - tail >= SLOTS:
            return False
        at = _HEADER + (head % SLOTS) * SLOT_BYTES
        self._memory[at : at + 4 + len(data)] = struct.pack("<I", len(data)) + data
        self._counters[0] = head + 1
        if self._beat[0]:
            # who sends is alive, though its own loop may be kept waiting on a busy machine
            self.beat()
        return True

    def drain(self) -> Iterator[bytes]:
        """Take the messages that wait now; what a flood adds meanwhile is left for the next time."""
        first = int(self._counters[1])
        for tail in range(first, min(int(self._counters[0]), first + SLOTS)):
            at = _HEADER + (tail % SLOTS) * SLOT_BYTES
            (size,) = struct.unpack_from("<I", self._memory, at)
            data = bytes(self._memory[at + 4 : at + 4 + min(size, MOST_BYTES)])
            self._counters[1] = tail + 1
            yield data

    def drop(self) -> None:
        """Count a message that the producer gave up because the ring was full."""
        self._counters[2] += 1

    @property
    def dropped(self) -> int:
        """Messages that the producer gave up."""
        return int(self._counters[2])

    def beat(self) -> None:
        """Give a sign of life of the producer."""
        self._beat[0] = time.monotonic()

    @property
    def silence(self) -> float:
        """Seconds since the producer's last sign of life; 0 when there never was one."""
        return time.monotonic() - float(self._beat[0]) if self._beat[0] else 0.0

    def reset(self) -> None:
        """Count the producer as never having lived, until its next sign of life."""
        self._beat[0] = 0.0

    def release(self) -> None:
        """Let go of the memory."""
        del self._counters, self._beat
        self._memory.release()
