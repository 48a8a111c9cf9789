"""Stamps of states go forward with the clock, whatever holds physics up."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

pytestmark = pytest.mark.ros
rospy = pytest.importorskip("rospy")

STALE = 0.1
PERIODS = st.lists(
    st.tuples(st.integers(1, 300_000_000), st.booleans(), st.integers(0, 300_000_000)), min_size=1, max_size=40
)
"""Of each look: nanoseconds since the last one, whether a new state is there, and how old its stamp is."""


@given(PERIODS)
def test_no_stamp_is_before_the_last(periods: list[tuple[int, bool, int]]) -> None:
    from ligature.ros.arms.events import StateStamps

    stamps, now, state, last = StateStamps(STALE), 10**18, 10**18, 0
    for passed, comes, age in periods:
        now += passed
        state = max(state, now - age) if comes else state
        found = stamps.of(rospy.Time(nsecs=state), rospy.Time(nsecs=now)).to_nsec()
        assert max(last, state) <= found <= now
        assert now - found <= STALE * 1e9
        last = found


@given(st.integers(10**9, 10**13))
def test_stamps_follow_a_clock_that_is_set_back(back: int) -> None:
    from ligature.ros.arms.events import StateStamps

    stamps, now = StateStamps(STALE), 10**18
    stamps.of(rospy.Time(nsecs=now), rospy.Time(nsecs=now))
    assert stamps.of(rospy.Time(nsecs=now - back), rospy.Time(nsecs=now - back)).to_nsec() == now - back
