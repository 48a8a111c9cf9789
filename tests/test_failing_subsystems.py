"""What a subsystem raises, in whatever it does, is reported, bounded, and ends neither the run nor the other subsystems."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.coasting import Coasting
from ligature.model.commands import BodyCommand, CommandType, Reset
from ligature.model.scene import Scene
from ligature.model.subsystem import Subsystem
from ligature.simulation.subsystems import REST

from tests.conftest import ROOT


@cache
def scene() -> Scene:
    return ligature.load(ROOT / "scenes" / "suturing_small" / "launch.yaml")


SUBSYSTEMS = [type(subsystem).__name__ for subsystem in Simulation(scene())._subsystems]
STEPPING = [type(one).__name__ for one in Simulation(scene())._subsystems if type(one).step is not Subsystem.step]


@pytest.fixture(scope="module")
def simulation() -> Simulation:
    return Simulation(scene())


@pytest.fixture(autouse=True)
def afresh(simulation: Simulation) -> None:
    simulation.reset()
    simulation.problems.clear()
    simulation._subsystems._reported.clear()


def subsystem(simulation: Simulation, name: str) -> Subsystem:
    return next(one for one in simulation._subsystems if type(one).__name__ == name)


def does(one: Subsystem, method: str) -> bool:
    """Whether a subsystem has something to do in a method."""
    return getattr(type(one), method) is not getattr(Subsystem, method, None)


def broken(*_: object) -> None:
    raise ZeroDivisionError("broken on purpose " * 1000)


def step_singly(simulation: Simulation, ticks: int) -> None:
    """Advance by ticks none of which coasts: every subsystem's own ``step`` is called."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Coasting, "begins", False)
        for _ in range(ticks):
            simulation.step()


def finite(simulation: Simulation) -> bool:
    state = simulation.state
    return all(np.isfinite(state[name]).all() for name in state.dtype.names if state[name].dtype.kind == "f")


@pytest.mark.parametrize("method", ["step", "write_state", "sense", "reset"])
@pytest.mark.parametrize("name", SUBSYSTEMS)
def test_what_a_subsystem_raises_is_reported_once_and_the_run_goes_on(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch, name: str, method: str
) -> None:
    if not does(subsystem(simulation, name), method):
        pytest.skip("it does nothing then, and is not called")
    others = [one for one in simulation._subsystems if type(one).__name__ != name and does(one, "step")]
    counts = dict.fromkeys(map(id, others), 0)

    def counted(other: Subsystem) -> Callable[[int], None]:
        step = other.step

        def do(tick: int) -> None:
            counts[id(other)] += 1
            step(tick)

        return do

    tick = simulation._clock.tick
    with monkeypatch.context() as patch:
        for other in others:
            patch.setattr(other, "step", counted(other))
        patch.setattr(subsystem(simulation, name), method, broken)
        step_singly(simulation, 3)
        simulation.apply(Reset())
        step_singly(simulation, 3)
    assert simulation._clock.tick == tick + 6
    assert set(counts.values()) == {6}
    reported = [str(problem) for problem in simulation.problems if problem.code == "failed"]
    assert len([text for text in reported if f"'{method}' of {name} failed" in text]) == 1, reported
    assert all("ZeroDivisionError: broken on purpose" in text and len(text) < 600 for text in reported)
    assert finite(simulation)
    simulation.problems.clear()
    simulation.reset()
    simulation.step(5)
    assert simulation.problems == [] and simulation._subsystems.resting == {}


@pytest.mark.parametrize("name", STEPPING)
def test_a_subsystem_that_failed_rests_goes_on_and_is_reported_anew(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr("ligature.simulation.subsystems.REST", 10)
    one, calls = subsystem(simulation, name), []
    step = one.step

    def fails_twice(tick: int) -> None:
        calls.append(tick)
        if len(calls) <= 2:
            broken()
        step(tick)

    with monkeypatch.context() as patch:
        patch.setattr(one, "step", fails_twice)
        step_singly(simulation, 30)
    assert calls[:4] == [0, 10, 20, 21]
    assert sum(problem.code == "failed" for problem in simulation.problems) == 2
    assert finite(simulation)
    speeds = np.abs(simulation.state["body_twist"][0, :, :3])
    assert speeds.max() < 0.1, "what pushed bodies meanwhile acts at once"


def test_a_step_that_fails_clears_the_commands_that_may_have_caused_it(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    body = next(b for b in scene().bodies if b.identity.name == "Needle")
    for name in ("Controllers", "World"):
        simulation.apply(BodyCommand(body.index, CommandType.FORCE, (0.0, 0.0, 1.0, 0.0, 0.0, 0.0)))
        with monkeypatch.context() as patch:
            patch.setattr(subsystem(simulation, name), "step", broken)
            simulation.step(1)
        assert not simulation._world.commanded({body.index})


def test_what_the_watch_over_speeds_raises_is_reported_and_the_run_goes_on(
    simulation: Simulation, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(simulation._guard, "check", broken)
    for _ in range(5):
        simulation.step(20)
    (problem,) = simulation.problems
    assert "'check' of Guard failed" in problem.message


def test_a_snapshot_knows_who_rests(simulation: Simulation, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:
        patch.setattr(subsystem(simulation, "Suture"), "step", broken)
        simulation.step(1)
    taken = simulation.snapshot()
    simulation.step(20)
    expected = simulation.state_hash()
    simulation.step(REST)
    simulation.restore(taken)
    simulation.step(20)
    assert simulation.state_hash() == expected
