"""The connection of the page's own script: orders of hands to the loop, facts and pictures to the browser.

viser has none for keys held down, game pads, or pictures that a slow browser may miss. A browser names the pass that
its page was given, and so speaks for that page; a picture is sent to it when it has shown the one before.
"""

from __future__ import annotations

import asyncio
import hmac
import json
import secrets
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

from ligature.cockpit.intake import rejections
from ligature.cockpit.orders import Order, read_order

PATH = "/wire"

HELLO_TIMEOUT = 10.0
"""Seconds in which a connection must name its pass."""

MOST_RATE, BURST = 100.0, 200.0
"""Orders a second that are taken of a connection, and how many at once; a page sends at most forty a second."""

PICTURE_TIMEOUT = 2.0
"""Seconds after which a browser that has not confirmed a picture is sent the next."""

Put = Callable[[str, int, Any], None]


class _Line:
    """One connection."""

    def __init__(self, connection: ServerConnection) -> None:
        self.connection = connection
        self.waits_since: float | None = None
        self.facts = ""
        self.wakes = asyncio.Event()
        self.picture: bytes | None = None
        self.sent = ""


class Wire:
    """All connections; orders go to ``put`` as ``"wire"``, the number of a viser client and an `Order`."""

    def __init__(self) -> None:
        self._passes: dict[int, str] = {}
        self._lines: dict[int, _Line] = {}
        self._put: Put = lambda *_: None
        self._loop: asyncio.AbstractEventLoop | None = None

    def begin(self, put: Put, loop: asyncio.AbstractEventLoop) -> None:
        """From now on hand orders to ``put``."""
        self._put, self._loop = put, loop

    # --- called by the loop of the page ----------------------------------------------------------

    def admit(self, client: int) -> str:
        """The pass by which the page of ``client`` is known."""
        return self._passes.setdefault(client, secrets.token_urlsafe(16))

    def forget(self, client: int) -> None:
        """The page of ``client`` is gone."""
        self._passes.pop(client, None)
        self._on_loop(lambda: self._hang_up(client))

    def show(self, picture: bytes) -> None:
        """Send a picture, as `pictures.packed`, to every browser that has shown the one before."""
        self._on_loop(lambda: [self._hand(line, picture=picture) for line in self._lines.values()])

    def inform(self, client: int, facts: dict[str, Any]) -> None:
        """Send facts to a browser, unless it has them."""
        text = json.dumps(facts)
        self._on_loop(lambda: self._hand(self._lines.get(client), facts=text))

    def _on_loop(self, call: Callable[[], Any]) -> None:
        if self._loop is not None:
            with suppress(RuntimeError):  # the page ends
                self._loop.call_soon_threadsafe(call)

    # --- on the network's thread -----------------------------------------------------------------

    def connection(self, client: int) -> ServerConnection | None:
        """The connection of a page's script, None while it has none."""
        line = self._lines.get(client)
        return None if line is None else line.connection

    def _hang_up(self, client: int) -> None:
        line = self._lines.pop(client, None)
        if line is not None:
            asyncio.ensure_future(line.connection.close())

    @staticmethod
    def _hand(line: _Line | None, picture: bytes | None = None, facts: str = "") -> None:
        if line is not None:
            line.picture, line.facts = picture or line.picture, facts or line.facts
            line.wakes.set()

    async def serve(self, connection: ServerConnection) -> None:
        """Speak with a browser until it goes."""
        try:
            client = await self._who(connection)
            if client is None:
                rejections.count += 1
                await connection.close(1008, "this page is not known here")
                return
            line = self._lines[client] = _Line(connection)
            sending = asyncio.create_task(self._send(line))
            try:
                await self._listen(client, line)
            finally:
                sending.cancel()
                if self._lines.get(client) is line:
                    del self._lines[client]
                self._put("wire", client, Order("silent", None))
        except ConnectionClosed:
            pass

    async def _who(self, connection: ServerConnection) -> int | None:
        with suppress(asyncio.TimeoutError):
            order = read_order(await asyncio.wait_for(connection.recv(), HELLO_TIMEOUT))
            if order is not None and order.word == "hello":
                shown = order.value.encode()
                return next((c for c, p in self._passes.items() if hmac.compare_digest(p.encode(), shown)), None)
        return None

    async def _listen(self, client: int, line: _Line) -> None:
        credit, last = BURST, time.monotonic()
        async for text in line.connection:
            now = time.monotonic()
            credit, last = min(credit + MOST_RATE * (now - last), BURST) - 1.0, now
            order = read_order(text)
            if credit < 0.0:
                rejections.count += 1
                await line.connection.close(1008, "too many orders at once")
            elif order is None or order.word == "hello":
                rejections.count += 1
            elif order.word == "seen":
                line.waits_since = None
                line.wakes.set()
            else:
                self._put("wire", client, order)

    async def _send(self, line: _Line) -> None:
        with suppress(ConnectionClosed):
            while True:
                await line.wakes.wait()
                line.wakes.clear()
                if line.facts != line.sent:
                    line.sent = line.facts
                    await line.connection.send(line.facts)
                now = time.monotonic()
                free = line.waits_since is None or now - line.waits_since > PICTURE_TIMEOUT
                if line.picture is not None and free:
                    picture, line.picture, line.waits_since = line.picture, None, now
                    await line.connection.send(picture)
