"""Publishing without waiting: a client that does not read, or dies, costs nobody anything but itself."""

from __future__ import annotations

import random
import socket
import struct
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from itertools import cycle
from types import SimpleNamespace
from typing import Any
from xmlrpc.client import ServerProxy

import pytest

pytest.importorskip("rospy")
from ligature.ros.publisher import AT_ONCE, Delivery

from tests.waiting import until

DATA = bytes(500)
LARGE = 300_000
"""Bytes of a message that does not fit the buffers of `client`, as the surface of a tissue for a distant viewer."""


TIMEOUTS = cycle((60.0, None))


def client() -> tuple[SimpleNamespace, socket.socket]:
    """rospy's side of a connection, with a timeout as rospy has it or none, and the client's socket."""
    ours, theirs = socket.socketpair()
    ours.settimeout(next(TIMEOUTS))
    ours.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 16384)
    connection = SimpleNamespace(socket=ours, done=False, closed=False, stat_bytes=0, stat_num_msg=0)

    def close() -> None:
        connection.closed = connection.done = True
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


def waiting(theirs: socket.socket) -> bytes:
    """What a client has not read yet."""
    theirs.setblocking(False)
    found = bytearray()
    with suppress(BlockingIOError):
        while part := theirs.recv(65536):
            found += part
    return bytes(found)


def test_a_client_that_does_not_read_misses_messages_and_holds_up_nobody(
    two: list[tuple[SimpleNamespace, socket.socket]],
) -> None:
    (stuck, _), (reader, reading) = two
    delivery, missed, received, begin = Delivery(), 0, 0, time.monotonic()
    for _ in range(1000):
        missed += delivery.deliver([stuck, reader], DATA)
        received += len(reading.recv(65536))
    assert time.monotonic() - begin < 2.0
    assert received == 1000 * len(DATA)
    assert 900 < missed < 1000


@pytest.mark.parametrize("seed", range(6))
def test_whatever_a_client_reads_and_when_it_gets_whole_messages_in_their_order(seed: int) -> None:
    """Messages of all lengths, those longer than any buffer among them."""
    rng, delivery = random.Random(seed), Delivery()
    connection, theirs = client()
    got, sent = b"", []
    for number in range(300):
        data = (
            struct.pack("<II", number, length := rng.choice((0, 8, 500, 9_000, LARGE))) + bytes([number % 251]) * length
        )
        if delivery.deliver([connection], data) == 0:
            sent.append(data)
        if rng.random() < 0.3:
            delivery.flush()
        if rng.random() < 0.7:
            got += waiting(theirs)
    for _ in range(100):
        got += waiting(theirs)
        delivery.flush()
    assert got == b"".join(sent)
    assert 20 < len(sent) < 300
    assert (connection.stat_num_msg, connection.stat_bytes) == (len(sent), len(got))
    theirs.close()
    connection.socket.close()


def test_long_messages_go_to_who_reads_past_who_does_not(two: list[tuple[SimpleNamespace, socket.socket]]) -> None:
    """A viewer on a suspended machine holds up nobody, also in the middle of a message."""
    (stuck, _), (reader, reading) = two
    delivery, received, longest, data = Delivery(), 0, 0.0, bytes(LARGE)

    def read() -> None:
        nonlocal received
        with suppress(OSError):
            while part := reading.recv(1 << 20):
                received += len(part)

    thread = threading.Thread(target=read)
    thread.start()
    for number in range(20):
        begin = time.monotonic()
        delivery.deliver([stuck, reader], data)
        longest = max(longest, time.monotonic() - begin)
        until(lambda number=number: delivery.flush() or reader.stat_num_msg > number, "the rest follows", every=1e-3)
    reader.socket.shutdown(socket.SHUT_RDWR)
    thread.join(10.0)
    assert received == reader.stat_bytes == 20 * LARGE
    assert stuck.stat_num_msg == 0 and 0 < stuck.stat_bytes < LARGE
    assert longest < 0.5, f"{longest:.3f} s; the stuck one may cost {AT_ONCE} s once"


@pytest.mark.parametrize("manner", ["close", "reset", "half", "shut"])
def test_a_client_that_dies_in_the_middle_of_a_message_is_given_up(
    manner: str, two: list[tuple[SimpleNamespace, socket.socket]]
) -> None:
    (gone, theirs), (reader, reading) = two
    delivery = Delivery()
    delivery.deliver([gone], bytes(LARGE))
    theirs.recv(1000)
    if manner == "half":
        theirs.shutdown(socket.SHUT_WR)  # it says no more, but may still read
        assert len(waiting(theirs)) > 0
    elif manner == "shut":
        theirs.shutdown(socket.SHUT_RDWR)
    else:
        if manner == "reset":
            theirs.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
        theirs.close()
    for _ in range(3):
        assert delivery.deliver([gone, reader], DATA) == (1 if manner == "half" else 0)
        assert reading.recv(len(DATA), socket.MSG_WAITALL) == DATA
    assert gone.closed is (manner != "half")
    assert bool(delivery._rests) is (manner == "half")


@pytest.mark.ros
def test_viewers_that_die_in_the_middle_of_a_picture_cost_the_others_none(node: Any) -> None:
    """Killed, half closed, suspended: the camera node goes on, and others get the newest picture."""
    from ligature.ros.cameras import _advertise
    from sensor_msgs.msg import Image

    from tests.ros.test_rude_clients import header

    topic, data = "/test_dying_viewers/ImageData", bytes(4_000_000)
    publisher, seen = _advertise(topic, Image), []
    good = node.Subscriber(topic, Image, lambda message: seen.append(int(message.height)), queue_size=1)
    _, _, (_, host, port) = ServerProxy(node.get_node_uri()).requestTopic("/viewer", topic, [["TCPROS"]])  # type: ignore[misc]
    viewers = [socket.create_connection((host, port)) for _ in range(4)]
    for name, viewer in enumerate(viewers):
        viewer.sendall(header({"topic": topic, "type": "*", "md5sum": "*", "callerid": f"/viewer{name}"}))
    until(lambda: publisher.get_num_connections() == 5, lambda: f"{publisher.get_num_connections()} of 5", 20.0)
    longest, number = 0.0, 0

    def show() -> None:
        nonlocal longest, number
        number, begin = number + 1, time.monotonic()
        publisher.publish(Image(height=number, data=data))
        longest = max(longest, time.monotonic() - begin)

    def sees(what: str) -> None:
        until(lambda: seen and seen[-1] == number, what, 10.0)

    show()
    sees("the first picture")
    assert all(len(viewer.recv(100_000)) > 0 for viewer in viewers)
    killed, closed, half, _suspended = viewers
    killed.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    killed.close()
    closed.close()
    half.shutdown(socket.SHUT_WR)
    for _ in range(6):
        show()
        sees(f"picture {number}")
    until(lambda: publisher.get_num_connections() <= 3, "who is gone is given up", 10.0)
    for viewer in viewers[2:]:
        viewer.close()
    show()
    until(lambda: publisher.get_num_connections() == 1, "one viewer is left", 10.0)
    sees("the last picture")
    assert longest < 1.0, f"publishing took {longest:.2f} s"
    good.unregister()
    publisher.unregister()
