"""Publishing without waiting: a client that does not read costs nobody anything but itself."""

from __future__ import annotations

import socket
import time
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
from ligature.ros.publisher import deliver

DATA = bytes(500)


def client() -> tuple[SimpleNamespace, socket.socket]:
    """rospy's side of a connection, and the client's socket."""
    ours, theirs = socket.socketpair()
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 16384)
    connection = SimpleNamespace(socket=ours, done=False, write_data=ours.sendall, closed=False)

    def close() -> None:
        connection.closed = True
        ours.close()

    connection.close = close
    return connection, theirs


@pytest.fixture
def two() -> Iterator[list[tuple[SimpleNamespace, socket.socket]]]:
    clients = [client(), client()]
    yield clients
    for connection, theirs in clients:
        connection.socket.close()
        theirs.close()


def test_a_client_that_does_not_read_misses_messages_and_holds_up_nobody(
    two: list[tuple[SimpleNamespace, socket.socket]],
) -> None:
    (stuck, _), (reader, reading) = two
    missed, received, begin = 0, 0, time.monotonic()
    for _ in range(1000):
        missed += deliver([stuck, reader], DATA)
        received += len(reading.recv(65536))
    assert time.monotonic() - begin < 2.0
    assert received == 1000 * len(DATA)
    assert 900 < missed < 1000


def test_what_a_stuck_client_reads_later_is_whole_messages(two: list[tuple[SimpleNamespace, socket.socket]]) -> None:
    stuck, late = two[0]
    sent = sum(1 - deliver([stuck], DATA) for _ in range(200))
    late.setblocking(False)
    received = 0
    while True:
        try:
            received += len(late.recv(65536))
        except BlockingIOError:
            break
    assert received == sent * len(DATA)


def test_a_client_that_is_gone_is_given_up(two: list[tuple[SimpleNamespace, socket.socket]]) -> None:
    gone, theirs = two[0]
    theirs.close()
    for _ in range(3):
        deliver([gone], DATA)
    assert gone.closed
