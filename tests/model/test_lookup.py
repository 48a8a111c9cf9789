"""Finding objects by text."""

from __future__ import annotations

from ligature.model.lookup import find_by_text

NAMES = ["/env/BODY Thread", "/env/BODY Thread_001", "/env/BODY Thread_002", "/env/BODY Needle"]


def test_an_exact_match_wins_over_parts() -> None:
    assert find_by_text(NAMES, "/env/BODY Thread") == 0


def test_a_part_that_only_one_name_has_is_enough() -> None:
    assert find_by_text(NAMES, "Needle") == 3


def test_a_part_that_several_names_have_finds_nothing() -> None:
    assert find_by_text(NAMES, "Thread_00") is None
    assert find_by_text(NAMES, "Knot") is None
