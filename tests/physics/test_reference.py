"""Against traces recorded from AMBF: joint steps of the corpus PSM, and the suturing scene at rest."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation

HOME = np.array([0, 0, 0.1, 0, 0, 0, 0.5, 0.5])
STEPS = np.array([0.2, 0.2, 0.02, 0.3, 0.3, 0.3, -0.5, -0.5])
UPDATE = 5
"""Ticks of an update of the recorded session (-p 200)."""


@pytest.fixture(scope="module")
def recorded(golden: Path) -> dict[str, np.ndarray]:
    """Joint positions (updates, 8) by phase of the recorded session."""
    phases: dict[str, list[list[float]]] = {}
    with gzip.open(golden / "traces" / "jstep_psm1_p200_dt5ms.csv.gz", "rt") as file:
        for row in csv.DictReader(file):
            phases.setdefault(row["phase"], []).append([float(row[f"q{i}"]) for i in range(8)])
    return {name: np.array(rows) for name, rows in phases.items()}


@pytest.fixture(scope="module")
def replayed(corpus: Path) -> dict[str, np.ndarray]:
    """The same session here."""
    simulation = Simulation(ligature.load(corpus / "suturing_scene" / "launch.yaml", [6, 7]))
    base = simulation.bodies["psm1/BODY base link simple"]
    joints = list(base.body.joints)
    phases: dict[str, np.ndarray] = {}

    def hold(name: str, target: np.ndarray, updates: int) -> None:
        base.command_joints(target)
        rows = []
        for _ in range(updates):
            simulation.step(UPDATE)
            rows.append(np.array(simulation.state["joint_position"][0, joints]))
        phases[name] = np.array(rows)

    simulation.step(100 * UPDATE)
    hold("home", HOME, 300)
    for i in range(8):
        target = HOME.copy()
        target[i] += STEPS[i]
        hold(f"step_j{i}", target, 150)
        hold(f"late_j{i}", target, 150)
        hold(f"home_j{i}", HOME, 300)
    return phases


@pytest.mark.parametrize("joint", range(2, 8))
def test_steps_follow_the_reference_from_50_ms_on(joint: int, recorded: dict, replayed: dict) -> None:
    ours = replayed[f"step_j{joint}"][10:, joint]
    path = recorded[f"step_j{joint}"][:, joint]
    # the reference chatters at the rate of its loop for the first 100 ms: its mean over two updates is compared
    theirs = (path[10:] + path[9:-1]) / 2
    assert np.abs(ours - theirs).max() <= 0.10 * abs(STEPS[joint])
    assert abs(ours[-1] - theirs[-1]) <= 0.005 * abs(STEPS[joint])


@pytest.mark.parametrize("joint", range(8))
def test_every_joint_arrives(joint: int, replayed: dict) -> None:
    target = HOME[joint] + STEPS[joint]
    assert abs(replayed[f"late_j{joint}"][-1, joint] - target) <= 0.005 * abs(STEPS[joint])


@pytest.mark.parametrize("joint", range(8))
def test_a_step_does_not_overshoot_or_chatter(joint: int, replayed: dict) -> None:
    path = (replayed[f"step_j{joint}"][:, joint] - HOME[joint]) / STEPS[joint]
    assert path.max() <= 1.002
    assert np.diff(path).min() >= -2e-3


def test_a_step_disturbs_the_other_joints_less_than_in_the_reference(recorded: dict, replayed: dict) -> None:
    def disturbance(phases: dict, joint: int) -> float:
        others = [i for i in range(8) if i not in (joint, 2)]
        return float(np.abs(phases[f"step_j{joint}"][:, others] - HOME[others]).max())

    ours = [disturbance(replayed, i) for i in range(8)]
    theirs = [disturbance(recorded, i) for i in range(8)]
    assert max(ours) < 0.5 * max(theirs)
    assert sum(o <= t + 1e-4 for o, t in zip(ours, theirs, strict=True)) >= 7


def test_needle_and_phantom_rest_where_they_rest_in_the_reference(corpus: Path, golden: Path) -> None:
    last = {}
    with gzip.open(golden / "traces" / "rest_orig_p200_dt5ms.csv.gz", "rt") as file:
        for row in csv.DictReader(file):
            last[row["topic"]] = [float(row[k]) for k in ("px", "py", "pz")]
    simulation = Simulation(ligature.load(corpus / "suturing_scene" / "launch.yaml", [10, 11, 6, 7, 8, 9]))
    simulation.step(3000)
    for name in ("Needle", "Phantom"):
        pose = simulation.bodies[f"/ambf/env/phantom/{name}"].pose
        assert np.linalg.norm(pose[:3] - last[f"/ambf/env/phantom/{name}"]) <= 5e-4
