"""States that are recorded can be read with numpy alone."""

from __future__ import annotations

import json
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.cockpit.statelog import FIELDS, INTERVAL, StateLog

from tests.cockpit.conftest import SMALL


def test_a_log_holds_what_the_states_said(tmp_path: Path) -> None:
    sim = ligature.Simulation(ligature.load(str(SMALL)))
    log = StateLog(sim.scene, sim.state.dtype, tmp_path / "recordings")
    times, needle = [], []
    for _ in range(20):
        sim.step(10)
        log.observe(sim.state)
        times.append(sim.time)
        needle.append(sim.bodies["Needle"].pose)
    assert not list(tmp_path.rglob("*.npy")), "a file has its name when it is whole"
    path = log.close()
    rows = np.load(path)
    assert rows.dtype.names == FIELDS
    assert np.diff(rows["sim_time"]).min() > 0.9 * INTERVAL
    assert rows["sim_time"] == pytest.approx(times[::2])
    legend = json.loads(path.with_suffix(".json").read_text(encoding="utf-8"))
    column = next(i for i, name in enumerate(legend["bodies"]) if name.endswith("BODY Needle"))
    assert rows["body_pose"][:, column] == pytest.approx(np.array(needle[::2]))
    assert legend["arms"] == [arm.name for arm in sim.scene.arms]
    assert not list(tmp_path.rglob("*.part"))
    sim.close()
