"""A simulation from which the tests of a file record."""

from __future__ import annotations

from collections.abc import Iterator

import ligature
import pytest

from tests.conftest import ROOT


@pytest.fixture(scope="module")
def simulation() -> Iterator[ligature.Simulation]:
    found = ligature.Simulation(ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml"))
    yield found
    found.close()
