"""When pictures fall due: on one grid, the newest only, a resting simulation now and then."""

from __future__ import annotations

import pytest
from ligature.render.shutter import REPEAT, Shutter


def test_a_shutter_opens_once_every_interval_of_the_frame_clock() -> None:
    shutter = Shutter(interval=5, frame_rate=100.0)
    opened = [i for i in range(1000) if shutter.open(i / 1000.0, update=i)]
    assert opened == [0, *range(50, 1000, 50)]


def test_shutters_of_one_interval_open_together_wherever_they_began() -> None:
    left, right = Shutter(4, 100.0), Shutter(4, 100.0)
    assert left.open(10.001, 1) and right.open(10.017, 2)
    assert left.due == right.due == pytest.approx(10.04)


def test_deadlines_that_passed_are_counted_and_not_made_up_for() -> None:
    shutter = Shutter(1, 100.0)
    assert shutter.missed(0.0) == 0 and shutter.open(0.0, 0)
    assert shutter.missed(0.0105) == 0
    assert shutter.missed(0.055) == 4 and shutter.open(0.055, 1)
    assert not shutter.open(0.056, 2)


def test_a_state_that_was_shown_is_shown_again_only_after_a_while() -> None:
    shutter = Shutter(1, 100.0)
    opened = [i for i in range(100) if shutter.open(i / 100.0, update=7)]
    assert opened == [0, round(100 * REPEAT)]
