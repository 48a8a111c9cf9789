"""Scalar rules of the format: which text is a number, an integer, a truth value.

Every function takes the text of a YAML scalar and raises ValueError with what was expected.
"""

from __future__ import annotations

import math
import re

_DECIMAL = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?\Z", re.ASCII)
_INTEGER = re.compile(r"[+-]?(0[xX][0-9a-fA-F]+|\d+)\Z", re.ASCII)
_BLANKS = " \t\n\v\f\r"
MOST_DIGITS = 40
"""Longest whole number in characters; time to convert longer ones grows with their square."""

_NOT_FINITE = {
    ".inf": math.inf, ".Inf": math.inf, ".INF": math.inf,
    "+.inf": math.inf, "+.Inf": math.inf, "+.INF": math.inf,
    "-.inf": -math.inf, "-.Inf": -math.inf, "-.INF": -math.inf,
    ".nan": math.nan, ".NaN": math.nan, ".NAN": math.nan,
}  # fmt: skip
_TRUE = ("true", "yes", "on", "y")
_FALSE = ("false", "no", "off", "n")


def number(text: str) -> float:
    """A double: decimal or exponent form, .inf or .nan; trailing blanks are tolerated."""
    text = text.rstrip(_BLANKS)
    if text in _NOT_FINITE:
        return _NOT_FINITE[text]
    if not _DECIMAL.match(text):
        raise ValueError("a number such as 0.5 or 1e-3")
    return float(text)


def integer(text: str) -> int:
    """A signed integer of 32 bits: decimal, 0x… or octal with a leading 0."""
    return _within(_whole(text), -(2**31), 2**31 - 1)


def unsigned(text: str) -> int:
    """A whole number of 32 bits that is not negative."""
    value = _whole(text)
    if value < 0:
        raise ValueError("a whole number that is not negative")
    return _within(value, 0, 2**32 - 1)


def _within(value: int, least: int, most: int) -> int:
    if least <= value <= most:
        return value
    raise ValueError(f"a whole number from {least} to {most}")


def _whole(text: str) -> int:
    text = text.rstrip(_BLANKS)
    if len(text) > MOST_DIGITS:
        raise ValueError(f"a whole number of at most {MOST_DIGITS} digits")
    if not _INTEGER.match(text):
        raise ValueError("a whole number such as 10 or 0x0a")
    sign = -1 if text.startswith("-") else 1
    digits = text.lstrip("+-")
    if digits[:2] in ("0x", "0X"):
        return sign * int(digits, 16)
    if len(digits) > 1 and digits.startswith("0"):
        if not set(digits) <= set("01234567"):
            raise ValueError("a whole number; a leading 0 means octal")
        return sign * int(digits, 8)
    return sign * int(digits)


def flag(text: str) -> bool:
    """true/false, yes/no, on/off, y/n in lower, UPPER or Capitalised form; not 1 or 0."""
    lowered = text.lower()
    if text in (lowered, lowered.upper(), lowered.capitalize()):
        if lowered in _TRUE:
            return True
        if lowered in _FALSE:
            return False
    raise ValueError("true or false (1 and 0 are not truth values)")
