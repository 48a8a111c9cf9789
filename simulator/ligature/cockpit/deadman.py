"""Whether the operator's browser still answers while an arm follows it: pings on its own connection.

A closed browser closes its connection at once. One that is frozen, or behind a cut network, is noticed only because it
stops to answer; the browser answers pings apart from its page, so that a slow page alone does not stop an arm.
"""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from typing import cast

import websockets.exceptions
from viser import ViserServer

PERIOD = 0.02
"""Seconds between pings."""

TIMEOUT = 0.07
"""Seconds without an answer after which an arm must stop; with a turn of the loop it holds within 0.1 s."""


class DeadMan:
    """Pings the browser ``watched`` while it is set; seconds on the monotonic clock."""

    def __init__(self, server: ViserServer) -> None:
        self._server = server
        self._client: int | None = None
        self._answered = 0.0
        self._loop = server.get_event_loop()

    def watch(self, client: int | None) -> None:
        """Ping ``client`` from now on, None for nobody."""
        if client == self._client:
            return
        self._client, self._answered = client, time.monotonic()
        if client is not None:
            asyncio.run_coroutine_threadsafe(self._ping(client), self._loop)

    @property
    def silence(self) -> float:
        """Seconds since the watched browser last answered; 0 while none is watched."""
        return 0.0 if self._client is None else time.monotonic() - self._answered

    async def _ping(self, client: int) -> None:
        while self._client == client:
            # viser keeps its connections to itself; there is no other way to ping one of them
            connection = self._server._websock_server._live_connections.get(client)
            if connection is None:
                return
            with suppress(websockets.exceptions.ConnectionClosed):
                answer = cast("asyncio.Future[float]", await connection.ping())
                answer.add_done_callback(lambda done: self._heard(client, done))
            await asyncio.sleep(PERIOD)

    def _heard(self, client: int, answer: asyncio.Future[float]) -> None:
        if client == self._client and not answer.cancelled() and answer.exception() is None:
            self._answered = time.monotonic()
