"""The event log: order, several readers, overruns."""

from __future__ import annotations

import pytest
from ligature.bus.events import LOG_BYTES, MOST_BYTES, SLOTS, BusEvent, EventLog


@pytest.fixture
def memory() -> bytearray:
    return bytearray(LOG_BYTES)


def test_every_reader_gets_every_event_in_order(memory: bytearray) -> None:
    writer, first, second = (EventLog(memoryview(memory)) for _ in range(3))
    writer.write(0, "operating_state", [1, True, True])
    writer.write(2, "warning", "no inverse kinematics")
    assert first.read() == [
        BusEvent(0, "operating_state", [1, True, True]),
        BusEvent(2, "warning", "no inverse kinematics"),
    ]
    writer.write(1, "goal_reached", False)
    assert first.read() == [BusEvent(1, "goal_reached", False)]
    assert [event.arm for event in second.read()] == [0, 2, 1]


def test_a_reader_that_comes_later_may_begin_with_what_is_new(memory: bytearray) -> None:
    writer, reader = EventLog(memoryview(memory)), EventLog(memoryview(memory))
    writer.write(0, "status", "old")
    reader.skip()
    assert reader.read() == []
    writer.write(0, "status", "new")
    assert [event.value for event in reader.read()] == ["new"]


def test_a_reader_that_falls_behind_loses_the_oldest_and_counts_them(memory: bytearray) -> None:
    writer, reader = EventLog(memoryview(memory)), EventLog(memoryview(memory))
    for number in range(SLOTS + 10):
        writer.write(0, "status", number)
    values = [event.value for event in reader.read()]
    assert values == list(range(10, SLOTS + 10))
    assert reader.lost == 10


def test_a_text_too_long_for_a_slot_is_cut(memory: bytearray) -> None:
    log = EventLog(memoryview(memory))
    log.write(0, "error", "é" * 2000)
    (event,) = log.read()
    assert event.name == "error"
    assert 20 < len(event.value) < 2000
    assert set(event.value) == {"é"}


@pytest.mark.parametrize("wide", range(4))
def test_a_text_is_cut_only_where_it_is_too_long(memory: bytearray, wide: int) -> None:
    log = EventLog(memoryview(memory))
    room = MOST_BYTES - len('[0, "e", ""]') - 5 * wide
    for length in range(room - 15, room + 30):
        text = "é" * wide + "a" * (length - wide)
        log.write(0, "e", text)
        (event,) = log.read()
        assert event.value == (text if length <= room else text[: len(event.value)])
        assert min(length, room) - 12 <= len(event.value)
