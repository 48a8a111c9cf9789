"""Commands survive the way through bytes; bytes that are no command do not."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.bus.codec import CodecError, Message, decode, encode
from ligature.bus.pacing import Throttle
from ligature.model.commands import (
    ActuatorCommand,
    BodyCommand,
    CommandType,
    ParentCommand,
    PlaceCommand,
    Release,
    Reset,
    WatchContacts,
)

NUMBER = st.floats(allow_nan=False)
POSE = st.tuples(*[NUMBER] * 7)
MESSAGES = st.one_of(
    st.builds(
        BodyCommand, st.integers(0, 10**6), st.sampled_from(CommandType), POSE,
        st.lists(st.sampled_from(CommandType), max_size=64).map(tuple), st.lists(NUMBER, max_size=64).map(tuple),
    ),
    st.builds(
        ActuatorCommand, st.integers(0, 99), st.booleans(), st.text(max_size=40), st.none() | POSE,
        st.none() | st.text(max_size=40),
    ),
    st.builds(PlaceCommand, st.sampled_from(["camera", "light"]), st.integers(0, 99), st.none() | POSE),
    st.builds(ParentCommand, st.sampled_from(["camera", "light"]), st.integers(0, 99), st.none() | st.integers(0, 99)),
    st.builds(Release, st.sampled_from(["body", "actuator", "camera"]), st.integers(0, 99)),
    st.builds(Reset, st.booleans()),
    st.builds(WatchContacts, st.booleans()),
    st.builds(Throttle, st.booleans(), st.booleans(), st.integers(0, 255)),
)  # fmt: skip


@given(MESSAGES)
def test_every_command_comes_back_equal(message: Message) -> None:
    assert decode(encode(message)) == message


@given(st.binary(max_size=300))
def test_other_bytes_are_refused_or_are_a_command(data: bytes) -> None:
    try:
        decode(data)
    except CodecError as error:
        assert "no command" in str(error)


def test_too_many_numbers_are_refused() -> None:
    with pytest.raises(CodecError, match="at most 64 numbers"):
        encode(BodyCommand(0, CommandType.FORCE, (0.0,) * 6, (), (0.0,) * 65))


def test_a_long_name_is_refused() -> None:
    with pytest.raises(CodecError, match="at most 200 bytes"):
        encode(ActuatorCommand(0, True, "x" * 201))
