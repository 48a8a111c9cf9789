"""Publishing at deadlines: rates, watchdog fall-back, states that were seen, late loops."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from ligature.ros.schedule import Outlet, Schedule

UPDATE = np.dtype([("update", "u8")])


class Template:
    """Hands on the number of the update that it is filled from."""

    def __init__(self, index: int) -> None:
        self.kind, self.index = "body", index

    def fill(self, state: Any, stamp: Any) -> int:
        return int(state["update"])


class Sink:
    """Keeps what is published."""

    def __init__(self) -> None:
        self.heard, self.messages = True, []

    def publish(self, message: Any) -> None:
        self.messages.append(message)


class Run:
    """A schedule on a clock of our own; ``hz`` updates a second."""

    def __init__(self, rates: list[tuple[float, float]], hz: float = 1000.0) -> None:
        self.sinks = [Sink() for _ in rates]
        self.commanded: set[tuple[str, int]] = set()
        outlets = [
            Outlet(Template(i), "", sink, *pair) for i, (sink, pair) in enumerate(zip(self.sinks, rates, strict=True))
        ]
        self.schedule = Schedule(outlets, lambda key: key in self.commanded)
        self.now, self.hz, self.wakes, self.missed = 100.0, hz, 0, 0

    def turn(self, seconds: float) -> list[int]:
        """Advance time; returns how many messages each outlet sent."""
        before, end = [len(sink.messages) for sink in self.sinks], self.now + seconds
        while (due := self.schedule.next_due(self.now)) < end:
            self.now = max(self.now, due)
            self.wakes += 1
            state = np.array([(int(self.now * self.hz),)], UPDATE)[0]
            self.missed += self.schedule.publish(self.now, state, None)[1]
        self.now = end
        return [len(sink.messages) - n for sink, n in zip(self.sinks, before, strict=True)]


def test_objects_keep_their_low_rate_without_drift() -> None:
    run = Run([(100, 1000), (50, 1000), (30, 1000)])
    assert run.turn(100.0) == pytest.approx([10000, 5000, 3000], abs=2)
    assert run.missed == 0


def test_objects_of_one_rate_share_one_reading_of_the_state() -> None:
    run = Run([(100, 1000)] * 40)
    run.turn(10.0)
    assert run.wakes == pytest.approx(1000, abs=3)


def test_a_commanded_object_publishes_at_the_high_rate_and_falls_back() -> None:
    run = Run([(50, 200), (50, 200)])
    run.turn(1.0)
    run.commanded.add(("body", 0))
    run.schedule.wake(("body", 0), False)
    assert run.turn(1.0) == pytest.approx([200, 50], abs=2)
    run.commanded.clear()
    assert run.turn(1.0) == pytest.approx([50, 50], abs=2)


def test_a_command_that_asks_for_more_is_answered_at_once() -> None:
    run = Run([(1, 100)])
    run.turn(1.5)
    run.commanded.add(("body", 0))
    run.schedule.wake(("body", 0), True)
    assert run.turn(0.001) == [1]


def test_a_state_that_was_sent_is_repeated_at_the_low_rate_only() -> None:
    run = Run([(50, 1000)], hz=200.0)
    run.commanded.add(("body", 0))
    assert run.turn(1.0) == pytest.approx([200], abs=2)
    run.hz = 0.0
    assert run.turn(1.0) == pytest.approx([50], abs=2)


def test_nothing_is_made_for_nobody() -> None:
    run = Run([(100, 100)])
    run.sinks[0].heard = False
    assert run.turn(1.0) == [0]


def test_a_loop_that_was_held_up_skips_deadlines_and_counts_them() -> None:
    run = Run([(100, 100)])
    run.turn(1.0)
    run.now += 0.5
    sent = run.turn(1.0)[0]
    assert sent == pytest.approx(101, abs=2)
    assert run.missed == pytest.approx(50, abs=2)
