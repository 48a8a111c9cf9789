"""Names of recordings: one file in the folder of recordings, whatever a person types."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.bus.recording import MOST_BYTES, SUFFIX, Recording, file_name


@given(st.text(st.sampled_from("ab é€./\\\n\0"), max_size=6))
def test_a_name_is_one_visible_file_with_the_suffix_or_rejected(text: str) -> None:
    name = text.strip()
    if "/" in name or name.startswith(".") or not name.isprintable():
        with pytest.raises(ValueError, match="is not a valid name of a recording; use letters and digits"):
            file_name(text)
        with pytest.raises(ValueError, match="is not a valid name"):
            Recording(text).check_together({})
    else:
        assert file_name(text) == (name and name + SUFFIX)
        assert not name or file_name(name + SUFFIX) == name + SUFFIX
        Recording(text).check_together({})


@pytest.mark.parametrize("letter", ["a", "é", "€"])
def test_a_name_has_at_most_so_many_bytes(letter: str) -> None:
    fits = letter * (MOST_BYTES // len(letter.encode()))
    assert file_name(fits) == fits + SUFFIX
    with pytest.raises(
        ValueError, match=f"must have at most {MOST_BYTES} bytes, not {MOST_BYTES + len(letter.encode())}"
    ):
        file_name(fits + letter)
