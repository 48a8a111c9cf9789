"""Hypothesis strategies for every command, made from the commands' own fields: a new command is included by itself."""

from __future__ import annotations

import ligature.bus  # noqa: F401  registers the loop's messages
import ligature.bus.codec  # noqa: F401  registers all others
from hypothesis import strategies as st
from ligature.model.messages import (
    MAX_NUMBERS,
    Choice,
    Choices,
    Field,
    Message,
    Numbers,
    OptionalIndex,
    Packed,
    Real,
    Text,
)

_PACKED = {bool: st.booleans(), int: st.integers(0, 2**31 - 1)}


def values(field: Field) -> st.SearchStrategy[object]:
    """Anything that fits the wire form of ``field``, valid or not."""
    if isinstance(field, Packed):
        return _PACKED[field.type]  # type: ignore[index]
    if isinstance(field, OptionalIndex):
        return st.none() | st.integers(0, 2**31 - 1)
    if isinstance(field, Choice):
        return st.sampled_from(field.options)
    if isinstance(field, Choices):
        return st.lists(st.sampled_from(field.options), max_size=MAX_NUMBERS).map(tuple)
    if isinstance(field, Real):
        return st.floats()
    if isinstance(field, Numbers):
        numbers = st.lists(st.floats(), max_size=field.length or MAX_NUMBERS).map(tuple)
        return st.none() | numbers if field.optional else numbers
    assert isinstance(field, Text), field
    texts = st.text(st.characters(codec="utf-8"), max_size=50)
    return st.none() | texts if field.optional else texts


def messages() -> st.SearchStrategy[Message]:
    """Any message of any kind."""
    return st.sampled_from(sorted(Message.by_code)).flatmap(
        lambda code: st.builds(
            Message.by_code[code], *(values(field) for _, _, field in Message.by_code[code].fields())
        )
    )
