"""A log of events in shared memory: one writer, any number of readers, each with its own place in it.

What happened to an arm must reach clients in order and none left out, which states cannot do: a busy flag may rise
and fall between two of them. A reader that falls behind by more than the log holds loses the oldest, and counts them.
"""

from __future__ import annotations

import json
import struct
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

SLOT_BYTES = 512
MOST_BYTES = SLOT_BYTES - 16
SLOTS = 1024
RUN = -1
"""Number of an event of the run, which belongs to no arm."""

PHASE = "phase"
"""Name of the event that an operator marked a phase of the work."""

_CHARACTER = 12
"""Most bytes that JSON takes for a character: two escaped halves for one beyond the basic plane."""

_HEADER = 64
LOG_BYTES = _HEADER + SLOTS * SLOT_BYTES


@dataclass(frozen=True)
class BusEvent:
    """Something that happened to the arm with number ``arm``, or to the `RUN`.

    ``name`` is the topic that reports it.
    """

    arm: int
    name: str
    value: Any


class EventLog:
    """The log over ``memory`` of `LOG_BYTES`."""

    def __init__(self, memory: memoryview) -> None:
        self._memory = memory
        self._written: NDArray[np.uint64] = np.ndarray(1, "u8", memory[:8])
        self._marks: NDArray[np.uint64] = np.ndarray(SLOTS, "u8", memory[_HEADER:], strides=(SLOT_BYTES,))
        self._read = 0
        self.lost = 0

    def write(self, arm: int, name: str, value: Any) -> None:
        """Append an event; a text that is too long for a slot is cut."""
        data = _line(arm, name, value)
        text = str(value)[:MOST_BYTES]
        while len(data) > MOST_BYTES:
            data = _line(arm, name, text)
            text = text[: -max((len(data) - MOST_BYTES) // _CHARACTER, 1)]
        number = int(self._written[0])
        slot = number % SLOTS
        at = _HEADER + slot * SLOT_BYTES
        self._marks[slot] = 0
        self._memory[at + 8 : at + 12 + len(data)] = struct.pack("<I", len(data)) + data
        self._marks[slot] = number + 1
        self._written[0] = number + 1

    def skip(self) -> None:
        """Read on from the newest event only."""
        self._read = int(self._written[0])

    def read(self) -> list[BusEvent]:
        """Events since the last call, oldest first."""
        found = []
        last = int(self._written[0])
        if last - self._read > SLOTS:
            self.lost += last - SLOTS - self._read
            self._read = last - SLOTS
        while self._read < last:
            event = self._at(self._read)
            if event is None:
                self.lost += 1
            else:
                found.append(event)
            self._read += 1
        return found

    def _at(self, number: int) -> BusEvent | None:
        """The event of that number, None when it was overwritten meanwhile."""
        slot = number % SLOTS
        at = _HEADER + slot * SLOT_BYTES
        (size,) = struct.unpack_from("<I", self._memory, at + 8)
        data = bytes(self._memory[at + 12 : at + 12 + min(size, MOST_BYTES)])
        if int(self._marks[slot]) != number + 1:
            return None
        return BusEvent(*json.loads(data))

    def release(self) -> None:
        """Let go of the memory."""
        del self._written, self._marks
        self._memory.release()


def _line(arm: int, name: str, value: Any) -> bytes:
    return json.dumps([arm, name, value]).encode("ascii")
