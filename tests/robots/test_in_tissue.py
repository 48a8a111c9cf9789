"""An arm whose tip is put inside a body: it is pushed out or reports a fault, nothing else is hurt, and it works again."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.robots.operating_state import State

SCENE = Path(__file__).resolve().parents[2] / "scenes" / "suturing" / "launch.yaml"


@pytest.mark.parametrize("depth", [0.003, 0.010, 0.020])
def test_a_tip_put_into_the_pad_hurts_nothing_and_works_again(depth: float) -> None:
    sim = ligature.Simulation(ligature.load(SCENE))
    arm, base = sim.arms["PSM1"], sim.scene.arms[0].base
    arm.enable()
    arm.home()
    sim.step(2500)
    T_base = pose7_matrix(sim.state["body_pose"][0, base])
    inside = T_base @ pose7_matrix(arm.local_measured_cp())
    inside[:3, 3] = [0.045, 0.24, 0.715 - depth]
    needle = sim.bodies["Needle"].pose
    home = arm.measured_js()[0].copy()

    arm.place_jp(arm.inverse_kinematics(home, matrix_pose7(inverse(T_base) @ inside)))
    sim.step(2000)
    assert np.isfinite(sim.state["body_pose"]).all() and np.isfinite(sim.state["body_twist"]).all()
    assert not sim.problems
    assert np.linalg.norm(sim.bodies["Needle"].pose[:3] - needle[:3]) < 0.02
    state = arm.operating_state.state
    assert state in (State.ENABLED, State.FAULT)

    arm.place_jp(home)
    if state is State.FAULT:
        arm.disable()
        arm.enable()
    sim.step(1000)
    arm.move_jp(home)
    sim.step(3000)
    assert arm.operating_state.state is State.ENABLED
    assert arm.measured_js()[0] == pytest.approx(home, abs=2e-3)
