"""Where the page is served, and when it may be: beyond this machine only with a token."""

from __future__ import annotations

import ipaddress
import socket
from dataclasses import dataclass

DEFAULT = "127.0.0.1:8080"

TOKEN_VARIABLE = "LIGATURE_COCKPIT_TOKEN"
"""Environment variable of the token: a command line can be read by everybody on a machine."""

LEAST_TOKEN = 12
"""Fewest characters of a token."""


class AddressError(ValueError):
    """An address that cannot be served; the message gives what would be right."""


@dataclass(frozen=True)
class Address:
    """A host and a port; port 0 is any free one."""

    host: str
    port: int

    @property
    def loopback(self) -> bool:
        """Whether only this machine can reach it."""
        if self.host == "localhost":
            return True
        try:
            return ipaddress.ip_address(self.host).is_loopback
        except ValueError:
            return False

    @property
    def url(self) -> str:
        """What to open in a browser."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"http://{host}:{self.port}"


def read_address(text: str) -> Address:
    """The address of ``HOST:PORT`` or ``[IPV6]:PORT``; raises `AddressError`."""
    host, colon, port = text.rpartition(":")
    host = host.removeprefix("[").removesuffix("]")
    if not colon or not host or not port.isdecimal() or int(port) > 65535:
        raise AddressError(f"'{text}' is not ADDRESS:PORT; write for example {DEFAULT}")
    return Address(host, int(port))


def check_token(address: Address, token: str) -> None:
    """Raise `AddressError` for an address that others can reach without a token, or with one that is too short."""
    if token and len(token) < LEAST_TOKEN:
        raise AddressError(f"the cockpit's token has {len(token)} characters; it must have at least {LEAST_TOKEN}")
    if not token and not address.loopback:
        raise AddressError(
            f"the cockpit at {address.host} is reachable from other machines: "
            f"set a token of at least {LEAST_TOKEN} characters in {TOKEN_VARIABLE}, or serve 127.0.0.1"
        )


def check_free(address: Address) -> None:
    """Raise `AddressError` when nothing can be served there."""
    try:
        family, kind, protocol, _, place = socket.getaddrinfo(address.host, address.port, type=socket.SOCK_STREAM)[0]
        with socket.socket(family, kind, protocol) as probe:
            probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
            probe.bind(place)
    except (OSError, UnicodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "not the name of a machine"
        raise AddressError(
            f"cannot serve the cockpit at {address.host}:{address.port}: {why}; choose another ADDRESS:PORT"
        ) from error
