"""The ROS master of a run: whether one answers at an address, and whether and how one can be started there."""

from __future__ import annotations

import errno
import re
import shutil
import socket
import xmlrpc.client
from http.client import HTTPConnection, HTTPException
from urllib.parse import urlparse

from ligature.ros.hosts import is_here, places

DEFAULT_MASTER = "http://127.0.0.1:11311"
DEFAULT_PORT = 11311
ANSWER_TIMEOUT = 1.0
"""Seconds that a master is given to answer."""


class _Transport(xmlrpc.client.Transport):
    """A transport with a timeout, for programs that accept a connection and never answer."""

    def make_connection(self, host: object) -> HTTPConnection:
        connection = super().make_connection(host)  # type: ignore[arg-type]
        connection.timeout = ANSWER_TIMEOUT
        return connection


def master_answers(uri: str) -> bool:
    """Whether a ROS master answers at ``uri`` within `ANSWER_TIMEOUT`."""
    try:
        code, _, _ = xmlrpc.client.ServerProxy(uri, _Transport()).getPid("/ligature")  # type: ignore[misc]
    except (OSError, HTTPException, xmlrpc.client.Error, ValueError, TypeError):
        return False
    return bool(code == 1)


def obstacle(uri: str) -> str:
    """Why no master can be started for ``uri``; empty when nothing stands in the way."""
    host, port = _address(uri)
    if not host or not port:
        return f"ROS_MASTER_URI '{uri}' is not an address; write one such as {DEFAULT_MASTER}"
    if not any(map(is_here, places(host, socket.AF_INET))):
        return f"the ROS master at {uri} does not answer, and '{host}' is not this machine"
    if _taken(port):
        return f"another program, not a ROS master, uses port {port}; set ROS_MASTER_URI to a free port"
    if shutil.which("rosmaster") is None:
        return "the program 'rosmaster' is missing; install the Debian package python3-rosmaster"
    return ""


def command(uri: str) -> list[str]:
    """The command that serves ``uri``, which has no `obstacle`."""
    return [shutil.which("rosmaster") or "rosmaster", "--core", "-p", str(_address(uri)[1])]


def _address(uri: str) -> tuple[str, int]:
    """Host and port of an address; an empty host or port 0 where it is none."""
    try:
        where = urlparse(uri)
        host, port = where.hostname or "", DEFAULT_PORT if where.port is None else where.port
    except ValueError:  # brackets without an address, a port that is no number
        return "", 0
    return (host, port) if where.scheme == "http" and not re.search(r"\s", uri) else ("", 0)


def _taken(port: int) -> bool:
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("", port))
        except OSError as error:
            return error.errno == errno.EADDRINUSE
    return False
