"""What is steered stands while a browser is silent: soon what a hand steers, later what the page does by itself."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Iterator
from types import SimpleNamespace
from typing import Any, cast

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ligature.cockpit.deadman import ALONE, AWAKE, GONE, LEFT, DeadMan
from ligature.cockpit.rhythm import MOST, RISE
from ligature.cockpit.wire import Wire
from viser import ViserServer

from tests.waiting import until

CLIENT = 7


class Line:
    """A connection whose pings are answered when the test asks for it."""

    def __init__(self) -> None:
        self.asked: list[asyncio.Future[float]] = []

    async def ping(self) -> asyncio.Future[float]:
        self.asked.append(asyncio.get_running_loop().create_future())
        return self.asked[-1]


class Browser:
    """One that is pinged, with two connections: viser's, and that of the page's script."""

    def __init__(self) -> None:
        self.loop = asyncio.new_event_loop()
        threading.Thread(target=self.loop.run_forever, daemon=True).start()
        self.own, self.script = Line(), Line()
        self.wired = True
        sockets = SimpleNamespace(_live_connections={CLIENT: self.own})
        server = SimpleNamespace(get_event_loop=lambda: self.loop, _websock_server=sockets)
        wire = SimpleNamespace(connection=lambda client: self.script if self.wired else None)
        self.deadman = DeadMan(cast(ViserServer, server), cast(Wire, wire))

    def answers(self) -> None:
        """Answer everything that was asked, and wait until it is heard."""
        before = self.deadman._answers

        def answer() -> None:
            for asked in (*self.own.asked, *self.script.asked):
                if not asked.done():
                    asked.set_result(0.0)

        def heard() -> bool:
            self.loop.call_soon_threadsafe(answer)
            return self.deadman._answers > before

        until(heard, "an answer", 10.0, every=0.002)

    def ends(self) -> None:
        self.deadman.watch(None, False, 0.0)
        self.loop.call_soon_threadsafe(self.loop.stop)


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    found = Browser()
    yield found
    found.ends()


def silences(deadman: DeadMan, turns: list[float]) -> list[tuple[float, float]]:
    """Paces of hand and plan, turn by turn, while nothing is answered."""
    found = []
    for dt in turns:
        deadman.watch(CLIENT, True, dt)
        found.append(deadman.paces(dt))
    return found


@settings(max_examples=20, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.floats(0.0, 5.0), min_size=1, max_size=30))
def test_a_page_that_was_held_up_itself_counts_no_silence_of_the_browser(browser: Browser, turns: list[float]) -> None:
    deadman = browser.deadman
    deadman.watch(CLIENT, False, 0.0)
    deadman.watch(CLIENT, True, 0.0)
    silences(deadman, turns)
    assert deadman.silence <= sum(min(dt, AWAKE) for dt in turns) + 1e-9
    browser.answers()
    deadman.watch(CLIENT, True, 0.01)
    assert deadman.silence == 0.0, "an answer ends it"


def test_a_hand_stands_soon_a_plan_later_and_both_go_on_smoothly(browser: Browser) -> None:
    deadman, dt = browser.deadman, 0.01
    deadman.watch(CLIENT, False, 0.0)
    deadman.watch(CLIENT, True, 0.0)
    silences(deadman, [RISE, RISE])
    before = deadman.silence
    paces = silences(deadman, [dt] * 250)
    at = [before + dt * (i + 1) for i in range(250)]
    assert all(hand == 0.0 for (hand, _), t in zip(paces, at, strict=True) if t >= MOST)
    assert all(plan == 0.0 for (_, plan), t in zip(paces, at, strict=True) if t >= ALONE + dt)
    assert all(plan == 1.0 for (_, plan), t in zip(paces, at, strict=True) if GONE < t < 0.5 * ALONE - dt)
    assert ALONE < LEFT
    browser.answers()
    deadman.watch(CLIENT, True, dt)
    back = [deadman.paces(dt) for _ in range(3)]
    assert 0.0 < back[0][0] <= dt / RISE + 1e-9 and 0.0 < back[0][1] <= dt / RISE + 1e-9, "without a jump"


def test_the_connection_of_the_script_is_asked_and_viser_s_where_there_is_none(browser: Browser) -> None:
    lines: list[Any] = [browser.script, browser.own]
    for wired, asked, left in ((True, *lines), (False, *reversed(lines))):
        browser.wired = wired
        begin = len(asked.asked)
        until(lambda n=begin, line=asked: len(line.asked) > n + 1, "pings", 10.0)  # the last of the other is sent
        before = len(left.asked)
        until(lambda n=begin, line=asked: len(line.asked) > n + 4, "pings go on", 10.0)
        assert len(left.asked) == before
    browser.wired = True
