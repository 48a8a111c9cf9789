"""A box of commands: the newest of each object, every event, in the order in which they came."""

from __future__ import annotations

from ligature.bus.newest import Newest
from ligature.model.commands import Release, Reset


def test_an_older_command_of_the_same_object_gives_way_and_the_newer_one_is_last() -> None:
    box = Newest()
    first, other, newer = Release("body", 1), Release("body", 2), Release("body", 1)
    assert [box.put(message) for message in (first, other)] == [False, False]
    if first.slot is not None:
        assert box.put(newer)
        assert box.messages() == [other, newer]


def test_every_event_is_kept_and_counted_until_the_box_is_emptied() -> None:
    box, event = Newest(), Reset()
    assert event.slot is None and box.events == 0
    assert not box.put(event) and not box.put(event)
    assert (len(box), box.events, box.messages()) == (2, 2, [event, event])
    box.clear()
    assert (len(box), box.events, box.messages()) == (0, 0, [])
