"""Looks into the memory of this process for objects of PyBullet's library that it hands to nobody.

An object says what it is: its first word points to the functions of its class, the word before those to the class,
whose second word points to its name. Whatever is no address of memory reads as nothing.

Source: Itanium C++ ABI, run-time type information.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

Integers = NDArray[np.int64]

PROCESSOR = "29PhysicsServerCommandProcessor"
"""Name of the class of what carries out a client's commands; its second word points to all that it has."""

MOST_WORDS, WORDS = 1 << 21, 1 << 16
"""Words of a client's data among which the processor is looked for, and those that are read at once."""

PARTS = 2048
"""Words of what a processor has, among which its parts are looked for."""


def words(address: int, count: int) -> Integers:
    """The ``count`` words at an address; fewer where memory ends, none where there is none."""
    try:
        with open("/proc/self/mem", "rb", buffering=0) as own:
            own.seek(address)
            found = own.read(8 * count)
    except (OSError, ValueError, OverflowError):
        return np.zeros(0, dtype=np.int64)
    return np.frombuffer(found[: len(found) // 8 * 8], dtype=np.int64)


def word(address: int) -> int | None:
    """The word at an address, None where there is no memory."""
    found = words(address, 1)
    return int(found[0]) if len(found) else None


def class_of(address: int) -> str:
    """The name of the class of the object at an address, as the compiler wrote it; empty for what is none."""
    at = address
    for step in (0, -8, 8):
        found = word(at + step) if at > 0 and at % 8 == 0 else None
        if found is None:
            return ""
        at = found
    text = words(at, 8).tobytes() if at > 0 else b""
    name = text.split(b"\0")[0]
    return name.decode("ascii") if name[:1].isdigit() and name.isascii() else ""


class _Places:
    """Where the processor stands in a client's data, in words; the same in all clients."""

    processor: int | None = None


def part(handle: int, kind: str) -> int:
    """Address of what the client with a handle has of class ``kind``, 0 for nothing."""
    data = word(handle + 8) or 0
    if _Places.processor is None:
        _Places.processor = next((k for k, _ in _objects(data, MOST_WORDS, PROCESSOR)), -1)
    if _Places.processor < 0:
        return 0
    processor = word(data + 8 * _Places.processor) or 0
    if class_of(processor) != PROCESSOR:
        return 0
    return next((address for _, address in _objects(word(processor + 8) or 0, PARTS, kind)), 0)


def _objects(address: int, count: int, kind: str) -> Iterator[tuple[int, int]]:
    """Place and address of all objects of class ``kind`` that one of ``count`` words at an address points to."""
    for begin in range(0, count, WORDS):
        wanted = min(WORDS, count - begin)
        found = words(address + 8 * begin, wanted)
        for k in np.flatnonzero((found > 0) & (found % 8 == 0)).tolist():
            if class_of(int(found[k])) == kind:
                yield begin + k, int(found[k])
        if len(found) < wanted:
            return
