"""The theatre that the tests of grasping share."""

from __future__ import annotations

import pytest
from ligature.simulation import Snapshot

from tests.grasping.theatre import Theatre


@pytest.fixture(scope="session")
def stage() -> tuple[Theatre, Snapshot]:
    """PSM1 holding the needle, and how that was remembered."""
    theatre = Theatre()
    theatre.hand_needle_to("PSM1")
    return theatre, theatre.sim.snapshot()


@pytest.fixture
def held(stage: tuple[Theatre, Snapshot]) -> Theatre:
    """PSM1 holds the needle, as if for the first time."""
    theatre, snapshot = stage
    theatre.sim.restore(snapshot)
    theatre.sim.problems.clear()
    return theatre
