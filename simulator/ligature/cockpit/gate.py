"""The gate before the page: nothing is shown, and no connection made, without the token.

A browser shows the token once, in the address, and is given a cookie for it. Pages of other sites are kept out also
where there is no token: they could reach a loopback address through the browser of whoever visits them.
"""

from __future__ import annotations

import asyncio
import hashlib
import hmac
import http
import inspect
import math
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from html import escape
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlsplit

import websockets.asyncio.server
from websockets.asyncio.server import ServerConnection
from websockets.datastructures import Headers
from websockets.http11 import Request, Response

from ligature.cockpit.address import Address
from ligature.cockpit.assets import asset
from ligature.cockpit.guesses import REPORT_PAUSE, Guesses
from ligature.cockpit.intake import MOST_BYTES, careful
from ligature.cockpit.wire import PATH, Wire

COOKIE = "ligature_cockpit"
PARAMETER = "token"

HEADERS = {
    "Content-Security-Policy": "frame-ancestors 'none'",
    "X-Frame-Options": "DENY",
    "X-Content-Type-Options": "nosniff",
    "Referrer-Policy": "no-referrer",
    "Permissions-Policy": "camera=(), microphone=(), geolocation=()",
}
"""Of every answer: no other page shows this one in a frame, and the token in the address goes to nobody else."""

MOST_PATH = 2000
"""Most characters of the path of a request."""

MOST_CONNECTIONS = 128
"""Most connections at a time, two of each browser; one that never reads holds half a megabyte until it is given up."""

_PAGE = """<!doctype html><html lang="en"><meta charset="utf-8"><title>Ligature cockpit</title>
<body style="font-family: sans-serif; background: #1a1b1e; color: #c1c2c5; text-align: center; padding-top: 20vh">
<h2>Ligature cockpit</h2><p id="why">{why}</p>
<form><input name="token" type="password" placeholder="token" autofocus> <button>Enter</button></form></body></html>"""


class Gate:
    """Decides about every request to ``address`` before anything else sees it; no ``token`` (empty) asks for none.

    ``log`` receives lines for the terminal.
    """

    def __init__(self, address: Address, token: str, log: Callable[[str], None] = lambda _: None) -> None:
        self._token, self._log = token, log
        self._guesses = Guesses(log)
        self.connections = 0
        self._crowded = -math.inf
        self._local = address.loopback and not token
        self._pass = hmac.new(token.encode(), COOKIE.encode(), hashlib.sha256).hexdigest()
        self.rejected = 0

    async def decide(self, request: Request, who: str) -> Response | None:
        """The answer to a request of address ``who``, after the time that wrong tokens cost it."""
        if self._token and _shown(request):
            wait = self._guesses.wait(who, time.monotonic())
            if wait is None:
                self.rejected += 1
                return _refusal(http.HTTPStatus.TOO_MANY_REQUESTS, "Too many wrong tokens. Wait, then try again.")
            if wait:  # else nobody else is decided about before this token counts
                await asyncio.sleep(wait)
        found = self.answer(request, who)
        if found is None and self.connections >= MOST_CONNECTIONS:
            self.complain()
            return _refusal(http.HTTPStatus.SERVICE_UNAVAILABLE, "Too many browsers are connected.")
        return found

    def complain(self) -> None:
        """Count a connection that was too many, and report it now and then."""
        self.rejected += 1
        now = time.monotonic()
        if now - self._crowded > REPORT_PAUSE:
            self._crowded = now
            self._log(f"cockpit: {MOST_CONNECTIONS} connections are open; further ones are rejected")

    def answer(self, request: Request, who: str = "") -> Response | None:
        """The response that ends a request of address ``who`` here; None lets it in."""
        found = self._answer(request, who)
        if found is not None and found.status_code >= http.HTTPStatus.BAD_REQUEST:
            self.rejected += 1
        return found

    def _answer(self, request: Request, who: str) -> Response | None:
        hosts = request.headers.get_all("Host")
        if len(hosts) != 1 or len(request.path) > MOST_PATH:
            return _refusal(http.HTTPStatus.BAD_REQUEST, "A request must name one host and have a short address.")
        (host,) = hosts
        if self._local and not _names_this_machine(host):
            return _refusal(http.HTTPStatus.FORBIDDEN, f"'{host}' is not a name of this machine.")
        origin = request.headers.get("Origin")
        if origin is not None and _authority(origin) != host:
            return _refusal(http.HTTPStatus.FORBIDDEN, "Requests from other sites are rejected.")
        if not self._token or self._has_pass(request.headers):
            return None
        shown = _shown(request)
        if not shown:
            return _refusal(http.HTTPStatus.UNAUTHORIZED, "This page needs the token of the cockpit.")
        if not hmac.compare_digest(shown.encode("utf-8", "replace"), self._token.encode()):
            self._guesses.wrong(who, time.monotonic())
            return _refusal(http.HTTPStatus.FORBIDDEN, "The token is wrong.")
        headers = Headers({"Location": "/", "Set-Cookie": f"{COOKIE}={self._pass}; HttpOnly; SameSite=Strict; Path=/"})
        return Response(http.HTTPStatus.SEE_OTHER, "See Other", headers, b"")

    def _has_pass(self, headers: Headers) -> bool:
        try:
            cookies = SimpleCookie("; ".join(headers.get_all("Cookie")))
        except CookieError:
            return False
        return COOKIE in cookies and hmac.compare_digest(cookies[COOKIE].value.encode(), self._pass.encode())


def _shown(request: Request) -> str:
    """The token in the address of a request, or an empty text."""
    return parse_qs(request.path.partition("?")[2]).get(PARAMETER, [""])[0]


def _names_this_machine(host: str) -> bool:
    try:
        name = urlsplit(f"//{host}").hostname or ""
    except ValueError:  # as "[::1", which never closes
        return False
    return Address(name, 0).loopback


def _authority(origin: str) -> str | None:
    try:
        return urlsplit(origin).netloc
    except ValueError:
        return None


def _refusal(status: http.HTTPStatus, why: str) -> Response:
    body = _PAGE.format(why=escape(why)).encode()
    headers = Headers(
        {"Content-Type": "text/html; charset=utf-8", "Content-Length": str(len(body)), "Cache-Control": "no-store"}
    )
    return Response(status, status.phrase, headers, body)


def _path(connection: Any) -> str:
    return "" if connection.request is None else str(connection.request.path.partition("?")[0])


def _caller(connection: ServerConnection) -> str:
    """The address of the client."""
    address = connection.remote_address
    return str(address[0]) if address else "an unknown address"


@contextmanager
def guarded(gate: Gate, wire: Wire) -> Iterator[None]:
    """Have ``gate`` stand before a websocket server that is started within, which also serves our files and ``wire``.

    viser has no hook for that of its own.
    """
    serve = websockets.asyncio.server.serve

    def guarded_serve(
        handler: Callable[..., Any],
        *arguments: Any,
        process_request: Callable[..., Any] | None = None,
        **options: Any,
    ) -> Any:
        async def process(connection: ServerConnection, request: Request) -> Any:
            response = await gate.decide(request, _caller(connection)) or asset(request)
            if response is None and process_request is not None:
                response = process_request(connection, request)
                if inspect.isawaitable(response):
                    response = await response
            if isinstance(response, Response):
                for name, value in HEADERS.items():
                    response.headers[name] = value
            return response

        options["max_size"] = MOST_BYTES

        async def counted(connection: Any) -> None:
            gate.connections += 1
            try:
                if gate.connections > MOST_CONNECTIONS:  # those of one moment were all let in
                    gate.complain()
                    await connection.close(1013, "too many browsers watch already")
                else:
                    await careful(wire.serve if _path(connection) == PATH else handler)(connection)
            finally:
                gate.connections -= 1

        return serve(counted, *arguments, process_request=process, **options)

    websockets.asyncio.server.serve = guarded_serve  # type: ignore[assignment,misc]
    try:
        yield
    finally:
        websockets.asyncio.server.serve = serve  # type: ignore[misc]
