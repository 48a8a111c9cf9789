"""Clients that die, fall silent or talk nonsense at any byte of what they say: nobody else notices.

They speak to the two ports of the simulator's node, that for topics and services and that for XML-RPC, and are spoken to
as publishers. What they say is made by a generator, from what a client says rightly.
"""

from __future__ import annotations

import random
import socket
import struct
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Any
from xmlrpc.client import ServerProxy, dumps

import pytest
from ligature.ros import handshakes
from ligature.ros.handshakes import SECONDS

from tests.ros.conftest import BIN, SMALL, Program
from tests.waiting import until

pytestmark = pytest.mark.ros
CLIENTS = 60
STATE, COMMAND, SERVICE = "/ambf/env/World/State", "/PSM1/servo_jp", "/PSM1/operating_state"
HEADS = (
    {"topic": STATE, "type": "*", "md5sum": "*", "callerid": "/rude"},
    {"topic": "/nobody", "type": "*", "md5sum": "*", "callerid": "/rude"},
    {"topic": STATE, "type": "std_msgs/String", "md5sum": "0" * 32, "callerid": "/rude"},
    {"service": SERVICE, "md5sum": "*", "callerid": "/rude", "persistent": "1"},
    {"service": SERVICE, "md5sum": "*", "callerid": "/rude", "probe": "1"},
    {"topic": STATE},
    {},
)


def framed(data: bytes) -> bytes:
    return struct.pack("<I", len(data)) + data


def header(fields: dict[str, str]) -> bytes:
    """What begins a connection for topics or services."""
    return framed(b"".join(framed(f"{key}={value}".encode()) for key, value in fields.items()))


def damaged(data: bytes, rng: random.Random) -> bytes:
    """What a client says before it dies: all of it, a part, with other bytes, with lengths that are not its own."""
    kind = rng.randrange(5)
    if kind == 0:
        return data
    if kind == 1:
        return data[: rng.randrange(len(data) + 1)]
    if kind == 2:
        return rng.randbytes(rng.choice((1, 3, 4, 9, 200, 5000)))
    if kind == 3:
        return struct.pack("<I", rng.choice((0, 1, 1 << 16, 1 << 31, (1 << 32) - 1))) + data[4:]
    at = rng.randrange(len(data))
    return data[:at] + rng.randbytes(rng.randrange(1, 9)) + data[at:]


def call(rng: random.Random) -> bytes:
    """A request of XML-RPC, of a method that a node has, with arguments that it may not have."""
    method, right = rng.choice((
        ("publisherUpdate", ("/rude", COMMAND, ["http://127.0.0.1:1/", "nowhere", ""])),
        ("requestTopic", ("/rude", STATE, [["TCPROS"]])), ("requestTopic", ("/rude", STATE, [["UDPROS", "x"], []])),
        ("paramUpdate", ("/rude", "/ambf", {"a": [1, {}]})), ("getBusInfo", ("/rude",)), ("getPid", ()), ("nothing", (1,)),
    ))  # fmt: skip
    arguments = right if rng.random() < 0.5 else tuple(rng.choice(("", -1, [], {}, "x" * 5000)) for _ in range(3))
    body = dumps(arguments, method).encode()
    length = len(body) if rng.random() < 0.7 else rng.choice((-1, 0, 10, 1 << 40))
    return b"POST /RPC2 HTTP/1.0\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n\r\n%s" % (length, body)


def leave(client: socket.socket, rng: random.Random, kept: list[socket.socket]) -> None:
    """End a connection as a program does that ends, is killed with bytes unread, or stops and does nothing more."""
    manner = rng.randrange(3)
    if manner == 0:
        kept.append(client)
        return
    if manner == 1:
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()


class RudePublisher:
    """A publisher that the master knows, whose every connection says something else and ends."""

    def __init__(self, rng: random.Random, right: bytes) -> None:
        self._rng, self._right, self.met = rng, right, 0
        self.server = socket.create_server(("127.0.0.1", 0))
        self.kept: list[socket.socket] = []
        threading.Thread(target=self._serve, daemon=True).start()

    def _serve(self) -> None:
        with suppress(OSError):
            while True:
                client, _ = self.server.accept()
                self.met += 1
                with suppress(OSError):
                    client.sendall(damaged(self._right, self._rng))
                leave(client, self._rng, self.kept)


@pytest.fixture(scope="module")
def simulator(start: Callable[..., Program], node: Any) -> Program:
    program = start(BIN / "ligature", "run", SMALL, "-p", "200", "--no-cameras")
    program.wait_for("first state published", 300.0)
    return program


@pytest.fixture(scope="module")
def ports(simulator: Program, ros_env: dict[str, str]) -> tuple[int, int]:
    """Of topics and services, and of XML-RPC."""
    code, _, uri = ServerProxy(ros_env["ROS_MASTER_URI"]).lookupNode("/test", "/ligature")  # type: ignore[misc]
    assert code == 1
    _, _, (_, _, port) = ServerProxy(str(uri)).requestTopic("/test", STATE, [["TCPROS"]])  # type: ignore[misc]
    return int(port), int(str(uri).rstrip("/").rpartition(":")[2])


@pytest.fixture
def kept() -> Iterator[list[socket.socket]]:
    """Connections that stay open, silent, till the end of the test."""
    sockets: list[socket.socket] = []
    yield sockets
    for one in sockets:
        one.close()


def threads(program: Program) -> int:
    return len(list(Path(f"/proc/{program.children()['ros_process']}/task").iterdir()))


def served(node: Any, ports: tuple[int, int]) -> None:
    """Somebody else gets messages and answers within a moment."""
    from crtk_msgs.msg import OperatingState

    for topic in ("/PSM1/operating_state", "/PSM2/operating_state"):
        assert node.wait_for_message(topic, OperatingState, 10.0)
    with socket.create_connection(("127.0.0.1", ports[0]), timeout=10.0) as client:
        client.sendall(header(HEADS[0]))
        assert len(client.recv(4, socket.MSG_WAITALL)) == 4, "nobody answers a new connection"


@pytest.mark.parametrize("seed", range(2))
def test_clients_that_die_or_talk_nonsense_stop_nobody_else(
    seed: int, simulator: Program, ports: tuple[int, int], kept: list[socket.socket], node: Any
) -> None:
    rng, pids, before = random.Random(seed), simulator.children(), threads(simulator)
    for number in range(CLIENTS):
        data = call(rng) if number % 3 == 0 else header(rng.choice(HEADS)) + framed(rng.randbytes(rng.randrange(40)))
        client = socket.create_connection(("127.0.0.1", ports[number % 3 == 0]), timeout=5.0)
        with suppress(OSError):
            client.sendall(damaged(data, rng))
        leave(client, rng, kept)
        if number % 20 == 19:
            served(node, ports)
    for one in kept:
        one.close()
    kept.clear()
    until(lambda: threads(simulator) <= before + 3, lambda: f"{threads(simulator)} threads, not {before}", 30.0)
    assert simulator.children() == pids, simulator.output
    assert "Traceback" not in simulator.output, simulator.output


def test_a_subscriber_may_read_slowly_what_a_latched_topic_holds(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its introduction is over; only those who introduce themselves slowly, at any byte, are closed."""
    monkeypatch.setattr(handshakes, "SECONDS", 0.3)
    spoken_first, large = header(HEADS[0]), b"x" * 4_000_000

    def answer(client: socket.socket, address: Any) -> None:
        assert client.recv(len(spoken_first), socket.MSG_WAITALL) == spoken_first
        client.sendall(large)
        client.close()

    for spoken in (len(spoken_first), len(spoken_first) - 1, 5, 3):
        ours, theirs = socket.socketpair()
        handshakes.apart(answer)(theirs, None)
        ours.sendall(spoken_first[:spoken])
        time.sleep(1.0)
        read = 0
        with suppress(ConnectionResetError):
            while part := ours.recv(1 << 20):
                read += len(part)
        assert read == (len(large) if spoken == len(spoken_first) else 0)
        ours.close()


def test_every_node_of_ours_is_guarded() -> None:
    """Only `start_node` and the drop-in client, which takes what `ambf_client` takes, begin nodes of rospy."""
    source = Path(handshakes.__file__).parents[1]
    begins = {str(file.relative_to(source)) for file in source.rglob("*.py") if "rospy.init_node(" in file.read_text()}
    assert begins == {"ros/start.py", "client/layer.py"}


def test_connections_that_stay_silent_are_closed(ports: tuple[int, int]) -> None:
    begin = time.monotonic()
    clients = [socket.create_connection(("127.0.0.1", ports[0]), timeout=SECONDS + 10.0) for _ in range(3)]
    for client, data in zip(clients, (b"", b"\x10", header(HEADS[0])[:-1]), strict=True):
        client.sendall(data)
    for client in clients:
        assert client.recv(1) == b""
        client.close()
    assert time.monotonic() - begin < SECONDS + 5.0


def test_many_silent_connections_take_turns_and_threads_that_cannot_start_end_nothing(
    monkeypatch: pytest.MonkeyPatch, kept: list[socket.socket]
) -> None:
    monkeypatch.setattr(handshakes, "SECONDS", 0.2)
    monkeypatch.setattr(handshakes, "MOST_AT_ONCE", 3)
    served: list[int] = []
    take = handshakes.apart(lambda client, address: served.append(address))

    def connect(address: int, data: bytes) -> None:
        here, there = socket.socketpair()
        kept.extend((here, there))
        here.sendall(data)
        take(there, address)

    def shaking() -> int:
        return sum(thread.name == "handshake" for thread in threading.enumerate())

    others = shaking()
    for number in range(8):
        connect(number, b"")
        assert shaking() - others <= 3
    connect(8, framed(b"a client"))
    until(lambda: served == [8], "a client after silent ones is served", 5.0)

    def fail(thread: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    with monkeypatch.context() as patch:
        patch.setattr(threading.Thread, "start", fail)
        for number in range(4):
            connect(number, framed(b"a client"))
    connect(9, framed(b"a client"))
    until(lambda: served == [8, 9], "a client is served when threads start again", 5.0)


def test_publishers_that_die_or_talk_nonsense_leave_the_arm_to_others(
    simulator: Program, ros_env: dict[str, str], node: Any
) -> None:
    from tests.ros.test_flood import answers

    pids, rng = simulator.children(), random.Random(5)
    right = header({"type": "sensor_msgs/JointState", "md5sum": "*", "callerid": "/rude"}) + framed(bytes(30)) * 3
    publishers = [RudePublisher(rng, right) for _ in range(6)]
    rpc = [_slave(one) for one in publishers]
    master = ServerProxy(ros_env["ROS_MASTER_URI"])
    for number, uri in enumerate(rpc):
        master.registerPublisher(f"/rude{number}", COMMAND, "sensor_msgs/JointState", uri)
    try:
        until(lambda: all(one.met for one in publishers), lambda: str([one.met for one in publishers]), 20.0)
        answers(node, "PSM1")
    finally:
        for number, uri in enumerate(rpc):
            master.unregisterPublisher(f"/rude{number}", COMMAND, uri)
        for one in publishers:
            one.server.close()
            for client in one.kept:
                client.close()
    assert simulator.children() == pids, simulator.output
    assert "Traceback" not in simulator.output, simulator.output


def _slave(publisher: RudePublisher) -> str:
    """Address of an XML-RPC server that sends subscribers to a publisher."""
    from xmlrpc.server import SimpleXMLRPCServer

    server = SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False, allow_none=True)
    port = publisher.server.getsockname()[1]
    server.register_function(lambda *_: [1, "", ["TCPROS", "127.0.0.1", port]], "requestTopic")
    threading.Thread(target=server.serve_forever, daemon=True).start()
    return f"http://127.0.0.1:{server.server_address[1]}/"
