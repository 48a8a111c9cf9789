"""Wrong tokens cost time and a line on the terminal; crowds of browsers that never read are kept out."""

from __future__ import annotations

import socket
import threading
import time
from collections.abc import Iterator
from contextlib import closing
from http.client import HTTPConnection
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.cockpit.address import Address
from ligature.cockpit.gate import MOST_CONNECTIONS, Gate
from ligature.cockpit.guesses import FIRST_PAUSE, FORGET, FREE, LONGEST_PAUSE, MOST_ADDRESSES, REPORT_PAUSE, Guesses
from ligature.cockpit.page import serve

from tests.waiting import until

TOKEN = "correct horse battery"

AT_A_TIME = 100
"""Tokens that are shown together: each that is looked at holds up whoever shows it for `LONGEST_PAUSE`."""


@given(st.lists(st.floats(0.0, 3.0), min_size=10, max_size=300))
def test_however_tokens_are_timed_few_are_looked_at(pauses: list[float]) -> None:
    """Of tokens at any times, those that are looked at come in no faster than the pauses allow."""
    lines: list[str] = []
    guesses, now, looked = Guesses(lines.append), 1000.0, []
    for pause in pauses:
        now += pause
        wait = guesses.wait("10.0.0.1", now)
        if wait is not None:
            assert 0.0 <= wait <= LONGEST_PAUSE
            looked.append(now + wait)
            guesses.wrong("10.0.0.1", now)
    assert looked == sorted(looked)
    gaps = [b - a for a, b in zip(looked[FREE:], looked[FREE + 1 :], strict=False)]
    assert all(gap >= FIRST_PAUSE - 1e-9 for gap in gaps)
    assert all(gap >= LONGEST_PAUSE - 1e-9 for gap in gaps[6:])
    assert len(lines) <= 1 + (now - 1000.0) / REPORT_PAUSE
    assert all("wrong token" in line and "10.0.0.1" in line for line in lines) and lines


def test_an_address_pays_for_itself_alone_and_not_for_ever() -> None:
    guesses = Guesses(lambda _: None)
    for _ in range(20):
        guesses.wrong("10.0.0.1", 100.0)
    assert guesses.wait("10.0.0.2", 100.0) == 0.0
    assert guesses.wait("10.0.0.1", 100.0) != 0.0
    assert guesses.wait("10.0.0.1", 101.0 + FORGET + LONGEST_PAUSE) == 0.0


def test_what_is_remembered_is_bounded() -> None:
    guesses = Guesses(lambda _: None)
    for number in range(3 * MOST_ADDRESSES):
        guesses.wrong(f"10.0.{number // 256}.{number % 256}", float(number))
    assert len(guesses._callers) == MOST_ADDRESSES


@pytest.fixture
def lines() -> list[str]:
    return []


@pytest.fixture
def port(lines: list[str]) -> Iterator[int]:
    """A page behind a token."""
    address = Address("127.0.0.1", 0)
    server = serve(address, Gate(address, TOKEN, lines.append))
    yield server.get_port()
    server.stop()


def status(port: int, token: str) -> int:
    with closing(HTTPConnection("127.0.0.1", port, timeout=30)) as connection:
        connection.request("GET", f"/?token={token}", headers={"Host": f"127.0.0.1:{port}"})
        return connection.getresponse().status


def test_two_hundred_wrong_tokens_are_slowed_down_and_reported(port: int, lines: list[str]) -> None:
    """The probe: 200 in 7 s, as many as possible at a time; no more than a dozen are looked at."""
    found: list[int] = []
    begin = time.monotonic()

    def guess(first: int) -> None:
        for number in range(first, 200, AT_A_TIME):
            found.append(status(port, f"guess{number}"))

    threads = [threading.Thread(target=guess, args=(first,)) for first in range(AT_A_TIME)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    took = time.monotonic() - begin
    looked_at = found.count(403)
    assert len(found) == 200 and set(found) == {403, 429}
    assert looked_at <= FREE + 1 + took / FIRST_PAUSE, f"{looked_at} of 200 tokens were looked at in {took:.1f} s"
    assert lines and all(line.startswith("cockpit: ") and "127.0.0.1" in line for line in lines)
    until(lambda: status(port, TOKEN.replace(" ", "+")) == 303, "the right token opens the page later", 60.0)


def megabytes() -> float:
    """Megabytes of this process that are in use."""
    text = Path("/proc/self/status").read_text()
    return int(text.split("VmRSS:")[1].split()[0]) / 1024


def test_five_hundred_browsers_that_never_read_hold_little_and_slow_nobody() -> None:
    import viser

    address, lines = Address("127.0.0.1", 0), []
    server = serve(address, Gate(address, "", lines.append))
    for number in range(20):  # a page as large as the real one
        server.scene.add_mesh_simple(
            f"/mesh{number}",
            vertices=np.random.default_rng(number).random((3000, 3)),
            faces=np.array([[0, 1, 2]] * 1000),
        )
    port = server.get_port()
    before, sockets = megabytes(), []
    request = (
        f"GET / HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        "Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Version: 13\r\n"
        f"Sec-WebSocket-Protocol: viser-v{viser.__version__}\r\n\r\n"
    ).encode()
    try:
        for _ in range(500):
            one = socket.create_connection(("127.0.0.1", port), timeout=30)
            one.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
            one.sendall(request)
            sockets.append(one)
        until(lambda: lines, "the terminal says that there are too many", 30.0)
        slowest = 0.0
        for _ in range(10):
            begin = time.monotonic()
            with closing(HTTPConnection("127.0.0.1", port, timeout=30)) as connection:
                connection.request("GET", "/", headers={"Host": f"127.0.0.1:{port}"})
                connection.getresponse().read()
            slowest = max(slowest, time.monotonic() - begin)
        held = megabytes() - before
        assert f"{MOST_CONNECTIONS} connections are open" in lines[0]
        assert held < 120.0, f"{held:.0f} MB are held"
        assert slowest < 3.0, f"{slowest:.1f} s for an answer"
    finally:
        for one in sockets:
            one.close()
        server.stop()
