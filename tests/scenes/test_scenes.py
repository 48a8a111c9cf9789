"""What every scene of ours must do: load without complaint, run, stay finite, repeat bit for bit."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from types import ModuleType

import ligature
import numpy as np
import pytest
from ligature.adf import Severity
from PIL import Image

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


def authored_by(name: str) -> ModuleType:
    """An authoring script, imported."""
    spec = importlib.util.spec_from_file_location(name, SCENES / f"{name}.py")
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("scene", ["suturing_small", "suturing"])
def test_files_are_what_their_script_writes(scene: str) -> None:
    module = authored_by(f"author_{scene}")
    for name, text in module.texts().items():
        assert (SCENES / scene / name).read_text(encoding="utf-8") == text, name


def test_looks_are_what_their_script_writes() -> None:
    module = authored_by("author_looks")
    for name, text in module.files().items():
        assert (module.HERE / name).read_text(encoding="utf-8") == text, name
    for name, pixels in module.pictures().items():
        with Image.open(module.HERE / name) as image:
            assert np.abs(np.asarray(image, dtype=float) - pixels).mean() < 3.0, name  # of 255, by compression
