"""Nothing is shown before the token is, and pages of other sites are kept out."""

from __future__ import annotations

from collections.abc import Iterator
from http.client import HTTPConnection
from typing import Any

import pytest
import viser
from ligature.cockpit.address import Address
from ligature.cockpit.gate import COOKIE, Gate
from ligature.cockpit.page import serve
from websockets.exceptions import InvalidStatus
from websockets.sync.client import connect
from websockets.typing import Subprotocol

from tests.cockpit.conftest import Person, somebody

TOKEN = "correct horse battery"
SECRET = "a word that only the page shows"


@pytest.fixture(scope="module")
def port() -> Iterator[int]:
    """A page behind a token."""
    server = serve(Address("127.0.0.1", 0), Gate(Address("127.0.0.1", 0), TOKEN))
    server.gui.add_html(SECRET)
    yield server.get_port()
    server.stop()


@pytest.fixture(scope="module")
def open_port() -> Iterator[int]:
    """A page on loopback, without a token."""
    server = serve(Address("127.0.0.1", 0), Gate(Address("127.0.0.1", 0), ""))
    yield server.get_port()
    server.stop()


def get(port: int, path: str = "/", **headers: str) -> tuple[int, str, dict[str, str]]:
    connection = HTTPConnection("127.0.0.1", port, timeout=30)
    connection.request("GET", path, headers={"Host": f"127.0.0.1:{port}", **headers})
    answer = connection.getresponse()
    return answer.status, answer.read().decode("utf-8", "replace"), dict(answer.getheaders())


def talk(port: int, **headers: str) -> Any:
    protocol = Subprotocol(f"viser-v{viser.__version__}")
    return connect(f"ws://127.0.0.1:{port}", subprotocols=[protocol], additional_headers=headers, max_size=None)


def test_without_the_token_there_is_a_field_for_it_and_nothing_else(port: int) -> None:
    status, text, _ = get(port)
    assert status == 401
    assert "needs the token" in text
    assert "viser" not in text


@pytest.mark.parametrize(
    "path", ["/?token=wrong", "/?token=", "/?token=correct%20horse%20batter", "/index.html?token=%00"]
)
def test_a_wrong_token_is_refused(port: int, path: str) -> None:
    status, text, headers = get(port, path)
    assert status in (401, 403)
    assert "viser" not in text
    assert "Set-Cookie" not in headers


@pytest.mark.parametrize("cookie", ["", f"{COOKIE}=", f"{COOKIE}=0123", "\u00e9=;;", f"{COOKIE}={TOKEN}"])
def test_no_connection_is_made_without_the_pass(port: int, cookie: str) -> None:
    with pytest.raises(InvalidStatus, match="HTTP 401"):
        talk(port, Cookie=cookie.encode("ascii", "ignore").decode())


def test_the_right_token_gives_a_pass_that_no_script_can_read(port: int) -> None:
    status, _, headers = get(port, "/?token=correct+horse+battery")
    assert (status, headers["Location"]) == (303, "/")
    assert "HttpOnly" in headers["Set-Cookie"] and "SameSite=Strict" in headers["Set-Cookie"]
    passed = headers["Set-Cookie"].partition(";")[0]
    assert TOKEN not in passed
    status, text, _ = get(port, Cookie=passed)
    assert status == 200
    assert "<html" in text
    with talk(port, Cookie=passed) as connection:
        assert connection.recv(timeout=30)


def test_pages_of_other_sites_are_kept_out(port: int, open_port: int) -> None:
    passed = get(port, "/?token=correct+horse+battery")[2]["Set-Cookie"].partition(";")[0]
    with pytest.raises(InvalidStatus, match="HTTP 403"):
        talk(port, Cookie=passed, Origin="http://evil.example")
    with pytest.raises(InvalidStatus, match="HTTP 403"):
        talk(open_port, Origin="http://evil.example")
    with talk(open_port, Origin=f"http://127.0.0.1:{open_port}") as connection:
        assert connection.recv(timeout=30)


def test_a_name_that_was_bent_to_this_machine_is_refused(open_port: int) -> None:
    status, text, _ = get(open_port, Host=f"evil.example:{open_port}")
    assert status == 403
    assert "is not a name of this machine" in text
    assert get(open_port, Host=f"localhost:{open_port}")[0] == 200


def test_a_person_with_the_wrong_token_sees_nothing_and_with_the_right_one_all(port: int) -> None:
    with somebody() as person:
        look_in(person, port)


def look_in(person: Person, port: int) -> None:
    person.driver.get(f"http://127.0.0.1:{port}/")
    field = person.find("//input[@name='token']")
    field.send_keys("guess of a stranger")
    field.submit()
    person.sees("The token is wrong")
    assert SECRET not in person.driver.page_source
    field = person.find("//input[@name='token']")
    field.send_keys(TOKEN)
    field.submit()
    person.sees(SECRET)
    assert TOKEN not in person.driver.current_url
