"""Plans of a throw: circles through the holes, lips or tissue of a scene, and holds that reach all of one."""

from __future__ import annotations

import ligature
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.frames import axis_rotation, frame, matrix_pose7
from ligature.robots.fitting import base_pose, kinematics_of
from ligature.robots.psm import Psm
from ligature.tasks.plans import BEFORE, BEYOND, COARSE, FINE, Planner, throws

SCENES = ("needle_insertion", "soft_suturing", "suturing")


def at_rest(name: str) -> tuple[ligature.Scene, np.void]:
    scene = ligature.load(name)
    simulation = ligature.Simulation(scene)
    state = simulation.state.copy()
    simulation.close()
    return scene, state[0]


@pytest.fixture(scope="module", params=SCENES)
def planned(request: pytest.FixtureRequest) -> tuple[Planner, np.void, np.ndarray]:
    """A planner for PSM2, the state, and the arm's base."""
    scene, state = at_rest(request.param)
    arm = next(arm for arm in scene.arms if arm.name == "PSM2")
    kinematics = kinematics_of(scene, arm)
    assert isinstance(kinematics, Psm)
    return Planner.of(scene, kinematics), state, base_pose(scene, arm)


def test_a_throw_goes_in_from_above_and_comes_out_again(planned: tuple[Planner, np.void, np.ndarray]) -> None:
    planner, state, _ = planned
    found = list(throws(planner.scene, state, planner.arc.radius, COARSE))
    assert found
    for throw in found:
        entry, exit = planner.entry(throw), planner.exit(throw)
        angles = np.linspace(0.0, throw.towards_exit, 9)[1:-1]
        arc = [throw.centre + planner.arc.radius * (throw.axes @ [np.cos(a), np.sin(a), 0.0]) for a in angles]
        assert max(point[2] for point in arc) < max(entry[2], exit[2]), "between its ends it is below both"
        tips = [throw.arc_at(a, planner.arc) for a in (0.0, throw.towards_exit)]
        local = planner.arc.radius * np.array([np.cos(planner.arc.end), np.sin(planner.arc.end), 0.0])
        for T, end in zip(tips, (entry, exit), strict=True):
            assert T[:3, :3] @ local + T[:3, 3] == pytest.approx(end, abs=1e-9)


def test_a_hold_reaches_the_whole_throw(planned: tuple[Planner, np.void, np.ndarray]) -> None:
    planner, state, base = planned
    pick = planner.pick(state, base)
    assert pick is not None and pick.drives
    hold = pick.T_arc_tool
    throw = planner.throw(state, base, hold)
    assert throw is not None
    way = [throw.arc_at(a, planner.arc) @ hold for a in np.linspace(-BEFORE, throw.towards_exit + BEYOND, 40)]
    path = planner.kinematics.inverse(np.linalg.inv(base) @ np.array(way))
    assert path.ok.all()
    reached, wanted = planner.kinematics.forward(path.q), np.linalg.inv(base) @ np.array(way)
    assert np.abs(reached[:, :3, 3] - wanted[:, :3, 3]).max() < 1e-6
    assert len(list(throws(planner.scene, state, planner.arc.radius, FINE))) >= len(
        list(throws(planner.scene, state, planner.arc.radius, COARSE))
    )


@given(st.floats(-0.9, 5.2))
def test_the_angle_of_the_tip_is_known_again(planned: tuple[Planner, np.void, np.ndarray], angle: float) -> None:
    planner, state, _ = planned
    throw = next(throws(planner.scene, state, planner.arc.radius, COARSE))
    T_body = throw.arc_at(angle, planner.arc) @ np.linalg.inv(planner.arc.T_body_arc)
    moved = state.copy()
    moved["body_pose"][planner.scene.needles[0].body] = matrix_pose7(T_body)
    assert planner.angle(moved, throw) == pytest.approx(angle, abs=1e-6)


def placed(planner: Planner, state: np.void, seed: int, over: bool) -> np.void:
    """A state with the needle elsewhere on its tissue, turned at random, and with its other side up."""
    rng, found = np.random.default_rng(seed), state.copy()
    body = planner.scene.needles[0].body
    arc = planner.needle(state)
    R = axis_rotation((0.0, 0.0, 1.0), float(rng.uniform(-np.pi, np.pi))) @ arc[:3, :3]
    R = R @ axis_rotation((1.0, 0.0, 0.0), np.pi) if over else R
    T = frame(R, arc[:3, 3] + np.append(rng.uniform(-0.006, 0.006, 2), 0.0))
    found["body_pose"][body] = matrix_pose7(T @ np.linalg.inv(planner.arc.T_body_arc))
    return found


@pytest.fixture(scope="module")
def pad() -> tuple[Planner, np.void, np.ndarray]:
    """A planner for the arm of `needle_insertion`, the state, and the arm's base."""
    scene, state = at_rest("needle_insertion")
    kinematics = kinematics_of(scene, scene.arms[0])
    assert isinstance(kinematics, Psm)
    return Planner.of(scene, kinematics), state, base_pose(scene, scene.arms[0])


@pytest.mark.parametrize("over", [False, True])
@pytest.mark.parametrize("count", [8, pytest.param(100, marks=pytest.mark.slow)])
def test_a_needle_that_lies_anyhow_can_be_picked_up_and_driven(
    pad: tuple[Planner, np.void, np.ndarray], count: int, over: bool
) -> None:
    """As it lies, or after it has been laid down in another direction: 95 of 100 placements at least."""
    planner, state, base = pad
    done = 0
    for seed in range(count):
        moved = placed(planner, state, seed, over)
        pick = planner.pick(moved, base)
        if pick is None:
            continue
        hold = pick.T_arc_tool
        if pick.drives:
            assert planner.throw(moved, base, hold) is not None, "the finer search finds what the coarser found"
            done += 1
        else:
            lie = planner.lie(moved, base, hold, planner.needle(moved))
            if lie is not None:
                after = moved.copy()
                body = planner.scene.needles[0].body
                after["body_pose"][body] = matrix_pose7(lie @ np.linalg.inv(planner.arc.T_body_arc))
                again = planner.pick(after, base)
                assert again is not None and again.drives, "it is laid down so that it can be driven"
                done += 1
    assert done >= 0.95 * count
