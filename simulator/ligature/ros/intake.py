"""Limits the size of messages from clients: larger ones are discarded as they arrive, without being stored.

rospy buffers messages of up to 4 GiB, converts them to objects of four times that size, and keeps the last one of each
connection. Commands have a few hundred bytes.
"""

from __future__ import annotations

import io
import struct
import threading
from typing import Any

import rospy
from rospy.exceptions import TransportTerminated
from rospy.impl.tcpros_base import TCPROSTransportProtocol
from rospy.impl.tcpros_pubsub import TCPROSSub
from rospy.impl.tcpros_service import TCPService

from ligature.process import REPEAT

MOST_BYTES = 32 * 1024
"""Most bytes of a message or request; 250 joints with names and all of position, velocity and effort take 20 KB."""

_ALLOWED: dict[str, int] = {}
"""Most bytes of a message on topics that take larger ones."""

_LENGTH = struct.Struct("<I")


class Oversized:
    """Counts the messages that were too long; safe from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self.count = 0

    def note(self, name: str, size: int) -> None:
        """Count a message on the topic or service ``name`` and warn."""
        with self._lock:
            self.count += 1
        rospy.logwarn_throttle(REPEAT, f"{name}: rejected a message of {size} bytes; the maximum is {MOST_BYTES} bytes")


oversized = Oversized()
"""Of this process, whose connections rospy keeps in one place, too."""


def announced(buffer: io.BytesIO) -> int | None:
    """Length of the message at the start of ``buffer``, as it was announced; None when that is not known yet."""
    if buffer.tell() < _LENGTH.size:
        return None
    (size,) = _LENGTH.unpack_from(buffer.getbuffer())
    return int(size)


def read_bounded(connection: Any, b: io.BytesIO, msg_queue: list[Any], sock: Any) -> None:
    """Take the messages that are complete in ``b`` into ``msg_queue``, and pass over those that are too long.

    One that arrives whole behind another, within one look at the socket (64 KiB), is taken all the same.
    rospy calls it after every such look, as the method ``read_messages`` of a ``connection`` from a publisher.
    """
    while True:
        _skip(connection, b)
        size = announced(b)
        if connection.skipping or size is None:
            return
        if size <= _ALLOWED.get(connection.resolved_name, MOST_BYTES):
            break
        oversized.note(connection.resolved_name, size)
        connection.skipping = _LENGTH.size + size
    TCPROSTransportProtocol.read_messages(connection, b, msg_queue, sock)


def _skip(connection: Any, b: io.BytesIO) -> None:
    """Remove the bytes of an oversized message from ``b``."""
    if connection.skipping:
        data = b.getvalue()[: b.tell()]
        dropped = min(connection.skipping, len(data))
        connection.skipping -= dropped
        b.seek(0)
        b.truncate()
        b.write(data[dropped:])


def read_bounded_request(connection: Any, b: io.BytesIO, msg_queue: list[Any], sock: Any) -> None:
    """The same for the client of a service; a request that is too long ends the connection, since it gets no answer.

    Raises TransportTerminated then.
    """
    size = announced(b)
    if size is not None and size > MOST_BYTES:
        oversized.note(connection.resolved_name, size)
        raise TransportTerminated(f"rejected a request of {size} bytes; the maximum is {MOST_BYTES}")
    TCPROSTransportProtocol.read_messages(connection, b, msg_queue, sock)


def allow_bytes(topic: str, most: int) -> None:
    """Take messages of up to ``most`` bytes on a topic."""
    _ALLOWED[topic] = most


def bound_messages() -> None:
    """From now on all subscriptions and services of this process are bounded."""
    TCPROSSub.skipping = 0
    TCPROSSub.read_messages = read_bounded
    TCPService.read_messages = read_bounded_request
