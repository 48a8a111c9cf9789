"""A ROS publisher that sends on the caller's thread and never waits for a client.

rospy either waits for the slowest client or keeps one thread for each connection, which for 38 topics at 100 Hz
takes two and a half times the processor time (24.9 % of a core against 9.6 %). Here a client whose socket is full
misses messages instead. Of a message that its socket takes only in part, the rest follows when there is room.
"""

from __future__ import annotations

import io
import os
import select
import socket
import time
from collections.abc import Sequence
from typing import Any, Protocol

import rospy
import rospy.msg

QUEUE = 10

AT_ONCE = 0.002
"""Seconds for which a client that reads may take the rest of a message that is larger than its buffers."""

RESTING = 8
"""Clients that one message waits for in this way at most; the rest of others follows later."""


Data = bytes | memoryview

NOTHING = b""


class Connection(Protocol):
    """What is used of rospy's connection to one client; ``stat_…`` are what `rosnode info` and others show."""

    socket: Any
    done: bool
    stat_bytes: int
    stat_num_msg: int

    def close(self) -> None:
        """Give the client up."""


class Publisher:
    """Publishes messages of one type on one topic; counts in ``dropped`` what clients missed."""

    def __init__(self, topic: str, type_: type) -> None:
        self._publisher = rospy.Publisher(topic, type_, queue_size=QUEUE, tcp_nodelay=True)
        self._publisher.impl.set_queue_size(None)
        self._buffer = io.BytesIO()
        self._delivery = Delivery()
        self.dropped = 0

    @property
    def heard(self) -> bool:
        """Whether anybody listens."""
        return bool(self._publisher.impl.connections)

    def close(self) -> None:
        """Have the master forget the topic; nothing may be published after this."""
        self._publisher.unregister()

    def publish(self, message: Any) -> None:
        """Send ``message`` to every client that has room for it."""
        topic = self._publisher.impl
        topic.seq += 1
        self._buffer.seek(0)
        self._buffer.truncate()
        rospy.msg.serialize_message(self._buffer, topic.seq, message)
        self.dropped += self._delivery.deliver(topic.connections, self._buffer.getvalue())

    def flush(self) -> None:
        """Send rests of messages, as far as clients have room."""
        self._delivery.flush()


class Delivery:
    """Sends whole messages to the clients of one topic, and waits for none of them."""

    def __init__(self) -> None:
        self._rests: dict[int, tuple[Connection, Data]] = {}

    def deliver(self, connections: Sequence[Connection], data: bytes) -> int:
        """Send ``data`` to each of ``connections``; returns how many miss it.

        Those do whose socket is full, or that still lack the rest of an earlier message.
        """
        self.flush()
        missed, waits = 0, RESTING
        for connection in list(connections):
            if id(connection) in self._rests:
                missed += 1
                continue
            rest = _send(connection, data)
            if 0 < len(rest) < len(data) and waits:
                waits -= 1
                rest = _send_within(connection, rest, AT_ONCE)
            if len(rest) == len(data):
                missed += 1
            elif rest:
                self._rests[id(connection)] = connection, rest
        return missed

    def flush(self) -> None:
        """Send rests of messages, as far as clients have room; those of clients that are gone are forgotten."""
        for key, (connection, rest) in list(self._rests.items()):
            rest = _send(connection, rest)
            if rest:
                self._rests[key] = connection, rest
            else:
                del self._rests[key]


def _send(connection: Connection, data: Data) -> Data:
    """Send what a client has room for; returns the rest, nothing for a client that is gone."""
    client = connection.socket
    if connection.done or client is None:
        return NOTHING
    try:
        sent = _send_at_once(client, data)
    except BlockingIOError:
        return data
    except OSError:
        connection.close()
        return NOTHING
    connection.stat_bytes += sent
    if sent < len(data):
        return memoryview(data)[sent:]
    connection.stat_num_msg += 1
    return NOTHING


def _send_at_once(client: Any, data: Data) -> int:
    """Send what a socket has room for; returns how much that was, and raises BlockingIOError for nothing.

    rospy gives all sockets of a process a timeout of a minute. Python's `send` then waits, whatever its flags are, for
    a descriptor that does not block.
    """
    if client.gettimeout() is None:
        return int(client.send(data, socket.MSG_DONTWAIT))
    return os.write(client.fileno(), data)


def _send_within(connection: Connection, data: Data, seconds: float) -> Data:
    """`_send` again and again until a time has passed; returns the rest."""
    end = time.monotonic() + seconds
    while data and (left := end - time.monotonic()) > 0.0:
        poll = select.poll()
        try:
            poll.register(connection.socket, select.POLLOUT)
        except (TypeError, ValueError):  # closed meanwhile
            return NOTHING
        if not poll.poll(1e3 * left):
            break
        data = _send(connection, data)
    return data
