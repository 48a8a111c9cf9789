"""Some bodies that commands control by pose and release anywhere; `make fuzz` releases hundreds."""

from __future__ import annotations

import pytest

from tests.fuzz.release import run

SHORT = [("crowd", 10.0, range(4)), ("pad", 4.0, range(2)), ("pad with thread", 4.0, range(2))]


@pytest.mark.parametrize(("stage", "after", "number"), [(s, after, n) for s, after, numbers in SHORT for n in numbers])
def test_a_body_that_is_released_anywhere_comes_to_rest_within_its_surroundings(
    stage: str, after: float, number: int
) -> None:
    verdict = run(stage, number, after)
    assert not verdict.faults, str(verdict)


@pytest.mark.corpus
def test_so_does_the_needle_of_half_a_kilogram(corpus: object) -> None:
    verdict = run("lab", 0, 4.0)
    assert not verdict.faults, str(verdict)
