"""The record of a run: every command with the update that it was taken before, so that the run can be simulated again.

The same scene and commands give the same bits, so that a record is all that a run was. A file has one line of JSON,
then frames: update (u8), length (u4), a command as `ligature.bus.codec` packs it; the last has the length `END` and
holds the hash of the final state, then the digest of all bytes before: a damaged record is found before anything is
simulated. A record that was asked for in the middle of a run holds all commands before, too, and a frame of the
length `BEGIN` with the hash of the state then. Until it is whole the file is called ``NAME.active``.
"""

from __future__ import annotations

import hashlib
import json
import os
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from ligature.bus.codec import CodecError, decode, encode
from ligature.bus.ring import MOST_BYTES
from ligature.model.commands import Command
from ligature.paths import give_name, open_file, part_of

FORMAT = "ligature record 3"
END, BEGIN = 0xFFFFFFFF, 0xFFFFFFFE
_HEAD = struct.Struct("<QI")
_HASH_BYTES = 32
_CHUNK = 1 << 20
_DIGEST_BYTES = 16

MOST_UPDATES = 10**9
"""Longest run that is replayed: 11 days at 1000 updates per second."""

MOST_FILE_BYTES = 1 << 32
"""Largest record: 18 hours of servo commands to five arms at 1000 Hz."""


class RecordError(ValueError):
    """A file that is no whole record; the message gives the reason and the place."""


@dataclass(frozen=True)
class Header:
    """What a record begins with: the run's options as text, and the state's hash after the first update."""

    options: str
    begin: str


@dataclass(frozen=True)
class Moment:
    """After ``update`` updates the state had the hash ``state``; the journal was ``size`` bytes long."""

    update: int
    state: str
    size: int


class Journal:
    """All commands of a run in an open ``file``, from which records are made; raises OSError where it cannot."""

    def __init__(self, file: BinaryIO, header: Header) -> None:
        self._file = file
        self._digest = _new_digest()
        head = {"format": FORMAT, "options": header.options, "begin": header.begin}
        self._put(json.dumps(head).encode() + b"\n")
        self._file.flush()

    def _put(self, data: bytes) -> None:
        self._file.write(data)
        self._digest.update(data)

    def write(self, update: int, command: Command) -> None:
        """Note that ``command`` was taken after ``update`` updates."""
        data = encode(command)
        self._put(_HEAD.pack(update, len(data)) + data)

    def flush(self) -> None:
        """Hand what was written to the disk."""
        self._file.flush()

    def moment(self, update: int, state_hash: str) -> Moment:
        """Where the run is now."""
        self._file.flush()
        return Moment(update, state_hash, self._file.tell())

    def copy(self, put: Callable[[bytes], object], begin: int, end: int) -> None:
        """Give ``put`` bytes from ``begin`` to ``end``; may run beside `write` on another thread.

        Raises OSError when the file has been truncated.
        """
        while begin < end:
            data = os.pread(self._file.fileno(), min(_CHUNK, end - begin), begin)
            if not data:
                raise OSError(0, "the journal of the run has been truncated")
            put(data)
            begin += len(data)

    def close(self) -> None:
        """Close the file."""
        with suppress(OSError):
            self._file.close()


class RecordWriter(Journal):
    """Writes the record ``path``, which must not exist; raises OSError where that cannot be done."""

    def __init__(self, path: Path, header: Header) -> None:
        self._path, self._part = path, part_of(path)
        file = self._part.open("x+b")
        try:
            super().__init__(file, header)
        except OSError:
            with suppress(OSError):
                file.close()
            self._part.unlink()
            raise

    def finish(self, update: int, state_hash: str) -> None:
        """End with the hash of the state after ``update`` updates; now the file gets its name."""
        self._put(_HEAD.pack(update, END) + bytes.fromhex(state_hash))
        self._file.write(self._digest.digest())
        self._file.close()
        give_name(self._part, self._path)

    def abandon(self) -> Path:
        """Stop writing; returns where what was written stays."""
        self.close()
        return self._part


class Excerpt:
    """The record ``path`` of a run whose ``journal`` is kept, from the moment ``begin`` on.

    Raises OSError where it cannot be written, at once rather than at its end.
    """

    def __init__(self, path: Path, journal: Journal, begin: Moment) -> None:
        self.path, self.begin = path, begin
        self._journal, self._part = journal, part_of(path)
        self._file = self._part.open("xb")

    def finish(self, end: Moment) -> None:
        """Write all of it, and give the file its name; takes as long as the disk does, on any thread."""
        begin, file, journal, digest = self.begin, self._file, self._journal, _new_digest()

        def put(data: bytes) -> None:
            file.write(data)
            digest.update(data)

        try:
            journal.copy(put, 0, begin.size)
            put(_HEAD.pack(begin.update, BEGIN) + bytes.fromhex(begin.state))
            journal.copy(put, begin.size, end.size)
            put(_HEAD.pack(end.update, END) + bytes.fromhex(end.state))
            file.write(digest.digest())
            file.close()
        except OSError:
            self.drop()
            raise
        give_name(self._part, self.path)

    def drop(self) -> None:
        """Write nothing."""
        with suppress(OSError):
            self._file.close()
        self._part.unlink(missing_ok=True)


@dataclass(frozen=True)
class Record:
    """A whole record: pairs of update and command, and the run's length in updates and final hash.

    What was asked for begins after ``start`` updates and the first ``before`` commands, with the hash ``begun``; that
    is empty for a record of a run from its beginning.
    """

    header: Header
    commands: tuple[tuple[int, Command], ...]
    updates: int
    end: str
    start: int = 1
    before: int = 0
    begun: str = ""

    @classmethod
    def read(cls, path: Path) -> Record:
        """The record ``path``; raises `RecordError`, and OSError."""
        with open_file(path) as file:
            if os.fstat(file.fileno()).st_size > MOST_FILE_BYTES:
                raise RecordError(f"{path}: has more than {MOST_FILE_BYTES >> 30} GiB, the maximum size of a record")
            data = file.read()
        header, begin = _header(data, path)
        commands: list[tuple[int, Command]] = []
        asked = (1, 0, "")
        for update, length, at in _frames(data, begin, path):
            if length == END:
                if len(data) < at + _HASH_BYTES + _DIGEST_BYTES:
                    break
                _check_whole(data, at + _HASH_BYTES, path)
                return cls(header, tuple(commands), update, data[at : at + _HASH_BYTES].hex(), *asked)
            if length == BEGIN:
                asked = (update, len(commands), data[at : at + _HASH_BYTES].hex())
                continue
            try:
                command = decode(data[at : at + length])
            except CodecError as error:
                raise RecordError(f"{path}: at byte {at}: {error}") from error
            if not isinstance(command, Command):
                raise RecordError(f"{path}: at byte {at}: invalid command")
            commands.append((update, command))
        raise RecordError(f"{path}: cut off after {len(commands)} commands: the recorded run did not end properly")

    def replay(
        self, updated: Callable[[], None], take: Callable[[Command], None], started: Callable[[], None] = lambda: None
    ) -> None:
        """Call ``updated`` and ``take`` in the order of the run, from after the first update to the last.

        ``started`` is called where what was asked for begins.
        """
        done = 1
        for index, (update, command) in enumerate((*self.commands, (self.updates, None))):
            if index == self.before:
                for _ in range(self.start - done):
                    updated()
                done = max(done, self.start)
                started()
            for _ in range(update - done):
                updated()
            done = max(done, update)
            if command is not None:
                take(command)


def is_record(path: Path) -> bool:
    """Whether a file begins as a record does."""
    with open_file(path) as file:
        return file.read(64).startswith(b'{"format": "ligature record')


def _header(data: bytes, path: Path) -> tuple[Header, int]:
    line, newline, _ = data.partition(b"\n")
    try:
        head = json.loads(line)
        if head["format"] != FORMAT:
            raise RecordError(f"{path}: is a '{head['format']}'; this version reads '{FORMAT}'")
        header = Header(str(head["options"]), str(head["begin"]))
    except (UnicodeDecodeError, json.JSONDecodeError, KeyError, TypeError, RecursionError):
        raise RecordError(f"{path}: line 1: not the header of a record of a run") from None
    return header, len(line) + len(newline)


def _new_digest() -> hashlib.blake2b:
    return hashlib.blake2b(digest_size=_DIGEST_BYTES)


def _check_whole(data: bytes, end: int, path: Path) -> None:
    """Raise `RecordError` unless the bytes before ``end`` are those that were written."""
    digest = _new_digest()
    digest.update(memoryview(data)[:end])
    if data[end:] != digest.digest():
        raise RecordError(f"{path}: at byte {end}: the record is damaged: its checksum does not match its content")


def _frames(data: bytes, at: int, path: Path) -> Iterator[tuple[int, int, int]]:
    """Update, length and place of each whole frame."""
    before = 0
    while at + _HEAD.size <= len(data):
        update, length = _HEAD.unpack_from(data, at)
        at += _HEAD.size
        size = _HASH_BYTES if length in (BEGIN, END) else length
        if size > MOST_BYTES or update < before:
            raise RecordError(f"{path}: at byte {at}: invalid frame")
        if update > MOST_UPDATES:
            raise RecordError(f"{path}: at byte {at}: a run has {update} updates; the maximum is {MOST_UPDATES}")
        if at + size > len(data):
            return
        yield update, length, at
        at, before = at + size, update
