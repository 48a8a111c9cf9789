"""Whether the operator's browser still answers while an arm follows it: pings on a connection of its page.

A closed browser closes its connection at once. One that is frozen, or behind a cut network, is noticed only because it
stops answering. Pings go over the connection of the page's script, on which little waits to be read: a browser that is
slow to draw what viser sends it leaves that unread, and with it the pings of that connection.
"""

from __future__ import annotations

import asyncio
import time
from contextlib import suppress
from functools import partial
from typing import cast

import websockets.exceptions
from viser import ViserServer

from ligature.cockpit.rhythm import Pace, Rhythm
from ligature.cockpit.wire import Wire

PERIOD = 0.02
"""Seconds between pings while an arm follows."""

IDLE_PERIOD = 0.2
"""Seconds between those by which the rhythm of an operator's browser is known before an arm follows."""

GONE = 0.5
"""Seconds without an answer after which motions driven by hand end, instead of being resumed."""

ALONE, LEFT = 2.0, 15.0
"""The same of what the page steers by a plan: it stands after the first, goes on when the browser answers, and is given
up after the second. A plan needs nobody's hand; the bound is for an operator who cannot stop it any more."""

AWAKE = 0.05
"""Seconds that one turn of the page's loop adds to a silence at most.

A page that is held up itself sends no goals meanwhile, and hears no answers.
"""


class DeadMan:
    """Pings the browser ``watched`` while it is set."""

    def __init__(self, server: ViserServer, wire: Wire) -> None:
        self._server, self._wire = server, wire
        self._client: int | None = None
        self._following = False
        self._answers = 0
        self._heard_of = 0
        self._rhythm, self._plan = Rhythm(), Pace()
        self._loop = server.get_event_loop()
        self.silence = 0.0
        """Seconds since the watched browser last answered; 0 while no arm follows."""

    def watch(self, client: int | None, following: bool, dt: float) -> None:
        """Ping ``client`` from now on, None for nobody; an arm may be ``following`` it. Once a turn of ``dt``."""
        if client != self._client:
            self._client, self._rhythm, self.silence = client, Rhythm(), 0.0
            if client is not None:
                asyncio.run_coroutine_threadsafe(self._ping(client), self._loop)
        answers, before = self._answers, self._heard_of
        self._heard_of = answers
        silent = client is not None and following and self._following and answers == before
        self.silence = self.silence + min(dt, AWAKE) if silent else 0.0
        self._following = following

    def paces(self, dt: float) -> tuple[float, float]:
        """Shares 0..1 of its speed that an arm may go at that a hand steers, and one that a plan steers.

        ``dt`` seconds have gone by since the last call.
        """
        return self._rhythm.pace(self.silence, dt), self._plan.advance(self.silence, ALONE, dt)

    async def _ping(self, client: int) -> None:
        while self._client == client:
            # viser keeps its connections to itself; there is no other way to ping one of them
            own = self._server._websock_server._live_connections.get(client)
            if own is None:
                return
            connection = self._wire.connection(client) or own
            with suppress(websockets.exceptions.ConnectionClosed):
                sent = time.monotonic()
                answer = cast("asyncio.Future[float]", await connection.ping())
                answer.add_done_callback(partial(self._heard, client, sent))
            await asyncio.sleep(PERIOD if self._following else IDLE_PERIOD)

    def _heard(self, client: int, sent: float, answer: asyncio.Future[float]) -> None:
        if client == self._client and not answer.cancelled() and answer.exception() is None:
            self._answers += 1
            self._rhythm.note(PERIOD + time.monotonic() - sent)
