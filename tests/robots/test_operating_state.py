"""The state machine of an arm: every state, every command, every request for motion."""

from __future__ import annotations

import re
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ligature.model.frames import matrix_pose7
from ligature.robots import psm_arm
from ligature.robots.axes import Axes
from ligature.robots.impedance import CartesianImpedance
from ligature.robots.operating_state import Rejected, State, action
from ligature.robots.plant import IdealPlant
from ligature.robots.psm import Psm
from ligature.robots.psm_arm import PsmArm

TICK = 1e-3
DISABLED, ENABLED, PAUSED, FAULT = State


def make_arm() -> PsmArm:
    """A PSM without bodies: it is where it is asked to be."""
    kinematics = Psm(420006, "Si")
    limits = np.array([kinematics.lower, kinematics.upper])
    plant = IdealPlant(*limits, np.ones(6), np.ones(6), psm_arm.HOME * 0.9)
    joints = Axes(kinematics.joint_names, limits, psm_arm.MAX_VELOCITY, psm_arm.MAX_ACCELERATION, plant)
    ends = np.array(kinematics.instrument.jaw).reshape(2, 1)
    fingers = IdealPlant(ends[0], ends[1], np.ones(1), np.ones(1), np.zeros(1))
    return PsmArm("PSM1", kinematics, joints, Axes(("jaw",), ends, [10.0], [10.0], fingers))


def run(arm: PsmArm, seconds: float) -> None:
    for _ in range(round(seconds / TICK)):
        arm.tick(TICK)


def settle(arm: PsmArm) -> PsmArm:
    """Wait until the arm is not busy; 5 s at most."""
    run(arm, 0.01)
    for _ in range(500):
        if not arm.is_busy:
            return arm
        run(arm, 0.01)
    raise AssertionError("still busy after 5 s")


def enabled() -> PsmArm:
    arm = make_arm()
    arm.enable()
    return settle(arm)


def homed() -> PsmArm:
    arm = enabled()
    arm.home()
    return settle(arm)


def paused() -> PsmArm:
    arm = homed()
    arm.pause()
    return arm


def failed() -> PsmArm:
    arm = homed()
    arm.fault("a test")
    return arm


MADE: dict[str, Callable[[], PsmArm]] = {
    "disabled": make_arm, "enabled": enabled, "homed": homed, "paused": paused, "fault": failed,
}  # fmt: skip

REFUSED = None
COMMANDS: dict[tuple[str, str], tuple[State, bool] | None] = {
    ("disabled", "enable"): (ENABLED, False),
    ("disabled", "disable"): (DISABLED, False),
    ("disabled", "pause"): (PAUSED, False),
    ("disabled", "resume"): REFUSED,
    ("disabled", "home"): (ENABLED, True),
    ("disabled", "unhome"): (DISABLED, False),
    ("enabled", "enable"): (ENABLED, False),
    ("enabled", "disable"): (DISABLED, False),
    ("enabled", "pause"): (PAUSED, False),
    ("enabled", "resume"): REFUSED,
    ("enabled", "home"): (ENABLED, True),
    ("enabled", "unhome"): (ENABLED, False),
    ("homed", "enable"): (ENABLED, True),
    ("homed", "disable"): (DISABLED, False),
    ("homed", "pause"): (PAUSED, True),
    ("homed", "resume"): REFUSED,
    ("homed", "home"): (ENABLED, True),
    ("homed", "unhome"): (ENABLED, False),
    ("paused", "enable"): REFUSED,
    ("paused", "disable"): (DISABLED, False),
    ("paused", "pause"): (PAUSED, True),
    ("paused", "resume"): (ENABLED, True),
    ("paused", "home"): REFUSED,
    ("paused", "unhome"): (PAUSED, False),
    ("fault", "enable"): REFUSED,
    ("fault", "disable"): (DISABLED, False),
    ("fault", "pause"): REFUSED,
    ("fault", "resume"): REFUSED,
    ("fault", "home"): REFUSED,
    ("fault", "unhome"): (FAULT, False),
}
"""State and whether homed once each command has done what it does; an arm is homed only while it has power."""

Q = psm_arm.HOME + [0.05, -0.05, 0.01, 0.1, 0.1, -0.1]
POSE = matrix_pose7(Psm(420006, "Si").forward(Q))
STIFF = CartesianImpedance(POSE[:3], np.eye(3), np.eye(3), np.zeros((4, 4, 3)))

SERVOS: dict[str, Callable[[PsmArm], None]] = {
    "servo_jp": lambda arm: arm.servo_jp(Q),
    "servo_jp with velocity": lambda arm: arm.servo_jp(Q, np.zeros(6)),
    "servo_jr": lambda arm: arm.servo_jr(np.full(6, 0.001)),
    "servo_jv": lambda arm: arm.servo_jv(np.full(6, 0.01)),
    "servo_jf": lambda arm: arm.servo_jf(np.full(6, 0.01)),
    "servo_cp": lambda arm: arm.servo_cp(POSE),
    "servo_cv": lambda arm: arm.servo_cv([0.01, 0, 0, 0, 0, 0]),
    "servo_ci": lambda arm: arm.servo_ci(STIFF),
    "servo_cs": lambda arm: arm.servo_cs(POSE, None, None),
    "body/servo_cf": lambda arm: arm.body_servo_cf([0.1, 0, 0, 0, 0, 0]),
    "spatial/servo_cf": lambda arm: arm.spatial_servo_cf([0.1, 0, 0, 0, 0, 0]),
    "jaw/servo_jp": lambda arm: arm.jaw.servo_jp(0.5),
    "jaw/servo_jf": lambda arm: arm.jaw.servo_jf(0.01),
    "hold": lambda arm: arm.hold(),
    "free": lambda arm: arm.free(),
}
MOVES: dict[str, Callable[[PsmArm], None]] = {
    "move_jp": lambda arm: arm.move_jp(Q),
    "move_jr": lambda arm: arm.move_jr(np.full(6, 0.01)),
    "move_cp": lambda arm: arm.move_cp(POSE),
    "jaw/move_jp": lambda arm: arm.jaw.move_jp(0.5),
}
MOTIONS = {**SERVOS, **MOVES}


def reported(arm: PsmArm, name: str) -> list[object]:
    """Values of the events ``name`` since the last look."""
    found = [event.value for event in arm.events if event.name == name]
    arm.events.clear()
    return found


@pytest.mark.parametrize(("state", "command"), COMMANDS)
def test_a_state_command_drives_where_the_table_states(state, command):
    arm, expected = MADE[state](), COMMANDS[state, command]
    before = arm.operating_state
    if expected is REFUSED:
        with pytest.raises(Rejected, match=f"'{command}' is not allowed in state {before.state.name}, only in "):
            arm.state_command(command)
        settle(arm)
        assert arm.operating_state == before
        return
    arm.state_command(command)
    settle(arm)
    assert (arm.operating_state.state, arm.operating_state.is_homed) == expected


@pytest.mark.parametrize("interval", [1, 37, 199, 200, 300])
@pytest.mark.parametrize("command", ["enable", "home", "disable", "pause"])
def test_a_command_that_is_repeated_until_it_has_its_effect_has_it_as_soon(command, interval):
    once, repeated = make_arm(), make_arm()
    once.state_command(command)
    settled_at = settle(once).time
    for tick in range(round(settled_at / TICK)):
        if tick % interval == 0:
            repeated.state_command(command)
        repeated.tick(TICK)
    assert settle(repeated).operating_state.state == once.operating_state.state
    assert repeated.operating_state.is_homed == once.operating_state.is_homed
    assert repeated.time <= settled_at + 0.05


OUTCOMES = {"enable": ENABLED, "home": ENABLED, "resume": ENABLED, "disable": DISABLED, "pause": PAUSED}


@given(st.lists(st.tuples(st.sampled_from([*OUTCOMES, "unhome"]), st.integers(0, 400)), min_size=1, max_size=8))
def test_the_last_accepted_command_decides_whatever_came_before_and_when(commands):
    arm, expected = make_arm(), DISABLED
    for command, ticks in commands:
        try:
            arm.state_command(command)
            expected = OUTCOMES.get(command, expected)
        except Rejected:
            pass
        run(arm, ticks * TICK)
    assert settle(arm).operating_state.state == expected


@pytest.mark.parametrize("state", MADE)
def test_every_accepted_command_is_answered_by_a_new_event(state):
    for command in ("enable", "disable", "pause", "resume", "home", "unhome"):
        if COMMANDS[state, command] is not REFUSED:
            arm = MADE[state]()
            arm.events.clear()
            arm.state_command(command)
            settle(arm)
            assert reported(arm, "operating_state"), (
                f"{command} reported nothing: a client that waits would wait for ever"
            )


@pytest.mark.parametrize("state", MADE)
def test_a_word_that_is_no_command_is_refused(state):
    arm = MADE[state]()
    before = arm.operating_state
    with pytest.raises(Rejected, match="'dance' is not a state command; use one of enable, disable, "):
        arm.state_command("dance")
    assert arm.operating_state == before


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("state", MADE)
def test_motion_is_for_homed_arms_only(state, motion):
    arm = MADE[state]()
    start, before = arm.measured_js().position, arm.operating_state
    arm.events.clear()
    if state == "homed":
        MOTIONS[motion](arm)
        assert arm.is_busy == (motion in MOVES), "moves make an arm busy, servo does not"
        settle(arm)
        assert arm.operating_state == before
        assert reported(arm, "goal_reached") == ([True] if motion in MOVES else [])
        return
    with pytest.raises(Rejected, match="not ready"):
        MOTIONS[motion](arm)
    run(arm, 0.1)
    assert arm.operating_state == before
    np.testing.assert_array_equal(arm.measured_js().position, start)


@pytest.mark.parametrize("state", MADE)
def test_whoever_sends_what_a_rejection_names_can_move(state):
    arm = MADE[state]()
    for _ in range(3):
        try:
            MOTIONS["servo_jp"](arm)
            break
        except Rejected as rejection:
            for command in re.findall(r"'(\w+)'", str(rejection)):
                arm.state_command(command)
                settle(arm)
    assert arm.operating_state.state is ENABLED and arm.is_homed


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("command", ["disable", "pause", "unhome"])
def test_a_moving_arm_stops_for_a_state_command(command, motion):
    arm = homed()
    arm.move_jp(Q + 0.2)
    run(arm, 0.1)
    arm.events.clear()
    arm.state_command(command)
    if command != "unhome":
        assert not arm.is_busy
        assert reported(arm, "goal_reached") == [False]
        stopped = arm.setpoint_js().position
        run(arm, 0.5)
        np.testing.assert_allclose(arm.setpoint_js().position, stopped, atol=1e-12)
    with pytest.raises(Rejected):
        MOTIONS[motion](arm)


@pytest.mark.parametrize("motion", SERVOS)
def test_a_streamed_command_ends_a_move_of_the_same_joints(motion):
    arm = homed()
    move = arm.jaw.move_jp if motion.startswith("jaw") else arm.move_jp
    move(1.0 if motion.startswith("jaw") else Q + 0.2)
    run(arm, 0.05)
    arm.events.clear()
    SERVOS[motion](arm)
    assert not arm.is_busy
    assert reported(arm, "goal_reached") == [False]


@pytest.mark.parametrize("motion", MOVES)
def test_a_move_is_busy_then_idle_even_when_it_goes_nowhere(motion):
    arm = homed()
    for _ in range(2):
        arm.events.clear()
        if motion == "move_jr":
            arm.move_jr(np.zeros(6))
        else:
            MOVES[motion](arm)
        settle(arm)
        busy = [value[2] for value in reported(arm, "operating_state")]
        assert busy == [True, False]


def test_a_paused_arm_resumes_where_it_stood():
    arm = paused()
    where = arm.measured_js().position
    run(arm, 0.5)
    arm.resume()
    run(arm, 0.1)
    np.testing.assert_allclose(arm.measured_js().position, where, atol=1e-12)


def test_relative_moves_add_to_the_goal_of_the_running_move():
    arm = homed()
    step = np.array([0.05, 0, 0, 0, 0, 0])
    arm.move_jr(step)
    run(arm, 0.02)
    arm.move_jr(step)
    settle(arm)
    assert arm.setpoint_js().position[0] == pytest.approx(0.1)


@pytest.mark.parametrize("bad", [np.zeros(5), np.zeros(7), [], np.full(6, np.nan), [np.inf, 0, 0, 0, 0, 0]], ids=str)
@pytest.mark.parametrize("motion", ["servo_jp", "servo_jr", "servo_jv", "servo_jf", "move_jp", "move_jr"])
def test_numbers_that_do_not_fit_change_nothing(motion, bad):
    arm = homed()
    before = arm.setpoint_js().position
    with pytest.raises(Rejected, match=rf"{motion} takes|move_jp takes"):
        getattr(arm, motion)(bad)
    run(arm, 0.05)
    np.testing.assert_array_equal(arm.setpoint_js().position, before)
    assert not arm.is_busy


def test_a_tool_too_high_takes_no_cartesian_motion():
    arm = homed()
    arm.move_jp(np.where(np.arange(6) == 2, arm.kinematics.insertion_at(0.03), psm_arm.HOME))
    settle(arm)
    for motion in ("servo_cp", "move_cp", "servo_cv"):
        with pytest.raises(Rejected, match="30 mm below the remote centre; insert it to 45 mm first"):
            MOTIONS[motion](arm)


def test_the_former_name_of_a_rejection_warns_and_catches_it() -> None:
    with pytest.warns(DeprecationWarning, match="'Refused' is deprecated; write 'Rejected'"):
        from ligature.robots.operating_state import Refused
    with pytest.raises(Refused):
        action("dance", State.ENABLED)


def test_states_keep_the_numbers_of_records_and_a_state_that_was_handed_out_stays_as_it_is() -> None:
    assert {state.name: state.value for state in State} == {"DISABLED": 0, "ENABLED": 1, "PAUSED": 2, "FAULT": 3}
    arm = homed()
    handed_out = arm.operating_state
    with pytest.raises(AttributeError):
        handed_out.state = State.FAULT  # type: ignore[misc]
    arm.disable()
    assert handed_out.state == State.ENABLED
