"""The needle after the challenge's verification program, by its recorded commands, has fallen silent."""

from __future__ import annotations

import csv
import gzip
from pathlib import Path

import numpy as np
import pytest
from ligature import Simulation, load
from ligature.model.commands import BodyCommand, CommandType, Release

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "suturing" / "launch.yaml"
SILENCE, AFTER = 0.5, 10.0


def recorded(golden: Path, run: str) -> list[tuple[float, tuple[float, ...]]]:
    """Times and poses of one run's position commands; those before did nothing."""
    with gzip.open(golden / "needle_through_holes.csv.gz", "rt") as file:
        rows = [row for row in csv.DictReader(file) if row["run"] == run and row["command_type"] == "1"]
    columns = ("x", "y", "z", "qx", "qy", "qz", "qw")
    begin = float(rows[0]["t"])
    return [(float(row["t"]) - begin, tuple(float(row[c]) for c in columns)) for row in rows]


@pytest.mark.slow
@pytest.mark.parametrize("update", [1, 5])
@pytest.mark.parametrize("run", ["1", "2"])
def test_the_recorded_commands_leave_the_needle_at_rest_on_the_pad(golden: Path, run: str, update: int) -> None:
    """One of these ended at 173 m/s: which one depended on the phase of commands and updates."""
    commands = recorded(golden, run)
    sim = Simulation(load(SCENE), 1e-3, update * 1e-3)
    needle = sim.bodies["Needle"]
    sim.step(1000)
    begin, done = sim.time, 0
    while done < len(commands) or sim.time - begin < commands[-1][0] + SILENCE:
        while done < len(commands) and commands[done][0] <= sim.time - begin:
            sim.apply(BodyCommand(needle.body.index, CommandType.POSITION, commands[done][1]))
            done += 1
        sim.step(update)
    sim.apply(Release("body", needle.body.index))
    top_speed, end = 0.0, sim.time + AFTER
    while sim.time < end:
        sim.step(update)
        top_speed = max(top_speed, float(np.linalg.norm(needle.twist[:3])))
    assert top_speed < 1.5
    assert np.linalg.norm(needle.twist) < 0.05
    assert needle.pose[2] == pytest.approx(0.717, abs=0.01)
    assert not [problem for problem in sim.problems if problem.code == "diverged"]
