"""Objects that are commanded no longer: reported once each, as soon as their last command is too old."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from ligature.bus.watchdog import Watchdog

PASSES = st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0])


@given(st.lists(st.tuples(PASSES, st.sampled_from("abc") | st.none())), PASSES)
def test_an_object_expires_once_and_only_after_the_timeout(
    happens: list[tuple[float, str | None]], timeout: float
) -> None:
    """Commands of three objects, and looks at what has expired (None), with times between them."""
    watchdog: Watchdog[str] = Watchdog(timeout)
    now, last = 0.0, dict[str, float]()
    for passed, fed in happens:
        now += passed
        if fed is not None:
            watchdog.feed(fed, now)
            last[fed] = now
        else:
            late = {item for item, then in last.items() if now - then > timeout}
            assert sorted(watchdog.expired(now)) == sorted(late)
            last = {item: then for item, then in last.items() if item not in late}
        assert [item for item in "abc" if watchdog.alive(item)] == sorted(last)
