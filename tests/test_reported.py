"""What repeats is reported once in a while."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st
from ligature.process import REPEAT, Reported

STEPS = st.lists(st.tuples(st.sampled_from("abc"), st.floats(0.0, 2.0 * REPEAT)), max_size=40)


@given(STEPS)
def test_a_text_is_reported_when_its_last_report_is_older_than_the_pause(steps: list[tuple[str, float]]) -> None:
    reported, now, shown = Reported(), 0.0, []
    for text, pause in steps:
        now += pause
        expected = not any(text == other and now - at < REPEAT for other, at in shown)
        assert reported.is_new(text, now) == expected
        if expected:
            shown.append((text, now))
