"""Scalar rules of yaml-cpp."""

from __future__ import annotations

import math
import sys
import unicodedata

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import scalars


@pytest.mark.parametrize(
    ("text", "value"),
    [("1", 1.0), ("1.", 1.0), (".5", 0.5), ("1e-3", 1e-3), ("1.0e-05", 1e-5), ("-0.0", 0.0), ("0.1  ", 0.1),
     (".inf", math.inf), ("-.INF", -math.inf)],
)  # fmt: skip
def test_numbers_that_yaml_cpp_reads(text: str, value: float) -> None:
    assert scalars.number(text) == value


@pytest.mark.parametrize("text", ["0x10", "", "nan", "inf", "1,5", "one", "1 2"])
def test_texts_that_are_no_number(text: str) -> None:
    with pytest.raises(ValueError, match="a number such as"):
        scalars.number(text)


@pytest.mark.parametrize(("text", "value"), [("12", 12), ("0xff", 255), ("010", 8), ("-3", -3)])
def test_integers_decimal_hex_and_octal(text: str, value: int) -> None:
    assert scalars.integer(text) == value


@pytest.mark.parametrize("text", ["5.0", "1.5", "", "two", "08"])
def test_texts_that_are_no_integer(text: str) -> None:
    with pytest.raises(ValueError, match="whole number"):
        scalars.integer(text)


def test_unsigned_refuses_a_negative_number() -> None:
    with pytest.raises(ValueError, match="not negative"):
        scalars.unsigned("-1")


@pytest.mark.parametrize("text", ["true", "True", "TRUE", "yes", "On", "y", "Y"])
def test_words_for_true(text: str) -> None:
    assert scalars.flag(text) is True


@pytest.mark.parametrize("text", ["false", "No", "OFF", "n"])
def test_words_for_false(text: str) -> None:
    assert scalars.flag(text) is False


@pytest.mark.parametrize("text", ["1", "0", "tRue", "", "maybe"])
def test_one_and_zero_are_not_truth_values(text: str) -> None:
    with pytest.raises(ValueError, match="true or false"):
        scalars.flag(text)


def test_zero_is_unsigned_and_octal_has_all_eight_digits() -> None:
    assert scalars.unsigned("0") == 0
    assert scalars.integer("001234567") == 0o1234567


DIGITS = [chr(code) for code in range(128, sys.maxunicode + 1) if unicodedata.category(chr(code)) == "Nd"]


@given(st.text("0123456789.e+-", max_size=3), st.sampled_from(DIGITS), st.text("0123456789", max_size=3))
def test_digits_of_other_scripts_make_no_number(before: str, digit: str, behind: str) -> None:
    for rule in (scalars.number, scalars.integer, scalars.unsigned):
        with pytest.raises(ValueError, match="number"):
            rule(before + digit + behind)


@given(st.integers(-(2**34), 2**34) | st.integers(), st.sampled_from(["", " ", "\t", "\n"]))
def test_whole_numbers_have_32_bits(value: int, blank: str) -> None:
    """As in AMBF, and as what takes them expects."""
    for rule, least, most in ((scalars.integer, -(2**31), 2**31 - 1), (scalars.unsigned, 0, 2**32 - 1)):
        if least <= value <= most:
            assert rule(f"{value}{blank}") == value
        else:
            with pytest.raises(ValueError, match="a whole number"):
                rule(f"{value}{blank}")


def test_an_endless_whole_number_is_refused_at_once() -> None:
    with pytest.raises(ValueError, match="at most 40 digits"):
        scalars.integer("1" * 1_000_000)
