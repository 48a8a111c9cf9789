"""An end of a thread that comes off the body which it is attached to, under more than its release force."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

GRAVITY, DENSITY, DIAMETER, LENGTH = 9.81, 8000.0, 0.001, 0.06
WEIGHT = GRAVITY * DENSITY * np.pi * DIAMETER**2 / 4 * LENGTH
"""Of a thread of heavy wire, N."""


def hanging(folder: Path, release: float | None, elements: int = 12) -> ligature.Simulation:
    """A thread that hangs straight down from a block that stands still."""
    key = "" if release is None else f"release force: {release!r}, "
    text = (
        "bodies: [BODY Block]\nsutures: [SUTURE wire]\nnamespace: /ambf/env/\n"
        "BODY Block: {name: Block, mass: 0.0, location: {position: {x: 0, y: 0, z: 1}, "
        "orientation: {r: 0, p: 0, y: 0}}, collision shape: BOX, collision geometry: {x: 0.02, y: 0.02, z: 0.02}}\n"
        f"SUTURE wire: {{name: wire, parent: BODY Block, length: {LENGTH}, diameter: {DIAMETER}, density: {DENSITY}, "
        f"youngs modulus: 1.0e+8, damping time: 0.02, elements: {elements}, {key}"
        "location: {position: {x: 0, y: 0, z: -0.0102}, orientation: {r: 3.14159265, p: 0, y: 0}}}\n"
    )
    (folder / "wire.yaml").write_text(text, encoding="utf-8")
    return ligature.Simulation(ligature.load(folder / "wire.yaml"))


def top(simulation: ligature.Simulation) -> float:
    """Height of the thread's first element."""
    return float(simulation.state[0]["body_pose"][simulation.scene.rods[0].bodies[0]][2])


def poses(simulation: ligature.Simulation) -> np.ndarray:
    """Poses of all bodies."""
    return np.array(simulation.state[0]["body_pose"])


@settings(max_examples=12, deadline=None)
@given(share=st.floats(0.3, 3.0).filter(lambda share: abs(share - 1.0) > 0.03), elements=st.integers(5, 20))
def test_a_thread_comes_off_when_it_weighs_more_than_the_release_force(
    share: float, elements: int, tmp_path_factory: pytest.TempPathFactory
) -> None:
    simulation = hanging(tmp_path_factory.mktemp("wire"), share * WEIGHT, elements)
    before = top(simulation)
    simulation.step(300)
    fallen = before - top(simulation)
    if share > 1.0:
        assert abs(fallen) < 1e-4
    else:
        assert fallen == pytest.approx(0.5 * GRAVITY * 0.3**2, rel=0.1)


def test_without_a_release_force_nothing_comes_off(tmp_path: Path) -> None:
    simulation = hanging(tmp_path, None)
    before = top(simulation)
    simulation.step(300)
    assert top(simulation) == pytest.approx(before, abs=1e-4)


def test_it_comes_off_again_after_a_reset_and_in_a_restored_state(tmp_path: Path) -> None:
    simulation = hanging(tmp_path, 0.8 * WEIGHT)
    first = top(simulation)
    simulation.step(100)
    fallen = top(simulation)
    assert fallen < first - 0.01
    falling = simulation.snapshot()
    simulation.step(50)
    further = poses(simulation)

    simulation.reset()
    assert top(simulation) == pytest.approx(first)
    simulation.step(100)
    assert top(simulation) == fallen
    simulation.step(50)
    assert np.array_equal(poses(simulation), further)

    simulation.reset()
    simulation.restore(falling)
    simulation.step(50)
    assert np.array_equal(poses(simulation), further)


def test_a_body_that_is_put_elsewhere_takes_along_what_hangs_on_it_but_not_what_has_come_off(tmp_path: Path) -> None:
    for release, follows in ((2.0 * WEIGHT, True), (0.5 * WEIGHT, False)):
        simulation = hanging(tmp_path, release)
        simulation.step(30)
        simulation.bodies["BODY Block"].set_pose([0.1, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0])
        simulation.step(1)
        along = simulation.state[0]["body_pose"][simulation.scene.rods[0].bodies[0]][0]
        assert along == pytest.approx(0.1 if follows else 0.0, abs=1e-3)
