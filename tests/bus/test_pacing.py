"""Pacing against the wall clock and by a client's clock; time is given, nothing sleeps."""

from __future__ import annotations

import math

import pytest
from ligature.bus import Pacer, Throttle, Watchdog
from ligature.bus.pacing import BACKLOG, DEFAULT_SKIP, MOST_AHEAD


def test_updates_are_due_at_absolute_times() -> None:
    pacer = Pacer(0.01)
    assert pacer.wait(100.0) == 0.0
    pacer.done(100.004)
    assert pacer.wait(100.004) == pytest.approx(0.006)
    pacer.done(100.012)
    assert pacer.wait(100.012) == pytest.approx(0.008)


def test_a_speed_factor_shortens_the_wait() -> None:
    pacer = Pacer(0.01, speed=2.0)
    pacer.wait(0.0)
    pacer.done(0.0)
    assert pacer.wait(0.0) == pytest.approx(0.005)


def test_a_short_delay_is_made_up_for_and_a_long_one_is_lost() -> None:
    pacer = Pacer(0.01)
    pacer.wait(0.0)
    pacer.done(0.03)
    assert pacer.wait(0.03) == 0.0 and pacer.lost == 0.0
    pacer.done(1.0)
    assert pacer.lost == pytest.approx(1.0 - 0.02 - BACKLOG)
    assert pacer.wait(1.0) == 0.0


def updates(pacer: Pacer) -> int:
    count = 0
    while pacer.wait(0.0) == 0.0:
        pacer.done(0.0)
        count += 1
    return count


def test_each_toggle_of_the_clock_releases_one_batch() -> None:
    pacer = Pacer(0.01)
    pacer.throttle(Throttle(True, False, 5))
    assert pacer.wait(0.0) == math.inf
    pacer.throttle(Throttle(True, True, 5))
    assert updates(pacer) == 5
    pacer.throttle(Throttle(True, True, 5))
    assert updates(pacer) == 0
    pacer.throttle(Throttle(True, False, 3))
    assert updates(pacer) == 3


def test_toggles_that_come_while_a_batch_runs_are_not_lost() -> None:
    pacer = Pacer(0.01)
    for clock in (False, True, False, True):
        pacer.throttle(Throttle(True, clock, 5))
    assert updates(pacer) == 15


def test_a_clock_that_runs_away_is_followed_for_a_while_only() -> None:
    pacer = Pacer(0.01)
    for toggle in range(1000):
        pacer.throttle(Throttle(True, toggle % 2 == 1, 5))
    assert updates(pacer) == MOST_AHEAD * 5


def test_zero_updates_keep_the_present_number() -> None:
    pacer = Pacer(0.01)
    pacer.throttle(Throttle(True, True, 0))
    assert updates(pacer) == DEFAULT_SKIP


def test_the_end_of_throttling_runs_freely_again() -> None:
    pacer = Pacer(0.01)
    pacer.throttle(Throttle(True, False, 5))
    pacer.throttle(Throttle(False, False, 5))
    assert pacer.wait(7.0) == 0.0
    pacer.done(7.0)
    assert pacer.wait(7.0) == pytest.approx(0.01)


def test_a_watchdog_reports_each_silence_once() -> None:
    dog: Watchdog[str] = Watchdog()
    dog.feed("needle", 10.0)
    assert dog.alive("needle") and dog.expired(10.5) == []
    assert dog.expired(10.51) == ["needle"]
    assert not dog.alive("needle") and dog.expired(99.0) == []


def test_world_commands_that_ask_for_nothing_change_nothing() -> None:
    pacer = Pacer(0.01)
    assert pacer.wait(0.0) == 0.0
    pacer.done(0.0)
    for i in range(8):
        pacer.throttle(Throttle(False, False, 0))
        assert pacer.wait(0.001 * i) == pytest.approx(0.01 - 0.001 * i)
    pacer.throttle(Throttle(False, False, 0))
    pacer.done(0.01)
    assert pacer.wait(0.01) == pytest.approx(0.01)


def test_throttling_that_begins_just_before_an_update_holds_it_back() -> None:
    pacer = Pacer(0.01)
    pacer.wait(0.0)
    pacer.throttle(Throttle(True, False, 4))
    assert pacer.wait(0.0) == math.inf
    pacer.throttle(Throttle(True, True, 4))
    assert updates(pacer) == 4


@pytest.mark.parametrize("skip", [1, 2, 7])
def test_a_batch_has_as_many_updates_as_the_client_asks_for_down_to_one(skip: int) -> None:
    pacer = Pacer(0.01)
    pacer.throttle(Throttle(True, False, skip))
    pacer.throttle(Throttle(True, True, skip))
    assert updates(pacer) == skip
