"""Accepts connections of ROS clients such that a silent or malformed one does not block others.

rospy reads the handshake of a client on the only thread that accepts connections, without a timeout: a client that
sends nothing blocks all later subscribers and callers, and a malformed handshake ends the thread. Here each handshake
has a thread of its own and a timeout.
"""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import rospy

SECONDS = 5.0
"""Seconds that a client has to introduce itself."""

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
    late = threading.Timer(SECONDS, _end, (client,))
    late.daemon = True
    try:
        late.start()
        _check(client)
        handler(client, address)
    except Exception as error:
        rospy.logdebug(f"closed a connection from {address}: {error}")
        _end(client)
        client.close()
    finally:
        late.cancel()


def _check(client: socket.socket) -> None:
    """Look how long the introduction will be, before anything is read; raises ValueError."""
    start = client.recv(4, socket.MSG_PEEK | socket.MSG_WAITALL)
    if len(start) < 4 or struct.unpack("<I", start)[0] > MOST_BYTES:
        raise ValueError("it does not introduce itself as a client of ROS does")


def _end(client: socket.socket) -> None:
    """End whatever waits for a client."""
    with suppress(OSError):
        client.shutdown(socket.SHUT_RDWR)
