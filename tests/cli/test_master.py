"""Whether a ROS master answers, and what is printed where none can be started."""

from __future__ import annotations

import socket
import threading
import time
import xmlrpc.server
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.cli import master


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    """A program that listens and never answers."""
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        yield taken


def test_a_master_that_answers_is_found() -> None:
    server = xmlrpc.server.SimpleXMLRPCServer(("127.0.0.1", 0), logRequests=False)
    server.register_function(lambda caller: (1, "", 42), "getPid")
    thread = threading.Thread(target=server.handle_request)
    thread.start()
    assert master.master_answers(f"http://127.0.0.1:{server.server_address[1]}")
    thread.join()
    server.server_close()


def test_nobody_is_no_master() -> None:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        assert not master.master_answers(f"http://127.0.0.1:{probe.getsockname()[1]}")


def test_a_program_that_never_answers_is_given_up_soon(listener: socket.socket) -> None:
    begin = time.monotonic()
    assert not master.master_answers(f"http://127.0.0.1:{listener.getsockname()[1]}")
    assert time.monotonic() - begin < 2 * master.ANSWER_TIMEOUT + 0.5


def test_a_taken_port_is_reported(listener: socket.socket) -> None:
    port = listener.getsockname()[1]
    assert master.obstacle(f"http://localhost:{port}") == (
        f"another program, not a ROS master, uses port {port}; set ROS_MASTER_URI to a free port"
    )


@pytest.mark.parametrize("uri", [
    "foo", "http://", "http://localhost:notaport", "http://localhost:99999", "ftp://a:1", "http://[::1:11311",
    "http://localhost:0", "http://localhost: 11311", "http://localhost:11311\n",
])  # fmt: skip
def test_a_text_that_is_no_address_is_reported(uri: str) -> None:
    assert not master.master_answers(uri)
    assert master.obstacle(uri) == f"ROS_MASTER_URI '{uri}' is not an address; write one such as http://127.0.0.1:11311"


@given(st.text("[]/:0@.#?\n\udcff\0", max_size=12))
def test_whatever_the_address_is_a_master_can_be_started_there_or_not(text: str) -> None:
    problem = master.obstacle(f"http://{text}")
    if not problem:
        assert master.command(f"http://{text}")[-1].isdecimal()


def test_a_master_elsewhere_is_not_started_here() -> None:
    assert master.obstacle("http://192.0.2.1:11311") == (
        "the ROS master at http://192.0.2.1:11311 does not answer, and '192.0.2.1' is not this machine"
    )


def test_a_missing_rosmaster_names_its_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(master.shutil, "which", lambda _: None)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    assert "Debian package python3-rosmaster" in master.obstacle(f"http://127.0.0.1:{port}")
