"""Commands survive the way through bytes; bytes that are no command do not."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.bus.codec import CodecError, decode, encode
from ligature.bus.ring import MOST_BYTES
from ligature.model.commands import ActuatorCommand, BodyCommand, Command, CommandType
from ligature.model.messages import Message
from ligature.robots.commands import VERBS, ArmCommand

from tests.strategies import messages


def classes(base: type[Message]) -> set[type[Message]]:
    """All classes below ``base`` that are no mere bases."""
    found = {base} if base.code >= 0 else set()
    return found.union(*(classes(below) for below in base.__subclasses__()))


@given(messages())
def test_every_message_comes_back_equal_and_fits_a_slot(message: Message) -> None:
    data = encode(message)
    assert len(data) <= MOST_BYTES
    back = decode(data)
    assert type(back) is type(message)
    assert repr(back) == repr(message)  # NaN equals itself here


@given(st.binary(max_size=300))
def test_other_bytes_are_rejected_or_are_a_message(data: bytes) -> None:
    try:
        decode(data)
    except CodecError as error:
        assert "invalid command bytes" in str(error)


@given(messages(), st.data())
def test_a_message_that_passes_its_check_is_finite(message: Message, data: st.DataObject) -> None:
    try:
        message.check()
    except ValueError as error:
        assert str(error)
        return
    for name, _, _ in message.fields():
        value = getattr(message, name)
        for number in value if isinstance(value, tuple) else (value,):
            assert not isinstance(number, float) or math.isfinite(number)


def test_every_command_travels() -> None:
    assert classes(Message) == set(Message.by_code.values())
    assert {c for c in classes(Command) if issubclass(c, ArmCommand)} == set(VERBS.values())


def test_two_commands_with_one_code_are_rejected() -> None:
    with pytest.raises(TypeError, match="the code 1 is taken"):
        type("Another", (Command,), {}, code=1)


def test_too_many_numbers_are_rejected() -> None:
    with pytest.raises(CodecError, match="at most 250 numbers"):
        encode(BodyCommand(0, CommandType.FORCE, (0.0,) * 6, (), (0.0,) * 251))


def test_a_long_name_is_rejected() -> None:
    with pytest.raises(CodecError, match="at most 200 bytes"):
        encode(ActuatorCommand(0, True, "x" * 201))
