"""A thousand mutants, forty scenes, and that the harness would report; `make fuzz` runs a hundred times as many."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from tests.fuzz import run as harness
from tests.fuzz.attempt import attempt
from tests.fuzz.run import SCENE_LIMIT, SCENES, mutant, run
from tests.fuzz.seeds import Seed, seeds, write_scene


def test_no_mutant_crashes_hangs_or_surprises() -> None:
    outcome = run(500, jobs=2)
    assert outcome.failures == []
    assert sum(outcome.ended.values()) == 500
    assert min(outcome.total(verdict) for verdict in ("clean", "findings", "refused")) > 25


def test_what_check_passes_runs_a_second_finite_and_slow() -> None:
    outcome = run(40, jobs=2, limit=SCENE_LIMIT, campaign=SCENES, chunk=20)
    assert outcome.failures == []
    assert outcome.total("clean") > 30


@pytest.mark.parametrize("seed", seeds(), ids=lambda seed: seed.name)
def test_every_seed_is_accepted(seed: Seed, tmp_path: Path) -> None:
    write_scene(tmp_path)
    assert attempt(seed, tmp_path, 1) in ("clean", "findings")


def test_a_mutant_is_the_same_in_every_run() -> None:
    assert [mutant(n)[1] for n in range(200)] == [mutant(n)[1] for n in range(200)]
    assert sum(mutant(n)[1] != mutant(n)[0].data for n in range(200)) > 180


def surprise(seed: Seed, folder: Path, number: int) -> str:
    """Raises on one mutant."""
    if number == 3:
        raise KeyError("surprise")
    return "clean"


def die(seed: Seed, folder: Path, number: int) -> str:
    """Ends the process on one mutant, as a segmentation fault would."""
    if number == 3:
        os.abort()
    return "clean"


def hang(seed: Seed, folder: Path, number: int) -> str:
    """Does not come back from one mutant."""
    if number == 3:
        time.sleep(60)
    return "clean"


@pytest.mark.parametrize(
    ("attempt", "reason"),
    [(surprise, "failure: KeyError"), (die, "crash (status -6)"), (hang, "hang (more than 1 s)")],
)
def test_the_harness_reports_failures_and_goes_on(
    attempt: harness.Attempt, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(harness, "KEPT", tmp_path)
    outcome = run(8, attempt=attempt, limit=1.0)
    (failure,) = outcome.failures
    assert failure.startswith("mutant 3 of ") and reason in failure
    assert outcome.total("clean") == 7 and outcome.total("failure") == 1
    (kept,) = tmp_path.iterdir()
    assert kept.read_bytes() == mutant(3)[1]
