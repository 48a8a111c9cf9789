"""A short form of `tests.fuzz.commands`, and what it found."""

from __future__ import annotations

from collections import Counter

import ligature
import pytest
from ligature.bus.codec import CodecError, encode
from ligature.bus.events import LOG_BYTES, MOST_BYTES, SLOTS, EventLog
from ligature.model.commands import ActuatorCommand, BodyCommand, Command, CommandType, Release, Reset
from ligature.model.scene import Scene
from ligature.robots.commands import VERBS, Hold, MoveJp, StateCommand, TrajectorySetRatio
from ligature.robots.operating_state import State
from ligature.simulation import Simulation

from tests.fuzz.commands import ROOT, SCENES, Failure, Run, missing

COMMANDS = 3000


@pytest.fixture(scope="module")
def scene() -> Scene:
    return ligature.load(ROOT / SCENES[0])


@pytest.mark.parametrize("seed", [1, 2])
def test_no_command_whatever_raises_in_a_step_or_leaves_a_number_that_is_not_finite(scene: Scene, seed: int) -> None:
    run = Run(scene, seed)
    run.go(COMMANDS)
    run.simulation.close()
    assert run.taken > 0.2 * COMMANDS
    states = Counter(state for _, _, state in run.seen.elements())
    assert all(states[state.name] > 20 for state in State), states
    assert set(VERBS) == {verb for _, verb, _ in run.seen if verb in VERBS}


def test_the_generator_reports_what_was_not_met_and_finds_what_raises(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    kinds = {"PSM", "ECM"}
    assert len(missing(Counter(), kinds)) == len(kinds) * len(VERBS) * len(State)

    def broken(*_: object) -> None:
        raise RuntimeError("broken on purpose")

    monkeypatch.setattr("ligature.physics.world.World.pre_step", broken)
    run = Run(scene, 1)
    with pytest.raises(Failure, match="broken on purpose"):
        run.go(COMMANDS)
    run.simulation.close()


def test_what_an_arm_raises_becomes_its_fault_and_the_others_go_on(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation = Simulation(scene)
    first, *others = simulation.arms.values()
    for arm in (first, *others):
        arm.adopt()

    def broken(*_: object) -> None:
        raise ZeroDivisionError("broken on purpose")

    for part in ("_advance", "watch", "hold", "settle"):
        with monkeypatch.context() as patch:
            patch.setattr(first, part, broken)
            if part == "watch":  # compiled ticks ask for it where an arm has strayed alone
                patch.setattr(simulation._ticking.coasting, "pass_ticks", lambda *_: (0, 0))
            simulation.arms.events()
            simulation.step(10)
            simulation.apply(Release("arm", 0))
            simulation.apply(Hold(0))
            simulation.apply(Reset())
            simulation.step(10)
        reported = [value for arm, name, value in simulation.arms.events() if (arm, name) == (0, "error")]
        assert reported and all("ZeroDivisionError: broken on purpose" in text for text in reported)
        assert len(reported) == 1, "a fault is reported once"
        assert first.operating_state.state is State.FAULT
        assert all(other.operating_state.state is State.ENABLED for other in others)
        first.disable()
        first.adopt()
    simulation.close()


@pytest.mark.parametrize("ratio", [1e-5, 5e-324])
def test_a_move_that_would_take_hours_is_refused_and_the_arm_stays_ready(scene: Scene, ratio: float) -> None:
    simulation = Simulation(scene)
    arm = next(iter(simulation.arms.values()))
    arm.adopt()
    simulation.apply(TrajectorySetRatio(0, ratio))
    simulation.apply(MoveJp(0, (0.5, 0.3, 0.2, 1.0, 0.4, 0.4)))
    events = [(name, value) for index, name, value in simulation.arms.events() if index == 0]
    assert any(name == "warning" and "raise 'trajectory_j/set_ratio'" in value for name, value in events), events
    assert ("goal_reached", False) in events
    assert not arm.is_busy and arm.is_enabled
    simulation.step(5)
    simulation.apply(TrajectorySetRatio(0, 1.0))
    simulation.apply(MoveJp(0, (0.5, 0.3, 0.2, 1.0, 0.4, 0.4)))
    assert arm.is_busy
    simulation.close()


def test_homing_that_would_take_hours_ends_in_a_fault_not_the_run(scene: Scene) -> None:
    simulation = Simulation(scene)
    arm = next(iter(simulation.arms.values()))
    simulation.apply(TrajectorySetRatio(0, 1e-5))
    arm.place_jp((0.4, 0.3, 0.2, 1.0, 0.4, 0.4))
    simulation.apply(StateCommand(0, "home"))
    simulation.step(300)
    assert arm.operating_state.state is State.FAULT
    reported = [value for index, name, value in simulation.arms.events() if (index, name) == (0, "error")]
    assert len(reported) == 1 and "trajectory_j/set_ratio" in reported[0]
    simulation.apply(TrajectorySetRatio(0, 1.0))
    for word in ("disable", "home"):
        simulation.apply(StateCommand(0, word))
    simulation.step(300)
    assert arm.is_busy or arm.is_homed
    simulation.close()


@pytest.mark.parametrize("command", [StateCommand(0, "x" * 10_000_000), ActuatorCommand(0, True, "é" * 101)])
def test_long_texts_are_refused_without_repeating_them(command: Command) -> None:
    for refuse, error in ((Command.check, ValueError), (encode, CodecError)):
        with pytest.raises(error, match="at most 200 bytes") as found:
            refuse(command)
        assert len(str(found.value)) < 100


@pytest.mark.parametrize("text", ["a" * 1000, "\0" * 1000, "😀" * 300, "é" * 130, "😀" * 20 + "a" * 400])
def test_events_of_any_text_keep_to_their_slot(text: str) -> None:
    log = EventLog(memoryview(bytearray(LOG_BYTES)))
    for number in range(SLOTS + 3):
        log.write(number % 7, "warning", text)
        log.write(1, "next", number)
        first, second = log.read()
        assert (first.arm, first.name) == (number % 7, "warning")
        assert text.startswith(first.value) and len(first.value) >= min(len(text), (MOST_BYTES - 40) // 12)
        assert second.value == number
    assert log.lost == 0


@pytest.mark.parametrize("part", ["BodyControl.set", "BodyControl.apply"])
def test_what_the_controller_of_a_body_raises_clears_its_command_and_is_reported(
    scene: Scene, monkeypatch: pytest.MonkeyPatch, part: str
) -> None:
    simulation = Simulation(scene)
    body = next(b for b in scene.bodies if b.mass > 0.0 and not b.static and not b.joints)
    command = BodyCommand(body.index, CommandType.FORCE, (0.0, 0.0, 1.0, 0.0, 0.0, 0.0))

    def broken(*_: object) -> None:
        raise ZeroDivisionError("broken " * 1000)

    with monkeypatch.context() as patch:
        patch.setattr(f"ligature.physics.bodies.{part}", broken)
        simulation.apply(command)
        simulation.step(3)
    reported = [str(problem) for problem in simulation.problems]
    assert len(reported) == 1
    assert (
        body.identity.identifier in reported[0]
        and "ZeroDivisionError: broken" in reported[0]
        and len(reported[0]) < 600
    )
    simulation.step(3)
    assert len(simulation.problems) == 1
    simulation.close()


def test_what_the_joints_raise_lets_them_go_limp_and_is_reported_once(
    scene: Scene, monkeypatch: pytest.MonkeyPatch
) -> None:
    simulation = Simulation(scene)
    arm = next(iter(simulation.arms.values()))
    arm.adopt()

    def broken(*_: object) -> None:
        raise ZeroDivisionError("broken on purpose")

    with monkeypatch.context() as patch:
        patch.setattr("ligature.coasting.Coasting.begins", False)  # what is compiled raises nothing
        patch.setattr("ligature.physics.world.prepare", broken)
        simulation.step(1)
    assert {problem.code for problem in simulation.problems} == {"failed"}
    count = len(simulation.problems)
    simulation.step(2)
    assert len(simulation.problems) == count
    simulation.close()
