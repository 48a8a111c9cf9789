"""Messages write lengths as a reader does: no powers of ten, three digits."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.adf import Diagnostic, Severity
from ligature.adf.diagnostics import length, one_line


@given(st.floats(1e-6, 9999.0), st.sampled_from((2, 3)))
def test_a_length_keeps_its_digits(metres: float, digits: int) -> None:
    number, unit = length(metres, digits).split()
    assert float(number) * {"mm": 1e-3, "m": 1.0}[unit] == pytest.approx(metres, rel=0.5 * 10.0 ** (1 - digits))
    assert digits < 3 or metres > 999.0 or "e+" not in number


@pytest.mark.parametrize(
    ("metres", "digits", "text"),
    [(1.02e-4, 3, "0.102 mm"), (0.192, 3, "192 mm"), (1.04, 3, "1.04 m"), (0.9999, 3, "1 m"), (0.15, 2, "0.15 m")],
)
def test_lengths_from_a_metre_on_are_in_metres(metres: float, digits: int, text: str) -> None:
    assert length(metres, digits) == text


@given(st.text(max_size=30))
def test_a_finding_stays_one_line_of_what_a_terminal_shows(name: str) -> None:
    text = str(Diagnostic(Severity.WARNING, f"body '{name}' is odd"))
    assert text.isprintable() and text.splitlines() == [text]
    assert not name.isprintable() or name in text
    assert one_line("tab\t\nred \x1b[31m\x85é体") == r"tab\t\nred \x1b[31m\x85é体"
