"""Ticks in which only bodies, joints and threads have work are one compiled call, with the bits of single ticks."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cache

import ligature
import numpy as np
import pybullet
import pytest
from ligature import Simulation
from ligature.environments.experts import demonstrate
from ligature.environments.suturing import SuturingEnv
from ligature.model.commands import BodyCommand, Command, CommandType, Release, WatchContacts
from ligature.model.scene import Scene
from ligature.robots.commands import Adopt, MoveJr, ServoJr, ServoJv
from ligature.robots.operating_state import State

from tests.conftest import ROOT


@cache
def scene() -> Scene:
    """An arm, a board and six rubber blocks."""
    return ligature.load(ROOT / "scenes" / "peg_transfer" / "launch.yaml", [0, 1, 2])


def firm(scene: Scene) -> Scene:
    """``scene`` with nothing that a jaw could grasp: jaws do not search there."""
    blocks = [body.index for body in scene.bodies if body.identity.name.startswith("Block")]
    return replace(scene, bodies=tuple(replace(b, mass=0.0) if b.index in blocks else b for b in scene.bodies))


@pytest.fixture
def pair(monkeypatch: pytest.MonkeyPatch) -> Callable[..., tuple[Simulation, Simulation, list[int]]]:
    """Two simulations, of which the second one never coasts, and the ticks that the first one coasts or begins."""

    def make(of: Scene | None = None) -> tuple[Simulation, Simulation, list[int]]:
        of = of or scene()
        first, second, passed = Simulation(of), Simulation(of), [0, 0]
        coast = first._ticking.coasting.pass_ticks

        def counted(ticks: int, begins: bool = False) -> tuple[int, int]:
            found, begun = coast(ticks, begins)
            passed[0] += found
            passed[1] += begun > 0
            return found, begun

        monkeypatch.setattr(first._ticking.coasting, "pass_ticks", counted)
        monkeypatch.setattr(second._ticking.coasting, "pass_ticks", lambda ticks, begins: (0, 0))
        return first, second, passed

    return make


def _commands(rng: np.random.Generator) -> list[Command]:
    kind = int(rng.integers(9))
    block = int(rng.choice([body.index for body in scene().bodies if body.identity.name.startswith("Block")]))
    if kind == 0:
        return [Adopt(0), ServoJr(0, tuple(rng.uniform(-0.02, 0.02, 6).tolist()))]
    if kind == 1:
        return [Adopt(0), MoveJr(0, tuple(rng.uniform(-0.02, 0.02, 6).tolist()))]
    if kind == 2:
        return [Adopt(0), ServoJv(0, tuple(rng.uniform(-0.1, 0.1, 6).tolist()))]
    if kind == 3:
        return [BodyCommand(block, CommandType.FORCE, tuple((0.05 * rng.standard_normal(6)).tolist()))]
    if kind in (4, 7):
        return [Release("body", body.index) for body in scene().bodies]
    if kind == 5:
        return [Release("arm", 0), WatchContacts(bool(rng.integers(4) == 0))]
    return []


@pytest.mark.parametrize("seed", range(4))
def test_a_run_that_coasts_has_the_bits_of_one_that_does_not(
    seed: int, pair: Callable[..., tuple[Simulation, Simulation, list[int]]]
) -> None:
    *runs, passed = pair()
    rng = np.random.default_rng(seed)
    for k in range(40):
        commands, ticks = _commands(rng), int(rng.integers(1, 40))
        for simulation in runs:
            for command in commands:
                simulation.apply(command)
            simulation.step(ticks)
            if k == 15:
                simulation.reset()
        assert len({simulation.state_hash() for simulation in runs}) == 1, (k, commands, ticks)
        assert len({tuple(arm.time for arm in simulation.arms.values()) for simulation in runs}) == 1
    assert passed[0] > 60


@pytest.mark.parametrize("timeout", [0.012, 0.5])
def test_an_arm_off_its_course_stops_in_the_same_tick(
    timeout: float,
    pair: Callable[..., tuple[Simulation, Simulation, list[int]]],
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("ligature.robots.device.FOLLOWING_TIMEOUT", timeout)
    *runs, passed = pair(firm(scene()))
    rng = np.random.default_rng(7)
    for simulation in runs:
        arm = simulation.arms["PSM1"]
        arm._following_bounds = [1e-3] * 6
        arm.adopt()
    for k in range(12):
        step = tuple(rng.choice([0.0, 0.02], 6).tolist())
        for simulation in runs:
            simulation.apply(ServoJr(0, step))
            simulation.step(int(17 + k))
        assert len({simulation.state_hash() for simulation in runs}) == 1, k
        assert len({simulation.arms["PSM1"].operating_state for simulation in runs}) == 1, k
    assert (runs[0].arms["PSM1"].operating_state.state is State.FAULT) == (timeout < 0.1)
    assert passed[0] > 60


@cache
def sutured() -> Scene:
    """A needle with its thread, a pad and an arm."""
    return ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml")


def _needle(scene: Scene) -> int:
    return next(body.index for body in scene.bodies if body.identity.name == "Needle")


@pytest.mark.parametrize("seed", range(3))
def test_a_thread_that_coasts_has_the_bits_of_one_that_does_not(
    seed: int, pair: Callable[..., tuple[Simulation, Simulation, list[int]]]
) -> None:
    *runs, passed = pair(sutured())
    rng, needle = np.random.default_rng(seed), _needle(sutured())
    start = runs[0]._world.pose7(needle)
    for k in range(24):
        aside, up = rng.uniform(-0.08, 0.08, 2), rng.uniform(0.0, 0.06)
        goal = (*(start[:3] + [*aside, up]), *start[3:])
        push = tuple((0.02 * rng.standard_normal(6)).tolist())
        commands: list[Command] = {
            0: [BodyCommand(needle, CommandType.POSITION, goal)],
            1: [Release("body", needle)],
            2: [Adopt(0), ServoJr(0, tuple(rng.uniform(-0.02, 0.02, 6).tolist()))],
            3: [BodyCommand(needle, CommandType.FORCE, push)],
            4: [Release("arm", 0), Release("body", needle)],
        }.get(int(rng.integers(8)), [])
        thrown, ticks = rng.integers(6) == 0, int(rng.integers(1, 60))
        for simulation in runs:
            for command in commands:
                simulation.apply(command)
            if thrown:
                simulation.apply(Release("body", needle))
                simulation.set_pose(needle, np.array(goal))
            simulation.step(ticks)
            if k == 11:
                simulation.restore(simulation.snapshot())
        assert len({simulation.state_hash() for simulation in runs}) == 1, (k, commands, ticks)
    assert passed[0] > 60


def _demonstrated(task: str, seed: int, noise: float, coasts: bool) -> tuple[list[str], int, int]:
    """State hashes of an episode, and ticks that coasted while a jaw held something, and something was in a hole."""
    env = SuturingEnv(task, max_steps=180)
    simulation, hashes, carried, inserted = env.simulation, list[str](), 0, 0
    coast = simulation._ticking.coasting.pass_ticks

    def counted(ticks: int, begins: bool = False) -> tuple[int, int]:
        nonlocal carried, inserted
        within = bool(simulation.insertions)
        passed, begun = coast(ticks, begins) if coasts else (0, 0)
        inserted += passed if within else 0
        carried += passed if any(held is not None for held in simulation.grasps.values()) else 0
        return passed, begun

    def look(*_: object) -> None:
        hashes.append(simulation.state_hash())

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(simulation._ticking.coasting, "pass_ticks", counted)
        demonstrate(env, seed, noise, look, slips=True)
        for _ in range(8):  # the jaws open
            env.step(np.tile(np.array([0.0, 0.0, 0.2, 0.0, 0.0, 0.0, 1.0], dtype=np.float32), len(env.arms)))
            look()
    env.close()
    return hashes, carried, inserted


@pytest.mark.parametrize(
    ("task", "seed", "noise"), [("pick", 0, 0.05), ("insert", 0, 0.6), ("insert", 1, 0.6), ("peg_transfer", 0, 0.02)]
)
def test_jaws_that_search_hold_and_let_go_while_coasting_have_the_bits_of_those_that_do_not(
    task: str, seed: int, noise: float
) -> None:
    hashes, carried, _ = _demonstrated(task, seed, noise, True)
    assert hashes == _demonstrated(task, seed, noise, False)[0]
    assert carried > 100


@pytest.mark.parametrize(
    ("task", "seed", "noise"),
    [("insert", 2, 0.3), ("suture", 0, 0.3), pytest.param("pull_through", 0, 0.3, marks=pytest.mark.slow)],
)
def test_needles_and_threads_that_enter_and_leave_holes_while_coasting_have_the_bits_of_those_that_do_not(
    task: str, seed: int, noise: float
) -> None:
    hashes, _, inserted = _demonstrated(task, seed, noise, True)
    assert hashes == _demonstrated(task, seed, noise, False)[0]
    assert inserted > 500


def test_a_coast_ends_in_the_tick_in_which_other_bodies_come_near_a_thread(
    pair: Callable[..., tuple[Simulation, Simulation, list[int]]],
) -> None:
    *runs, passed = pair(sutured())
    needle = _needle(sutured())
    pose = runs[0]._world.pose7(needle)
    pose[2] += 0.08
    for simulation in runs:
        simulation.set_pose(needle, pose)
    for k in range(40):
        for simulation in runs:
            simulation.step(10)
        assert len({simulation.state_hash() for simulation in runs}) == 1, k
    assert passed[0] > 60
    assert passed[1] > 0


def test_a_thread_that_diverges_while_coasting_is_put_back_in_the_same_tick(
    pair: Callable[..., tuple[Simulation, Simulation, list[int]]],
) -> None:
    *runs, passed = pair(sutured())
    for simulation in runs:
        simulation.step(20)
    begin = passed[0]
    for simulation in runs:
        (rod,) = simulation._suture.rods.rods
        rod.nodes.v[rod.first + 5] = 0.0, 0.0, 1e7
        simulation.step(20)
    assert passed[0] > begin
    found = [[p.code for p in simulation.problems] for simulation in runs]
    assert found[0] == found[1]
    assert "diverged" in found[0]
    assert len({simulation.state_hash() for simulation in runs}) == 1


def test_a_body_that_diverges_while_coasting_is_put_back_in_the_same_tick(
    pair: Callable[..., tuple[Simulation, Simulation, list[int]]],
) -> None:
    *runs, passed = pair()
    for simulation in runs:
        simulation.step(20)
    begin = passed[0]
    for simulation in runs:
        engine = simulation._world.engine
        place = engine.place_of[next(b.index for b in scene().bodies if b.identity.name == "Block2")]
        pybullet.resetBaseVelocity(place.uid, [0.0, 0.0, 1e5], [0.0] * 3, physicsClientId=engine.client)
        engine.motions.forget(place.tree)
        simulation.step(20)
    assert passed[0] > begin
    assert [[str(p) for p in simulation.problems if p.code == "diverged"] for simulation in runs] == 2 * [
        [str(p) for p in runs[1].problems if p.code == "diverged"]
    ]
    assert any("Block2" in str(problem) for problem in runs[0].problems)
    assert len({simulation.state_hash() for simulation in runs}) == 1


def test_a_coast_that_fails_is_reported_and_the_run_goes_on(monkeypatch: pytest.MonkeyPatch) -> None:
    simulation = Simulation(scene())
    simulation.step(20)

    def broken(ticks: int, begins: bool) -> tuple[int, int]:
        raise ZeroDivisionError("broken on purpose")

    with monkeypatch.context() as patch:
        patch.setattr(simulation._ticking.coasting, "pass_ticks", broken)
        before = simulation._clock.tick
        simulation.step(20)
        assert simulation._clock.tick == before + 20
    (problem,) = [problem for problem in simulation.problems if problem.code == "failed"]
    assert "'step' of World failed" in problem.message and "broken on purpose" in problem.message
    assert np.isfinite(simulation.state["body_pose"]).all()
