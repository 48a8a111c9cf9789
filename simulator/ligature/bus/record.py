"""The record of a run: every command with the update that it was taken before, so that the run can be simulated again.

The same scene and commands give the same bits, so that a record is all that a run was. A file has one line of JSON,
then frames: update (u8), length (u4), a command as `ligature.bus.codec` packs it; the last has the length `END` and
says the hash of the final state. Until the run ends the file is called ``NAME.active``.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

from ligature.bus.codec import CodecError, decode, encode
from ligature.bus.pacing import Pace, Throttle
from ligature.bus.ring import MOST_BYTES
from ligature.model.commands import Command

FORMAT = "ligature record 1"
END = 0xFFFFFFFF
_HEAD = struct.Struct("<QI")
_HASH_BYTES = 32


class RecordError(ValueError):
    """A file that is no whole record; the message says why, and where."""


@dataclass(frozen=True)
class Header:
    """What a record begins with: the run's options as text, and the state's hash after the first update."""

    options: str
    begin: str


class RecordWriter:
    """Writes the record ``path``, which must not exist; raises OSError where that cannot be done."""

    def __init__(self, path: Path, header: Header) -> None:
        if path.exists():
            raise FileExistsError(f"'{path}' exists already; records replace nothing")
        self._path, self._part = path, path.with_name(f"{path.name}.active")
        self._file = self._part.open("wb")
        head = {"format": FORMAT, "options": header.options, "begin": header.begin}
        self._file.write(json.dumps(head).encode() + b"\n")
        self._file.flush()

    def write(self, update: int, command: Command) -> None:
        """Note that ``command`` was taken after ``update`` updates."""
        data = encode(command)
        self._file.write(_HEAD.pack(update, len(data)) + data)

    def flush(self) -> None:
        """Hand what was written to the disk."""
        self._file.flush()

    def finish(self, update: int, state_hash: str) -> None:
        """End with the hash of the state after ``update`` updates; now the file gets its name."""
        self._file.write(_HEAD.pack(update, END) + bytes.fromhex(state_hash))
        self._file.close()
        self._part.replace(self._path)

    def abandon(self) -> Path:
        """Stop writing; returns where what was written stays."""
        with suppress(OSError):
            self._file.close()
        return self._part


@dataclass(frozen=True)
class Record:
    """A whole record: pairs of update and command, and the run's length in updates and final hash."""

    header: Header
    commands: tuple[tuple[int, Command], ...]
    updates: int
    end: str

    @classmethod
    def read(cls, path: Path) -> Record:
        """The record ``path``; raises `RecordError`, and OSError."""
        data = path.read_bytes()
        header, begin = _header(data, path)
        commands: list[tuple[int, Command]] = []
        for update, length, at in _frames(data, begin, path):
            if length == END:
                return cls(header, tuple(commands), update, data[at : at + _HASH_BYTES].hex())
            try:
                command = decode(data[at : at + length])
            except CodecError as error:
                raise RecordError(f"{path}: at byte {at}: {error}") from error
            if isinstance(command, Throttle | Pace):
                raise RecordError(f"{path}: at byte {at}: no command of a record")
            commands.append((update, command))
        raise RecordError(
            f"{path}: cut off after {len(commands)} commands: the run that wrote it did not come to its end"
        )

    def replay(self, updated: Callable[[], None], take: Callable[[Command], None]) -> None:
        """Call ``updated`` and ``take`` in the order of the run, from after the first update to the last."""
        done = 1
        for update, command in self.commands:
            for _ in range(update - done):
                updated()
            done = max(done, update)
            take(command)
        for _ in range(self.updates - done):
            updated()


def is_record(path: Path) -> bool:
    """Whether a file begins as a record does."""
    with path.open("rb") as file:
        return file.read(64).startswith(b'{"format": "ligature record')


def _header(data: bytes, path: Path) -> tuple[Header, int]:
    line, newline, _ = data.partition(b"\n")
    try:
        head = json.loads(line)
        if head["format"] != FORMAT:
            raise RecordError(f"{path}: is a '{head['format']}'; this version reads '{FORMAT}'")
        header = Header(str(head["options"]), str(head["begin"]))
    except (UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError):
        raise RecordError(f"{path}: is no record of a run") from None
    return header, len(line) + len(newline)


def _frames(data: bytes, at: int, path: Path) -> Iterator[tuple[int, int, int]]:
    """Update, length and place of each whole frame."""
    before = 0
    while at + _HEAD.size <= len(data):
        update, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        size = _HASH_BYTES if length == END else length
        if size > MOST_BYTES or update < before:
            raise RecordError(f"{path}: at byte {at}: no frame of a record")
        if at + size > len(data):
            return
        yield update, length, at
        at, before = at + size, update
