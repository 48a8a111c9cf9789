"""Measures of a task while it is done: by made-up states of a real scene."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.scene import Scene
from ligature.model.state import new_state
from ligature.tasks import MissingBodies, Monitor


@pytest.fixture(scope="module")
def scene(corpus: Path) -> Scene:
    return ligature.load(corpus / "suturing_scene" / "launch.yaml", models=[10, 11, 6, 7, 8, 9])


def test_a_scene_that_is_no_task_is_refused() -> None:
    small = Path(__file__).resolve().parents[2] / "scenes" / "suturing_small" / "launch.yaml"
    with pytest.raises(MissingBodies):
        Monitor(ligature.load(small))


@pytest.mark.corpus
def test_ways_forces_and_drops_are_measured(scene: Scene) -> None:
    monitor, state = Monitor(scene), new_state(scene)[0]
    needle, tip = monitor.scenery.needle, monitor.scenery.tips[0]
    for k in range(101):
        state["sim_time"] = 0.01 * k
        state["body_pose"][tip, 0] = 0.001 * k
        state["rod_tension"][list(monitor.scenery.thread)] = 0.3 if k == 50 else 0.1
        state["insertion_count"] = 2 if 20 <= k < 40 else 0
        state["insertion_body"][:2] = needle
        state["insertion_force"][:2] = [[0.3, 0.0, 0.0], [0.0, 0.4, 0.0]]
        state["jaw_body"][0] = needle if 40 <= k < 60 else -1
        state["body_twist"][needle, 2] = -0.3 if k > 65 else 0.0
        monitor.observe(state)
    measures = monitor.measures()
    assert measures.time == pytest.approx(1.0)
    assert measures.path_lengths == pytest.approx({"PSM1": 0.1, "PSM2": 0.0})
    assert measures.tissue_force == pytest.approx(0.7)
    assert measures.tissue_force_mean == pytest.approx(0.7)
    assert measures.thread_tension == pytest.approx(0.3)
    assert measures.drops == 1
    assert any("drops of the needle: 1" in line for line in measures.lines())


@pytest.mark.corpus
def test_a_needle_that_falls_without_having_been_held_was_not_dropped(scene: Scene) -> None:
    monitor, state = Monitor(scene), new_state(scene)[0]
    state["body_twist"][monitor.scenery.needle, 2] = -1.0
    for _ in range(5):
        monitor.observe(state)
    assert monitor.measures().drops == 0


@pytest.mark.corpus
def test_a_trembling_tip_goes_no_way(scene: Scene) -> None:
    monitor, state = Monitor(scene), new_state(scene)[0]
    rng = np.random.default_rng(1)
    for _ in range(100):
        state["body_pose"][monitor.scenery.tips[0], :3] = 2e-6 * rng.standard_normal(3)
        monitor.observe(state)
    assert monitor.measures().path_lengths["PSM1"] == 0.0
