"""Whether the operator's browser still answers while an arm follows it: pings on its own connection.

A closed browser closes its connection at once. One that is frozen, or behind a cut network, is noticed only because it
stops to answer; the browser answers pings apart from its page, so that a slow page alone does not stop an arm.
"""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from functools import partial
from typing import cast

import websockets.exceptions
from viser import ViserServer

from ligature.cockpit.rhythm import Rhythm

PERIOD = 0.02
"""Seconds between pings while an arm follows."""

IDLE_PERIOD = 0.2
"""Seconds between those by which the rhythm of an operator's browser is known before an arm follows."""

GONE = 0.5
"""Seconds without an answer after which what an arm follows is given up, instead of waited for."""


class DeadMan:
    """Pings the browser ``watched`` while it is set; seconds on the monotonic clock."""

    def __init__(self, server: ViserServer) -> None:
        self._server = server
        self._client: int | None = None
        self._following = False
        self._answered = 0.0
        self._rhythm = Rhythm()
        self._loop = server.get_event_loop()

    def watch(self, client: int | None, following: bool) -> None:
        """Ping ``client`` from now on, None for nobody; ``following``: whether an arm follows it."""
        if following and not self._following:
            self._answered = time.monotonic()
        self._following = following
        if client == self._client:
            return
        self._client, self._answered, self._rhythm = client, time.monotonic(), Rhythm()
        if client is not None:
            asyncio.run_coroutine_threadsafe(self._ping(client), self._loop)

    @property
    def silence(self) -> float:
        """Seconds since the watched browser last answered; 0 while no arm follows."""
        return 0.0 if self._client is None or not self._following else time.monotonic() - self._answered

    def pace(self, dt: float) -> float:
        """Share 0..1 of its speed that an arm may go at, ``dt`` seconds after the last call."""
        return self._rhythm.pace(self.silence, dt)

    async def _ping(self, client: int) -> None:
        while self._client == client:
            # viser keeps its connections to itself; there is no other way to ping one of them
            connection = self._server._websock_server._live_connections.get(client)
            if connection is None:
                return
            with suppress(websockets.exceptions.ConnectionClosed):
                sent = time.monotonic()
                answer = cast("asyncio.Future[float]", await connection.ping())
                answer.add_done_callback(partial(self._heard, client, sent))
            await asyncio.sleep(PERIOD if self._following else IDLE_PERIOD)

    def _heard(self, client: int, sent: float, answer: asyncio.Future[float]) -> None:
        if client == self._client and not answer.cancelled() and answer.exception() is None:
            self._answered = time.monotonic()
            self._rhythm.note(PERIOD + self._answered - sent)
