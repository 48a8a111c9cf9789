"""Small scenes without gravity for the tests of sensors."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import ligature
import pytest
from ligature import Simulation

Make = Callable[[str], Simulation]


@pytest.fixture
def simulate(tmp_path: Path) -> Make:
    def make(text: str) -> Simulation:
        (tmp_path / "m.yaml").write_text("namespace: /ambf/env/\ngravity: {x: 0, y: 0, z: 0}\n" + text)
        return Simulation(ligature.load(tmp_path / "m.yaml"))

    return make
