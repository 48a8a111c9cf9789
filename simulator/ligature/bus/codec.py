"""Commands as bytes: fixed layouts by kind, no code in the data."""

from __future__ import annotations

import struct

from ligature.bus.pacing import Pace, Throttle
from ligature.bus.recording import Recording
from ligature.model.commands import (
    MOST_BYTES,
    MOST_NUMBERS,
    VERBS,
    ActuatorCommand,
    ArmCommand,
    BodyCommand,
    Command,
    CommandType,
    ParentCommand,
    PlaceCommand,
    Release,
    Reset,
    WatchContacts,
)

_TYPES = tuple(sorted(CommandType))
_KINDS = ("body", "camera", "light", "actuator", "sensor", "ghost", "world", "arm")

LoopCommand = Throttle | Pace | Recording
"""What the loop obeys itself, of which the simulation knows nothing."""

Message = Command | LoopCommand


class CodecError(ValueError):
    """A command too large for a slot, or bytes that are no command."""


def encode(message: Message) -> bytes:
    """The bytes of a command; raises `CodecError` when it does not fit."""
    try:
        return _encode(message)
    except CodecError:
        raise
    except (struct.error, OverflowError, ValueError) as error:
        raise CodecError(f"this command does not fit into a message: {error}") from error


def _encode(message: Message) -> bytes:
    if isinstance(message, BodyCommand):
        return _body(message)
    if isinstance(message, ActuatorCommand):
        offset = message.offset or ()
        return struct.pack(
            f"<BiBBB{len(offset)}d",
            2,
            message.actuator,
            message.actuate,
            len(offset),
            message.sensor is not None,
            *offset,
        ) + _texts(message.body, message.sensor or "")
    if isinstance(message, PlaceCommand):
        pose = message.pose or ()
        return struct.pack(f"<BBiB{len(pose)}d", 3, _KINDS.index(message.kind), message.index, len(pose), *pose)
    if isinstance(message, ParentCommand):
        parent = -1 if message.parent is None else message.parent
        return struct.pack("<BBii", 8, _KINDS.index(message.kind), message.index, parent)
    if isinstance(message, WatchContacts):
        return struct.pack("<BB", 9, message.enabled)
    if isinstance(message, ArmCommand):
        return _arm(message)
    if isinstance(message, Pace):
        return struct.pack("<Bd", 10, message.speed)
    if isinstance(message, Recording):
        return struct.pack("<B", 11) + _texts(message.name)
    if isinstance(message, Release):
        return struct.pack("<BBi", 4, _KINDS.index(message.kind), message.index)
    if isinstance(message, Reset):
        return struct.pack("<BB", 5, message.bodies_only)
    return struct.pack("<BBBI", 6, message.enabled, message.clock, message.skip)


def decode(data: bytes) -> Message:
    """The command of ``data``; raises `CodecError`."""
    try:
        return _decode(data)
    except (struct.error, IndexError, ValueError, UnicodeDecodeError) as error:
        raise CodecError(f"these bytes are no command: {error}") from error


def _body(message: BodyCommand) -> bytes:
    n, m, t = len(message.target), len(message.joint_values), len(message.joint_types)
    if max(n, m, t) > MOST_NUMBERS:
        raise CodecError(f"a command has at most {MOST_NUMBERS} numbers")
    head = struct.pack("<BiBBBB", 1, message.body, int(message.type), n, m, t)
    return head + struct.pack(
        f"<{n}d{m}d{t}B", *message.target, *message.joint_values, *(int(v) for v in message.joint_types)
    )


def _arm(message: ArmCommand) -> bytes:
    n = len(message.values)
    if n > MOST_NUMBERS:
        raise CodecError(f"a command has at most {MOST_NUMBERS} numbers")
    head = struct.pack(f"<BiBB{n}d", 7, message.arm, VERBS.index(message.verb), n, *message.values)
    return head + _texts(message.text)


def _texts(*texts: str) -> bytes:
    data = b""
    for text in texts:
        raw = text[: MOST_BYTES + 1].encode("utf-8")  # a character takes at least one byte
        if len(raw) > MOST_BYTES:
            raise CodecError(f"a name has at most {MOST_BYTES} bytes")
        data += struct.pack("<B", len(raw)) + raw
    return data


def _decode(data: bytes) -> Message:
    kind = data[0]
    if kind == 1:
        _, body, type_, n, m, t = struct.unpack_from("<BiBBBB", data)
        values = struct.unpack_from(f"<{n}d{m}d{t}B", data, 9)
        types = tuple([_TYPES[v] for v in values[n + m :]])
        return BodyCommand(body, _TYPES[type_], values[:n], types, values[n : n + m])
    if kind == 2:
        _, actuator, actuate, n, by_sensor = struct.unpack_from("<BiBBB", data)
        offset = struct.unpack_from(f"<{n}d", data, 8)
        at = 8 + 8 * n
        size = data[at]
        body = data[at + 1 : at + 1 + size].decode("utf-8")
        at += 1 + size
        sensor = data[at + 1 : at + 1 + data[at]].decode("utf-8")
        return ActuatorCommand(actuator, bool(actuate), body, offset or None, sensor if by_sensor else None)
    if kind == 3:
        _, what, index, n = struct.unpack_from("<BBiB", data)
        return PlaceCommand(_KINDS[what], index, struct.unpack_from(f"<{n}d", data, 7) or None)
    if kind == 4:
        _, what, index = struct.unpack_from("<BBi", data)
        return Release(_KINDS[what], index)
    if kind == 5:
        return Reset(bool(data[1]))
    if kind == 6:
        _, enabled, toggle, skip = struct.unpack_from("<BBBI", data)
        return Throttle(bool(enabled), bool(toggle), skip)
    if kind == 7:
        _, arm, verb, n = struct.unpack_from("<BiBB", data)
        values, at = struct.unpack_from(f"<{n}d", data, 7), 7 + 8 * n
        return ArmCommand(arm, VERBS[verb], values, data[at + 1 : at + 1 + data[at]].decode("utf-8"))
    if kind == 8:
        _, what, index, parent = struct.unpack_from("<BBii", data)
        return ParentCommand(_KINDS[what], index, parent if parent != -1 else None)
    if kind == 9:
        return WatchContacts(bool(data[1]))
    if kind == 10:
        return Pace(*struct.unpack_from("<xd", data))
    if kind == 11:
        return Recording(data[2 : 2 + data[1]].decode("utf-8"))
    raise ValueError(f"unknown kind {kind}")
