"""Small moments of inertia, against the closed forms of free bodies."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.cli.check import findings
from ligature.model.frames import pose7_matrix
from ligature.physics import inertias
from ligature.physics.inertias import LEAST_INERTIA, LEAST_MASS, inertia_of

Make = Callable[[str], Simulation]
Moments = tuple[float, float, float]

FREE = (
    "gravity: {{x: 0, y: 0, z: 0}}\nbodies: [Floor, Needle]\nFloor: {{name: Floor, mass: 0, location: {{}}}}\n"
    "Needle: {{name: Needle, mass: {mass}, gravity: {{x: 0, y: 0, z: 0}}, inertial offset: {{}}, damping: {{linear: 0, angular: 0}}, "
    "inertia: {{ix: {0}, iy: {1}, iz: {2}}}}}\n"
)

ONCE = settings(
    max_examples=25,
    deadline=None,
    derandomize=True,
    suppress_health_check=[HealthCheck.function_scoped_fixture],
)


@st.composite
def moments(draw: st.DrawFn) -> Moments:
    """Moments that a solid can have, from those of a needle of 0.03 mm wire on; the smallest first."""
    least = 10.0 ** draw(st.floats(-14.99, -7.0))
    middle = least * draw(st.floats(1.0, 500.0))
    return least, middle, draw(st.floats(max(middle - least, middle), middle + least))


@given(own=moments(), mass=st.floats(1e-9, 1e-3), axis=st.integers(0, 2))
@ONCE
def test_a_moment_turns_a_free_needle_as_its_inertia_states(
    own: Moments, mass: float, axis: int, simulate: Make
) -> None:
    simulation = simulate(FREE.format(*own, mass=mass))
    needle = simulation.bodies["Needle"]
    torque = np.zeros(3)
    torque[axis] = 30.0 * own[axis] / simulation.dt  # for 30 rad/s after a tick
    needle.command_wrench([0.0, 0.0, 0.0, *torque])
    simulation.step()
    needle.command_wrench([0.0] * 6)
    turn = simulation.state["body_twist"][0, needle.body.index, 3:].copy()
    assert turn == pytest.approx(torque * simulation.dt / np.array(own), rel=1e-6)
    simulation.step(100)
    assert simulation.state["body_twist"][0, needle.body.index, 3:] == pytest.approx(turn, rel=1e-6)
    simulation.close()


@given(size=st.floats(-14.9, -8.0), ratio=st.floats(1.0, 1.9))
@ONCE
def test_the_axis_of_a_symmetric_needle_goes_round_its_momentum(size: float, ratio: float, simulate: Make) -> None:
    """Goldstein, Classical Mechanics, section 5.6: the angular velocity turns about the axis at (I₃ − I₁)/I₁ ω₃."""
    across = 10.0**size
    along = ratio * across
    simulation = simulate(FREE.format(across, across, along, mass=1e-6))
    needle = simulation.bodies["Needle"]
    start = np.array([1.0, 0.0, 20.0])
    needle.command_wrench([0.0, 0.0, 0.0, *(start * np.array([across, across, along]) / simulation.dt)])
    simulation.step()
    needle.command_wrench([0.0] * 6)
    T0 = pose7_matrix(needle.pose)[:3, :3]
    w0 = T0.T @ simulation.state["body_twist"][0, needle.body.index, 3:]
    ticks = 100
    simulation.step(ticks)
    w = pose7_matrix(needle.pose)[:3, :3].T @ simulation.state["body_twist"][0, needle.body.index, 3:]
    angle = (along - across) / across * w0[2] * ticks * simulation.dt
    expected = [w0[0] * np.cos(angle) - w0[1] * np.sin(angle), w0[0] * np.sin(angle) + w0[1] * np.cos(angle), w0[2]]
    assert w == pytest.approx(expected, abs=0.05)
    simulation.close()


@pytest.mark.parametrize(
    ("own", "used", "text"),
    [
        ((1e-12, 1e-12, 1e-12), (1e-12, 1e-12, 1e-12), ""),
        ((3e-17, 1e-12, 1e-12), (LEAST_INERTIA, 1e-12, 1e-12), "moments below 1e-15 kg m² cannot be simulated"),
        ((0.0, 1e-12, 1e-11), (4e-11, 1e-12, 1e-11), "give 'inertia'; these are a ball's of 1 cm radius"),
        ((1e-3, 1e-12, 2e-3), (1e-5, 1e-12, 1e-5), "moments above 1e+07 times the smallest cannot be simulated"),
        (
            (1e12, 1e-4, 2e-4),
            (3e-3, 1e-4, 2e-4),
            "no body has a moment above the sum of the others; at most 10 times that is simulated",
        ),
        ((2e-3, 1e-3, 1e-4), (2e-3, 1e-3, 1e-4), ""),
    ],  # fmt: skip
)
def test_moments_that_are_replaced_are_reported(
    own: Moments, used: Moments, text: str, simulate: Make, tmp_path: Path
) -> None:
    simulation = simulate(FREE.format(*own, mass=1e-6))
    assert inertia_of(simulation.scene.bodies[1]) == pytest.approx(used)
    simulation.close()
    found = [d for d in findings(tmp_path / "model.yaml", [], False) if d.code == "inertia"]
    assert [str(d).rpartition("; ")[2] for d in found] == ([text.rpartition("; ")[2]] if text else [])
    assert all("body 'Needle'" in d.message and d.mark is not None and d.mark.line == 5 for d in found)


LIMB = (
    "gravity: {{x: 0, y: 0, z: {gravity}}}\nbodies: [Wall, Upper, Lower]\njoints: [Ball, Hinge]\n"
    "Wall: {{name: Wall, mass: 0, location: {{}}}}\n"
    "Upper: {{name: Upper, mass: 0.03, inertia: {{ix: {0}, iy: {1}, iz: {2}}}, "
    "location: {{position: {{x: 0.07, y: 0, z: 0}}}}}}\n"
    "Lower: {{name: Lower, mass: 0.3, inertia: {{ix: 0.001, iy: 0.001, iz: 0.001}}, "
    "location: {{position: {{x: 0.14, y: 0, z: 0}}}}}}\n"
    "Ball: {{name: Ball, type: p2p, parent: Wall, child: Upper, parent axis: {{x: 0, y: 0, z: 1}}, "
    "child axis: {{x: 0, y: 0, z: 1}}, parent pivot: {{x: 0, y: 0, z: 0}}, child pivot: {{x: -0.07, y: 0, z: 0}}}}\n"
    "Hinge: {{name: Hinge, type: revolute, parent: Upper, child: Lower, parent axis: {{x: 1, y: 2, z: 3}}, "
    "child axis: {{x: 1, y: 2, z: 3}}, parent pivot: {{x: 0.035, y: 0, z: 0}}, child pivot: {{x: -0.035, y: 0, z: 0}}}}\n"
)
"""A body whose moments are given hangs by a ball joint, and another one by an oblique hinge on it."""

SMALL, LARGE = (st.floats(*span).map(lambda exponent: 10.0**exponent) for span in ((-9.0, -4.0), (-4.0, 11.9)))


@given(own=st.tuples(SMALL, SMALL, LARGE).flatmap(st.permutations), gravity=st.sampled_from([0.0, -9.81]))
@ONCE
def test_bodies_with_any_moments_swing_no_faster_than_they_fall(
    own: list[float], gravity: float, simulate: Make
) -> None:
    simulation = simulate(LIMB.format(*own, gravity=gravity))
    assert len(simulation.scene.joints) == 2
    for _ in range(40):
        simulation.step(25)
        assert np.isfinite(simulation.state["body_pose"]).all()
        assert np.linalg.norm(simulation.state["body_twist"][0, :, :3], axis=1).max() < 5.0
    assert not [problem for problem in simulation.problems if problem.code == "diverged"]
    simulation.close()


@given(least=st.floats(-6.0, -3.0).map(lambda e: 10.0**e), excess=st.floats(1.0, 10.0).map(lambda e: 10.0**e))
@ONCE
def test_what_hangs_on_a_body_that_no_real_one_is_like_turns_no_faster_than_it_is_pushed(
    least: float, excess: float, simulate: Make
) -> None:
    """The largest moment of the upper body exceeds the sum of the others."""
    simulation = simulate(LIMB.format(excess * least, least, least, gravity=-9.81))
    simulation.bodies["Lower"].command_wrench([0.0, 0.0, 0.0, 0.02, 0.03, 0.04])
    simulation.step(100)
    simulation.bodies["Lower"].command_wrench([0.0] * 6)
    for _ in range(40):
        simulation.step(25)
        assert np.linalg.norm(simulation.state["body_twist"][0, :, :3], axis=1).max() < 5.0
    simulation.close()


@pytest.mark.parametrize("mass", [5e-324, 1e-300, 1e-17])
def test_a_mass_too_small_to_move_is_reported(mass: float, simulate: Make) -> None:
    text = "bodies: [B]\nB: {{name: B, mass: {}, inertia: {{ix: 1, iy: 1, iz: 1}}}}\n"
    (found,) = inertias.findings(simulate(text.format(mass)).scene)
    assert "too little to move; give at least 1e-15 kg" in str(found)
    lightest = simulate(text.format(LEAST_MASS))
    assert not inertias.findings(lightest.scene)
    lightest.step(100)
    assert lightest.bodies["B"].pose[2] == pytest.approx(-0.5 * 9.8 * 0.1**2, rel=0.02)
