"""Scalar rules of yaml-cpp."""

from __future__ import annotations

import math

import pytest
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
