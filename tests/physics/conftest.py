"""Small scenes written as ADF text."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import ligature
import pytest
from ligature import Simulation


@pytest.fixture
def simulate(tmp_path: Path) -> Callable[[str], Simulation]:
    """Makes a simulation of one model file's text."""

    def make(text: str) -> Simulation:
        (tmp_path / "model.yaml").write_text("namespace: /ambf/env/\n" + text, encoding="utf-8")
        return Simulation(ligature.load(tmp_path / "model.yaml"))

    return make
