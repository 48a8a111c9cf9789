"""Accepts connections of ROS clients such that a silent or malformed one does not block others.

rospy reads the handshake of a client on the only thread that accepts connections, without a timeout: a client that
sends nothing blocks all later subscribers and callers, and a malformed handshake ends the thread. Here each handshake
has a thread of its own and a timeout.
"""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any

import rospy

SECONDS = 5.0
"""Seconds that a client has to introduce itself."""

READING_SECONDS = 60.0
"""Seconds that a subscriber has to read the answer, and what a latched topic holds for it."""

MOST_BYTES = 64 * 1024
"""Most bytes of an introduction; those of clients have some hundred."""

MOST_AT_ONCE = 128
"""Most introductions at once: more clients wait until one has ended, so that silent ones take few descriptors."""

Handler = Callable[[socket.socket, Any], None]


def apart(handler: Handler) -> Handler:
    """``handler`` of new connections, which returns at once and raises nothing."""
    places = threading.BoundedSemaphore(MOST_AT_ONCE)

    def introduce(client: socket.socket, address: Any) -> None:
        try:
            _introduce(handler, client, address)
        finally:
            places.release()

    def take(client: socket.socket, address: Any) -> None:
        places.acquire()
        try:
            threading.Thread(target=introduce, args=(client, address), name="handshake", daemon=True).start()
        except RuntimeError:  # no more threads; this one client is lost, not the thread that takes all
            places.release()
            client.close()

    return take


def _introduce(handler: Handler, client: socket.socket, address: Any) -> None:
    """Hand a connection over; one that is late, or that is no client of ROS, is closed."""
    try:
        with _within(SECONDS, client):
            _check(client)
        with _within(READING_SECONDS, client):
            handler(client, address)
    except Exception as error:
        rospy.logdebug(f"closed a connection from {address}: {error}")
        _end(client)
        client.close()


@contextmanager
def _within(seconds: float, client: socket.socket) -> Iterator[None]:
    """End the connection of a ``client`` for which this takes longer."""
    late = threading.Timer(seconds, _end, (client,))
    late.daemon = True
    late.start()
    try:
        yield
    finally:
        late.cancel()


def _check(client: socket.socket) -> None:
    """Wait for the whole introduction, which stays to be read; raises ValueError where it is none."""
    start = client.recv(4, socket.MSG_PEEK | socket.MSG_WAITALL)
    length = struct.unpack("<I", start)[0] if len(start) == 4 else MOST_BYTES + 1
    if length > MOST_BYTES or len(client.recv(4 + length, socket.MSG_PEEK | socket.MSG_WAITALL)) < 4 + length:
        raise ValueError("it does not introduce itself as a client of ROS does")


def _end(client: socket.socket) -> None:
    """End whatever waits for a client."""
    with suppress(OSError):
        client.shutdown(socket.SHUT_RDWR)
