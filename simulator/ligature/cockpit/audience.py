"""The browsers that show the page: viewers, the operator, and how an operator reconnects after a reload."""

from __future__ import annotations

import threading
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any

from viser import ClientHandle, ViserServer

from ligature.cockpit.desk import Desk
from ligature.cockpit.wire import Wire

KEY = "ligature_operator"
"""Name below which a browser keeps the key of its operator."""

KEY_TIMEOUT = 10.0
"""Seconds in which a browser must report its key."""

Put = Callable[[str, int, Any], None]


class Audience:
    """All browsers; `hear` is called by the loop with what `put` was given on other threads.

    ``begin`` is called with the browser that operates from now on, ``end`` with why nobody does any more and whether
    the browser is still there to be cleared of its controls.
    """

    def __init__(
        self, server: ViserServer, wire: Wire, put: Put, begin: Callable[[ClientHandle], None],
        end: Callable[[str, bool], None],
    ) -> None:  # fmt: skip
        self.clients: dict[int, ClientHandle] = {}
        self.desk = Desk()
        self._wire, self._put, self._begin, self._end = wire, put, begin, end
        self._buttons: dict[int, Any] = {}
        server.on_client_connect(self._on_connect)
        server.on_client_disconnect(self._on_disconnect)

    async def _on_connect(self, client: ClientHandle) -> None:
        self._put("connect", client.client_id, client)

    async def _on_disconnect(self, client: ClientHandle) -> None:
        self._put("disconnect", client.client_id, None)

    def words(self, now: float) -> str:
        """Who operates."""
        if self.desk.operator is not None:
            return "operated"
        kept = self.desk.kept(now)
        return f"operator away, control reserved {kept:.0f} s" if kept else "no operator"

    def hear(self, word: str, client: int, value: Any, now: float) -> bool:
        """Take what happened; False when it is for somebody else to decide."""
        if word == "connect":
            self.clients[client] = value
            value.gui.add_html(f'<span id="ligature-pass" data-pass="{self._wire.admit(client)}"></span>', order=-1)
            self._set_operator(client)
            self._ask_key(value, "comes back", KEY_TIMEOUT)
        elif word == "disconnect":
            self.clients.pop(client, None)
            self._buttons.pop(client, None)
            self._wire.forget(client)
            if self.desk.leaves(client, now):
                self._end("the operator's browser is gone", False)
        elif client not in self.clients:
            return True
        elif word == "comes back":
            if self.desk.comes_back(client, value, now):
                self._sit_down(client)
        elif word == "claim":
            self._claim(client, value, now)
        elif word == "release":
            if self.desk.releases(client):
                self._end("the operator gave up control", True)
                self._set_operator(client)
        else:
            return client != self.desk.operator
        return True

    def claim(self, client: int) -> None:
        """Let a browser take the desk, as if it had asked for it with its button."""
        self._ask_key(self.clients[client], "claim", 1.0)

    def _ask_key(self, client: ClientHandle, then: str, timeout: float) -> None:
        """Ask a browser for the key that it was given as operator, on a thread of its own: it may take a while."""

        def ask() -> None:
            key = None
            with suppress(RuntimeError, TimeoutError):
                key = client.local_storage.get_item(KEY, timeout=timeout)
            self._put(then, client.client_id, key or "")

        threading.Thread(target=ask, daemon=True).start()

    def _claim(self, client: int, key: str, now: float) -> None:
        before = self.desk.operator
        new = self.desk.claim(client, now, key)
        if new is None:
            kept = self.desk.kept(now)
            why = f"Control is reserved for its operator for {kept:.0f} s." if kept else "Another browser has control."
            self.clients[client].add_notification("Watching only", why, auto_close_seconds=5.0, color="yellow")
            return
        if before is not None and before != client:
            self._end("the operator went to another page", True)
            self._set_operator(before)
        self.clients[client].local_storage.set_item(KEY, new)
        self._sit_down(client)

    def _sit_down(self, client: int) -> None:
        self._set_operator(client)
        self._begin(self.clients[client])

    def _set_operator(self, client: int) -> None:
        """Make a browser the operator's, or end that."""
        gui = self.clients[client].gui
        if client in self._buttons:
            self._buttons.pop(client).remove()
        if client == self.desk.operator:
            button = gui.add_button("Give up control", color="gray", order=1)
            button.on_click(partial(self._on_release, client))
        else:
            button = gui.add_button("Operate", color="green", order=1, hint="One browser operates, others watch")
            button.on_click(partial(self._on_claim, client))
        self._buttons[client] = button

    async def _on_release(self, client: int, _: Any) -> None:
        self._put("release", client, None)

    async def _on_claim(self, client: int, event: Any) -> None:
        self._ask_key(event.client, "claim", 1.0)
