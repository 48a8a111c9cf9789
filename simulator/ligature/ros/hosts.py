"""Where the hosts of ROS addresses are; needs no ROS."""

from __future__ import annotations

import socket
from typing import Any

Place = tuple[int, Any]
"""Family and socket address."""


def places(host: str, family: int = 0) -> list[Place]:
    """Where a host is, in one ``family`` of addresses or in all; nowhere for one that is unknown."""
    try:
        found = socket.getaddrinfo(host, 0, family, socket.SOCK_STREAM)
    except (OSError, ValueError):  # a text that no host can have, too
        return []
    return [(own, place) for own, _, _, _, place in found]


def is_here(where: Place) -> bool:
    """Whether it is an address of this machine: only then a socket can be bound to it."""
    family, place = where
    try:
        with socket.socket(family, socket.SOCK_STREAM) as probe:
            probe.bind(place)
    except OSError:
        return False
    return True
