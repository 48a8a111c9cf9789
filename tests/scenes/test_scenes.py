"""What every scene of ours must do: load without complaint, run, stay finite, repeat bit for bit."""

from __future__ import annotations

import importlib.util
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.adf import Severity

SCENES = Path(__file__).resolve().parents[2] / "scenes"
LAUNCHES = sorted(SCENES.glob("*/launch.yaml"))


@pytest.fixture(scope="module", params=LAUNCHES, ids=lambda path: path.parent.name)
def launch(request: pytest.FixtureRequest) -> Path:
    return request.param


def run(launch: Path, ticks: int) -> ligature.Simulation:
    simulation = ligature.Simulation(ligature.load(launch))
    simulation.step(ticks)
    return simulation


def test_loads_without_warnings(launch: Path) -> None:
    findings = [d for d in ligature.load(launch).diagnostics if d.severity >= Severity.WARNING]
    assert not findings, "\n".join(map(str, findings))


def test_runs_a_second_and_stays_finite(launch: Path) -> None:
    simulation = run(launch, 1000)
    assert simulation.time == pytest.approx(1.0)
    for name in ("body_pose", "body_twist", "joint_position", "joint_velocity"):
        assert np.isfinite(simulation.state[name]).all(), name


def test_repeats_bit_for_bit(launch: Path) -> None:
    assert run(launch, 300).state_hash() == run(launch, 300).state_hash()


def test_files_are_what_their_script_writes() -> None:
    script = SCENES / "author_suturing_small.py"
    spec = importlib.util.spec_from_file_location("author_suturing_small", script)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    for name, document in module.documents().items():
        assert (SCENES / "suturing_small" / name).read_text(encoding="utf-8") == module.text(document), name
