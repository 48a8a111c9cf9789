"""Ghosts: what is inside follows from where things are, whatever was measured before."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.adf.frames import axis_rotation
from ligature.model.frames import matrix_pose7, pose7_matrix
from ligature.sensing.ghosts import Ghosts

from tests.sensing.conftest import Make

BALL, GHOST, AT = 0.02, 0.005, np.array([0.1, 0.02, 0.0])
"""Radii of the ball and of the ghost, and where the ghost sits on its body."""

SURE = 3e-4
"""Distance between surfaces in metres from which on there is no doubt."""

SCENE = f"""
bodies: [BODY Stick, BODY Ball]
BODY Stick: {{name: Stick, mass: 1, inertia: {{ix: 1, iy: 1, iz: 1}}, location: {{position: {{x: 0, y: 0, z: 0}}}},
  collision margin: 0.0001, collision shape: BOX, collision geometry: {{x: 0.02, y: 0.02, z: 0.02}}}}
BODY Ball: {{name: Ball, mass: 1, inertia: {{ix: 1, iy: 1, iz: 1}}, location: {{position: {{x: 1, y: 0, z: 0}}}},
  collision margin: 0.0001, collision shape: SPHERE, collision geometry: {{radius: {BALL}}}}}
ghost objects: [GHOST g]
GHOST g: {{name: g, parent: BODY Stick, collision margin: 0.0001, collision shape: SPHERE,
  location: {{position: {{x: {AT[0]}, y: {AT[1]}, z: {AT[2]}}}}}, collision geometry: {{radius: {GHOST}}}}}
"""


@pytest.fixture
def sim(simulate: Make) -> Simulation:
    return simulate(SCENE)


def put(sim: Simulation, T: np.ndarray, offset: Sequence[float]) -> tuple[bool, float]:
    """Put the stick at ``T`` (4, 4) and the ball ``offset`` (3,) from the ghost; what is sensed, and the true gap."""
    ball = np.eye(4)
    ball[:3, 3] = (T @ np.append(AT, 1.0))[:3] + offset
    sim.bodies["Stick"].set_pose(matrix_pose7(T))
    sim.bodies["Ball"].set_pose(matrix_pose7(ball))
    there = pose7_matrix(sim.state["ghost_world"][0, 0])[:3, 3]
    gap = float(np.linalg.norm(ball[:3, 3] - there)) - BALL - GHOST
    return bool(sim.state["ghost_sensed"][0, 0, sim.bodies["Ball"].body.index]), gap


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=20, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), size=st.sampled_from([1e-4, 1e-3, 1e-2]))
def test_what_is_sensed_follows_from_the_distance_after_any_walk(sim: Simulation, seed: int, size: float) -> None:
    """The ghost's body turns and moves, the ball moves about it, both, either or none, in steps of every size."""
    rng = np.random.default_rng(seed)
    T, offset, seen = np.eye(4), rng.normal(size=3), set()
    offset *= (BALL + GHOST) / np.linalg.norm(offset)
    for _ in range(60):
        ghost_moves, ball_moves = rng.integers(2, size=2)
        if ghost_moves:
            axis, before = rng.normal(size=3), (T @ np.append(AT, 1.0))[:3]
            T[:3, :3] = T[:3, :3] @ axis_rotation(axis / np.linalg.norm(axis), 10.0 * size * rng.normal())
            T[:3, 3] += size * rng.normal(size=3)
            if not ball_moves:
                offset -= (T @ np.append(AT, 1.0))[:3] - before
        if ball_moves:
            offset += size * rng.normal(size=3)
        sensed, gap = put(sim, T, offset)
        if abs(gap) > SURE:
            assert sensed == (gap < 0.0)
            seen.add(sensed)
    assert seen or size < 1e-3


def test_a_ghost_is_measured_once_against_what_it_moves_along_with(
    simulate: Make, monkeypatch: pytest.MonkeyPatch
) -> None:
    sim = simulate(SCENE.replace(f"x: {AT[0]}, y: {AT[1]}", "x: 0.012, y: 0"))
    ghosts = next(part for part in sim._subsystems if isinstance(part, Ghosts))
    stick, rng, T = sim.bodies["Stick"], np.random.default_rng(0), np.eye(4)
    measured: list[int] = []
    measure = ghosts._queries.probe_gaps

    def note(probe: int, pose: np.ndarray, bodies: Sequence[int], within: float) -> Sequence[float]:
        measured.extend(bodies)
        return measure(probe, pose, bodies, within)

    monkeypatch.setattr(ghosts._queries, "probe_gaps", note)
    for _ in range(30):
        axis = rng.normal(size=3)
        T[:3, :3] = T[:3, :3] @ axis_rotation(axis / np.linalg.norm(axis), 0.3)
        T[:3, 3] += 0.2 * rng.normal(size=3)
        stick.set_pose(matrix_pose7(T))
        assert sim.state["ghost_sensed"][0, 0, stick.body.index]
    assert measured.count(stick.body.index) <= 1
