"""A front end never loses its last word when the physics process is held up."""

from __future__ import annotations

import pytest
from ligature.bus.codec import CodecError, Message, decode, encode
from ligature.bus.outbox import MOST_EVENTS, Outbox
from ligature.bus.pacing import Throttle
from ligature.bus.ring import MOST_BYTES, RING_BYTES, SLOTS, Ring
from ligature.model.commands import ActuatorCommand, BodyCommand, CommandType, Release, Reset


@pytest.fixture
def ring() -> Ring:
    return Ring(memoryview(bytearray(RING_BYTES)))


def force(body: int, x: float) -> BodyCommand:
    return BodyCommand(body, CommandType.FORCE, (x, 0.0, 0.0, 0.0, 0.0, 0.0))


def drain(ring: Ring) -> list[Message]:
    return [decode(data) for data in ring.drain()]


def fill(outbox: Outbox, ring: Ring) -> None:
    for i in range(SLOTS):
        outbox.push(force(7, float(i)))
    assert not ring.push(b"")


def test_commands_go_out_in_their_order(ring: Ring) -> None:
    outbox = Outbox(ring)
    sent = [force(1, 1.0), Reset(), force(1, 2.0), Throttle(True, True, 1)]
    for message in sent:
        outbox.push(message)
    assert drain(ring) == sent and ring.dropped == 0


def test_a_release_stated_while_the_ring_is_full_arrives_later(ring: Ring) -> None:
    outbox = Outbox(ring)
    fill(outbox, ring)
    for message in (force(3, 1.0), Reset(), force(3, 2.0), Release("body", 3)):
        outbox.push(message)
    assert len(drain(ring)) == SLOTS
    outbox.flush()
    assert drain(ring) == [Reset(), Release("body", 3)]
    assert ring.dropped == 2


def test_what_waits_goes_before_what_comes_later(ring: Ring) -> None:
    outbox = Outbox(ring)
    fill(outbox, ring)
    outbox.push(Reset())
    next(ring.drain())
    outbox.push(force(1, 5.0))
    assert drain(ring)[-1] == Reset()
    outbox.flush()
    assert drain(ring) == [force(1, 5.0)]


def test_letting_go_does_not_replace_grasping(ring: Ring) -> None:
    outbox = Outbox(ring)
    fill(outbox, ring)
    outbox.push(ActuatorCommand(0, False))
    outbox.push(ActuatorCommand(0, True, "Needle"))
    drain(ring)
    outbox.flush()
    assert drain(ring) == [ActuatorCommand(0, False), ActuatorCommand(0, True, "Needle")]


def test_a_flood_of_events_is_bounded_and_counted(ring: Ring) -> None:
    outbox = Outbox(ring)
    fill(outbox, ring)
    for _ in range(MOST_EVENTS + 5):
        outbox.push(Reset())
    assert ring.dropped == 5
    drain(ring)
    outbox.flush()
    assert len(drain(ring)) == MOST_EVENTS


def test_a_command_that_fits_no_slot_is_refused_at_once(ring: Ring) -> None:
    with pytest.raises(CodecError, match="at most 250 numbers"):
        Outbox(ring).push(BodyCommand(0, CommandType.FORCE, (0.0,) * 6, (), (0.0,) * 251))


def test_the_largest_command_fits_a_slot() -> None:
    types, values = (CommandType.POSITION,) * 250, (1.0,) * 250
    assert len(encode(BodyCommand(0, CommandType.POSITION, values[:7], types, values))) <= MOST_BYTES
    assert len(encode(ActuatorCommand(0, True, "b" * 200, (0.0,) * 7, "s" * 200))) <= MOST_BYTES


def test_a_consumer_takes_no_more_than_waited_when_it_began(ring: Ring) -> None:
    ring.push(b"a")
    taken = []
    for data in ring.drain():
        taken.append(data)
        ring.push(b"b")
    assert taken == [b"a"] and list(ring.drain()) == [b"b"]
