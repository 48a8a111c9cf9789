"""Commands as bytes: the code of the message, then its fields; no code in the data."""

from __future__ import annotations

import struct

import ligature.model.commands
import ligature.robots.commands  # noqa: F401  both register their messages
from ligature.model.messages import CodecError, Message

__all__ = ["CodecError", "Message", "decode", "encode"]


def encode(message: Message) -> bytes:
    """The bytes of a message; raises `CodecError` when it does not fit."""
    try:
        return bytes([message.code]) + b"".join(
            field.pack(getattr(message, name)) for name, _, field in message.fields()
        )
    except CodecError:
        raise
    except (struct.error, OverflowError, ValueError) as error:
        raise CodecError(f"{type(message).__name__} does not fit into a message: {error}") from error


def decode(data: bytes) -> Message:
    """The message of ``data``; raises `CodecError`."""
    try:
        message = Message.by_code[data[0]]
        at, values = 1, []
        for _, _, field in message.fields():
            value, at = field.unpack(data, at)
            values.append(value)
        return message(*values)
    except (struct.error, LookupError, ValueError, UnicodeDecodeError) as error:
        raise CodecError(f"invalid command bytes: {error}") from error
