"""Where the page may be served, and with which token."""

from __future__ import annotations

import socket

import pytest
from ligature.cli.main import app
from ligature.cockpit.address import Address, AddressError, check_free, check_token, read_address
from typer.testing import CliRunner


def test_addresses_are_read() -> None:
    assert read_address("127.0.0.1:8080") == Address("127.0.0.1", 8080)
    assert read_address("[::1]:99") == Address("::1", 99)
    assert read_address("[::1]:99").url == "http://[::1]:99"


@pytest.mark.parametrize("text", ["8080", "localhost", ":8080", "host:", "host:99999", "host:8a"])
def test_what_is_no_address_is_reported(text: str) -> None:
    with pytest.raises(AddressError, match="is not ADDRESS:PORT; write for example 127.0.0.1:8080"):
        read_address(text)


def test_only_this_machine_needs_no_token() -> None:
    for host in ("localhost", "127.0.0.1", "127.1.2.3", "::1"):
        check_token(Address(host, 1), "")
    for host in ("0.0.0.0", "::", "192.168.0.7", "example.org"):
        with pytest.raises(AddressError, match="set a token of at least 12 characters in LIGATURE_COCKPIT_TOKEN"):
            check_token(Address(host, 1), "")
        check_token(Address(host, 1), "twelve chars")


def test_a_short_token_is_refused_everywhere() -> None:
    with pytest.raises(AddressError, match="has 5 characters; it must have at least 12"):
        check_token(Address("127.0.0.1", 1), "short")


def test_a_taken_port_is_reported() -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", 0))
        other.listen()
        with pytest.raises(AddressError, match="cannot serve the cockpit at 127.0.0.1:.*: Address already in use"):
            check_free(Address("127.0.0.1", other.getsockname()[1]))


@pytest.mark.parametrize("host", ["..", "x" * 70, "no such host"])
def test_what_is_no_host_is_reported(host: str) -> None:
    with pytest.raises(AddressError, match="cannot serve the cockpit at .*; choose another ADDRESS:PORT"):
        check_free(Address(host, 0))


@pytest.mark.parametrize(
    "command", [["cockpit", "x.yaml", "--at", "0.0.0.0:8080"], ["run", "x.yaml", "--cockpit-at", "0.0.0.0:8080"]]
)
def test_the_command_does_not_start_without_the_token(command: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("LIGATURE_COCKPIT_TOKEN", raising=False)
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 2
    assert "LIGATURE_COCKPIT_TOKEN" in result.output
