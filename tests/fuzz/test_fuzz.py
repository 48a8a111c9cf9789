"""Two thousand mutants; `make fuzz` runs a hundred thousand."""

from __future__ import annotations

from tests.fuzz.run import run


def test_no_mutant_crashes_hangs_or_surprises() -> None:
    ended, failures = run(2000)
    assert failures == []
    assert ended["success"] > 200 and ended["finding"] > 200
