"""Arms on ROS: topics, frames and rates; and what becomes of commands that no arm can carry out."""

from __future__ import annotations

import inspect
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from tests.ros.conftest import ARMS
from tests.ros.test_client_scripts import on_all
from tests.waiting import stays, steady, until

pytestmark = pytest.mark.ros

JOINTS = {
    "PSM": ["yaw", "pitch", "insertion", "roll", "wrist_pitch", "wrist_yaw"],
    "ECM": ["yaw", "pitch", "insertion", "roll"],
    "MTM": ["outer_yaw", "shoulder_pitch", "elbow_pitch", "wrist_platform", "wrist_pitch", "wrist_yaw", "wrist_roll"],
}


def at_home(client: Any) -> Any:
    """The arm, enabled, homed and at its home pose."""
    assert client.enable(5.0)
    assert client.home(10.0)
    home = np.zeros(len(JOINTS[client.name[:3]]))
    if not client.name.startswith("MTM"):
        home[2] = 0.12
    if np.abs(client.setpoint_jp() - home).max() > 1e-9:
        assert client.move_jp(home).wait()
    return client


def on_every_arm(check: Callable[..., None]) -> Callable[..., None]:
    """A test that does ``check`` on all arms at the same time, each at its home pose."""
    fixtures = list(inspect.signature(check).parameters)[1:]

    def test(arms: dict[str, Any], **values: Any) -> None:
        on_all(arms, lambda arm: check(at_home(arm), **values))

    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    test.__signature__ = inspect.Signature([inspect.Parameter(name, kind) for name in ("arms", *fixtures)])
    test.__name__, test.__doc__ = check.__name__, check.__doc__
    return test


@pytest.fixture(params=ARMS)
def arm(arms: dict[str, Any], request: pytest.FixtureRequest) -> Any:
    """Each arm in turn, at its home pose."""
    return at_home(arms[request.param])


def table(node: Any) -> tuple[dict[str, str], dict[str, set[str]], dict[str, set[str]]]:
    """Types of topics, and who publishes and subscribes them, without this process."""
    import rosgraph

    master = rosgraph.Master(node.get_name())
    publishers, subscribers, _ = master.getSystemState()
    others = [{topic: set(names) - {node.get_name()} for topic, names in side} for side in (publishers, subscribers)]
    return dict(master.getTopicTypes()), others[0], others[1]


# --- topics ---------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ARMS)
def test_every_topic_of_an_arm_is_there_with_its_type_and_direction(arms, node, name):
    from crtk_msgs.msg import OperatingState, StringStamped
    from sensor_msgs.msg import JointState

    from tests.ros import crtk

    types, published, subscribed = table(node)
    out = {"operating_state": OperatingState, **crtk.HEARD, **crtk.EVENTS, **crtk.READS}
    out |= dict.fromkeys(crtk.BUTTONS[name[:3]], crtk.BUTTON)
    into = {"state_command": StringStamped, **crtk.SENT}
    if name.startswith("PSM"):
        out |= {"jaw/measured_js": JointState, "jaw/setpoint_js": JointState}
        into |= {"jaw/servo_jp": JointState, "jaw/move_jp": JointState, "jaw/servo_jf": JointState}
    if name.startswith("MTM"):
        out |= {"gripper/measured_js": JointState}
    wrong = []
    for side, wanted in ((published, out), (subscribed, into)):
        for topic, type_ in wanted.items():
            full = f"/{name}/{topic}"
            if not side.get(full):
                wrong.append(f"{full}: nobody {'publishes' if side is published else 'subscribes'} it")
            elif types[full] != type_._type:
                wrong.append(f"{full}: {types[full]}, not {type_._type}")
    assert not wrong, "\n".join(wrong)


def test_console_system_and_pedals_have_both_ends(simulator, node):
    from tests.ros.crtk import Console, System

    for link in (Console(node), System(node)):
        link.check_connections(5.0)
        link.close()
    _, published, _ = table(node)
    wanted = [f"/footpedals/{pedal}" for pedal in ("clutch", "camera", "coag")]
    wanted += [f"/console/{name}" for name in ("operator_present", "clutch", "camera", "teleop/enabled")]
    assert [topic for topic in wanted if not published.get(topic)] == []


def test_set_up_joints_have_both_ends_fresh_states_and_reasons(simulator, node):
    from sensor_msgs.msg import JointState

    from tests.ros.crtk import SetupArm

    for name in ("PSM1", "ECM"):
        link = SetupArm(node, name)
        link.check_connections(5.0)
        assert link.hear("operating_state").state == "ENABLED"
        stays(lambda link=link: link.hear("operating_state").is_homed, "a fresh state", 1.2)
        link.send("move_jp", JointState(position=[0.1] * 6))
        warning = until(lambda link=link: link._heard["warning"].message, "a reason", 5.0).data
        assert warning == "move_jp: the bases of the arms are fixed; the scene's file places them"
        link.close()


@on_every_arm
def test_feedback_comes_at_a_hundred_hertz_or_more_with_rising_stamps(arm, listen):
    from sensor_msgs.msg import JointState

    listener = listen(arm.topic("measured_js"), JointState)
    listener.wait()
    assert listener.comes_at(90.0)
    stamps = [message.header.stamp.to_sec() for message in listener.messages]
    assert min(np.diff(stamps)) >= 0.0
    assert abs(stamps[-1] - time.time()) < 0.1


@on_every_arm
def test_joint_states_carry_names_and_arrays_of_one_length(arm):
    message = arm.hear("measured_js")
    assert list(message.name) == JOINTS[arm.name[:3]]
    assert len(message.position) == len(message.velocity) == len(message.effort) == len(message.name)
    assert message.header.frame_id == ""


@on_every_arm
def test_poses_are_reported_in_the_frame_of_the_base(arm):
    reference = "HRSV" if arm.name.startswith("MTM") else f"{arm.name}_base"
    assert arm.hear("measured_cp").header.frame_id == arm.hear("setpoint_cp").header.frame_id == reference
    for topic in ("local/measured_cp", "local/setpoint_cp"):
        assert arm.hear(topic).header.frame_id == f"{arm.name}_base"


@on_every_arm
def test_measured_poses_are_the_forward_kinematics_of_measured_joints(arm):
    from tests.ros.crtk import pose7, pose_distance

    answer = arm.forward_kinematics(arm.measured_jp(), local=True)
    assert answer.result
    metres, radians = pose_distance(pose7(answer.cp), pose7(arm.hear("local/measured_cp").pose))
    assert (metres, radians) < (1e-5, 1e-4)
    metres, radians = pose_distance(pose7(arm.forward_kinematics(arm.measured_jp()).cp), arm.measured_cp())
    assert (metres, radians) < (1e-5, 1e-4)


@on_every_arm
def test_inverse_kinematics_undoes_the_local_forward(arm):
    from tests.ros.crtk import pose7

    q = arm.measured_jp()
    answer = arm.inverse_kinematics(q, pose7(arm.forward_kinematics(q, local=True).cp))
    assert answer.result
    np.testing.assert_allclose(answer.jp, q, atol=1e-6)


@on_every_arm
def test_queries_that_cannot_be_answered_state_why(arm):
    q = arm.measured_jp()
    answer = arm.forward_kinematics([*q, 0.0])
    assert (answer.result, "too many joints" in answer.message) == (False, True)
    answer = arm.inverse_kinematics(q[:-1], arm.measured_cp())
    assert (answer.result, "incorrect number of joints" in answer.message) == (False, True)
    answer = arm.inverse_kinematics(q, [0.0, 0.0, 9.0, 0.0, 0.0, 0.0, 1.0])
    assert (answer.result, "inverse kinematics failed" in answer.message) == (False, True)


@on_every_arm
def test_jacobians_have_six_rows_and_a_column_a_joint(arm):
    for frame in ("body", "spatial"):
        assert arm.jacobian(frame).shape == (6, len(JOINTS[arm.name[:3]]))


def test_tf_has_a_frame_for_every_arm(arms, listen):
    from tf2_msgs.msg import TFMessage

    listener = listen("/tf", TFMessage)
    wanted = {("HRSV" if name.startswith("MTM") else f"{name}_base", name) for name in ARMS}

    def pairs() -> set[tuple[str, str]]:
        return {(t.header.frame_id, t.child_frame_id) for message in listener.messages for t in message.transforms}

    until(lambda: wanted <= pairs(), "every arm has a frame")


@on_every_arm
def test_the_operating_state_is_latched_for_whoever_comes_late(arm, node):
    from crtk_msgs.msg import OperatingState

    begin = time.monotonic()
    message = node.wait_for_message(arm.topic("operating_state"), OperatingState, timeout=2.0)
    assert (message.state, message.is_homed) == ("ENABLED", True)
    assert time.monotonic() - begin < 1.0


@on_every_arm
def test_services_report_state_and_version(arm, node):
    from crtk_msgs.srv import TriggerOperatingState
    from std_srvs.srv import Trigger

    state = node.ServiceProxy(arm.topic("operating_state"), TriggerOperatingState)().operating_state
    assert (state.state, state.is_homed) == ("ENABLED", True)
    assert node.ServiceProxy(arm.topic("crtk_version"), Trigger)().message == "1.1.0"


# --- states ---------------------------------------------------------------------------------


def test_an_arm_is_enabled_within_a_second_and_homed_within_five(arms):
    def start_anew(client: Any) -> None:
        assert client.disable(2.0)
        client.state.command("unhome")
        assert client.enable(1.0), "not enabled within a second"
        assert client.home(5.0), "not homed within five seconds"

    on_all(arms, start_anew)


@on_every_arm
def test_enable_and_home_of_a_homed_arm_change_nothing(arm):
    from tests.ros.crtk import shifted

    assert arm.move_cp(shifted(arm.setpoint_cp(), [0.005, 0.0, 0.0])).wait()
    before = steady(arm.measured_jp, within=1e-4)
    assert arm.enable(0.0)
    assert arm.home(0.0)
    stays(lambda: np.abs(arm.measured_jp() - before).max() < 1e-4, "the arm stands", 0.3)
    assert arm.state.now.state == "ENABLED"


@on_every_arm
def test_states_follow_the_reference_sequence(arm):
    assert arm.disable(2.0)
    arm.state.command("unhome")
    assert arm.state.wait_for(lambda s: not s.is_homed, 2.0)
    before = int(steady(lambda: len(arm.state.events)))
    assert arm.enable(1.0)
    assert arm.home(5.0)
    reported = [(e.state, e.is_homed, e.is_busy) for e in arm.state.events[before:]]
    reported = reported[
        reported.index(("DISABLED", False, True)) :
    ]  # what was reported before belongs to 'disable' and 'unhome'
    short = [reported[0], *(state for last, state in zip(reported, reported[1:], strict=False) if state != last)]
    assert short == [
        ("DISABLED", False, True), ("ENABLED", False, False), ("ENABLED", False, True), ("ENABLED", True, False),
    ]  # fmt: skip
    stamps = [event.header.stamp.to_sec() for event in arm.state.events]
    assert min(np.diff(stamps)) > 0.0


@on_every_arm
def test_pause_stops_motion_and_resume_allows_it(arm):
    start = arm.setpoint_jp()
    step = np.zeros(len(start))
    step[0] = 0.1
    arm.state.command("pause")
    assert arm.state.wait_for(lambda s: s.state == "PAUSED", 1.0)
    assert not arm.move_jp(start + step).wait(timeout=0.5)
    arm.servo_jp(start + step)
    stays(lambda: np.abs(arm.measured_jp() - start).max() < 1e-3, "the paused arm stands")
    assert arm.hear("measured_js"), "feedback stays fresh while paused"
    arm.state.command("resume")
    assert arm.state.wait_for(lambda s: s.state == "ENABLED", 1.0)
    assert arm.move_jp(start + step).wait()
    assert arm.move_jp(start).wait()


@on_every_arm
def test_an_unknown_state_command_is_a_warning_without_effect(arm, listen):
    from std_msgs.msg import String

    warnings = listen(arm.topic("warning"), String)

    def warned() -> bool:  # who subscribes too late misses the first
        arm.state.command("dance")
        return any("dance" in message.data for message in warnings.messages)

    until(warned, "the warning", every=0.1)
    assert arm.state.now.state == "ENABLED"


# --- motion ---------------------------------------------------------------------------------


BEHIND = 0.025
"""Seconds of simulated time within which an arm is where it is to be: two setpoints, and some updates of its own."""


@pytest.mark.parametrize("rate", [100.0, 500.0])
def test_a_servo_stream_is_followed(arm, rate, listen):
    from sensor_msgs.msg import JointState

    from tests.ros.test_client_scripts import stream

    start = arm.setpoint_jp()
    swing = np.zeros(len(start))
    swing[:2] = 0.05
    measured, setpoints = (listen(arm.topic(name), JointState) for name in ("measured_js", "setpoint_js"))

    def send(t: float) -> None:
        arm.servo_jp(start + swing * np.sin(2.0 * np.pi * t) ** 2)

    stream(send, 1.0, rate)
    until(lambda: np.abs(arm.measured_jp() - start).max() < 2e-3, "the arm is back")
    times, wanted = zip(*((m.header.stamp.to_sec(), m.position) for m in setpoints.messages), strict=True)
    errors = []
    for message in measured.messages:
        now = message.header.stamp.to_sec()
        if now in times:
            first, last = np.searchsorted(times, [now - BEHIND, now], side="right")
            recent = wanted[max(first - 1, 0) : last]  # from the one that held at the beginning on
            low, high = np.min(recent, axis=0), np.max(recent, axis=0)
            errors.append(np.abs(message.position - np.clip(message.position, low, high)).max())
    assert len(errors) > 10
    assert np.percentile(errors, 95) < 1e-3


@on_every_arm
def test_a_move_of_no_length_ends(arm):
    begin = time.monotonic()
    assert arm.move_jp(arm.setpoint_jp()).wait(timeout=5.0)
    assert arm.move_cp(arm.setpoint_cp()).wait(timeout=5.0)
    assert time.monotonic() - begin < 2.0


@on_every_arm
def test_a_newer_move_takes_over_and_only_its_goal_is_reached(arm, listen):
    from std_msgs.msg import Bool

    goals = listen(arm.topic("goal_reached"), Bool)
    start = arm.setpoint_jp()
    step = np.zeros(len(start))
    step[0] = 0.3
    first = arm.move_jp(start + step)
    assert first.wait(is_busy=True, timeout=2.0)
    until(lambda: np.abs(arm.setpoint_jp() - start).max() > 1e-3, "the first move goes on")
    assert arm.move_jp(start).wait()
    until(lambda: np.abs(arm.setpoint_jp() - start).max() < 1e-6, "the newer goal is reached")
    until(lambda: [message.data for message in goals.messages][-2:] == [False, True], "both moves are reported")


@on_every_arm
def test_a_servo_command_ends_a_move(arm):
    start = arm.setpoint_jp()
    step = np.zeros(len(start))
    step[0] = 0.3
    motion = arm.move_jp(start + step)
    assert motion.wait(is_busy=True, timeout=2.0)
    until(lambda: np.abs(arm.setpoint_jp() - start).max() > 1e-3, "the move goes on")
    here = arm.setpoint_jp()
    arm.servo_jp(here)
    assert motion.wait(timeout=1.0), "busy did not end"
    until(lambda: np.abs(arm.setpoint_jp() - here).max() < 1e-6, "the setpoint is taken")
    stays(lambda: np.abs(arm.setpoint_jp() - here).max() < 1e-6, "the setpoint stands")
    assert arm.move_jp(start).wait()


@on_every_arm
def test_goals_beyond_the_limits_are_clipped_not_refused(arm):
    start = arm.setpoint_jp()
    goal = start.copy()
    goal[0] = 9.0
    assert arm.move_jp(goal).wait()
    assert 0.5 < arm.setpoint_jp()[0] < 3.0
    assert arm.move_jp(start).wait()


@pytest.mark.parametrize("bad", ["short", "long", "empty", "nan", "infinite"])
@on_every_arm
def test_joint_commands_that_are_invalid_change_nothing(arm, bad):
    start = arm.setpoint_jp()
    values = {
        "short": start[:-1] + 0.1, "long": [*start, 0.1], "empty": [], "nan": start * np.nan,
        "infinite": np.where(np.arange(len(start)) == 0, np.inf, start),
    }[bad]  # fmt: skip
    arm.servo_jp(values)
    assert not arm.move_jp(values).wait(timeout=0.4)
    np.testing.assert_allclose(arm.setpoint_jp(), start, atol=1e-9)
    assert arm.state.now.state == "ENABLED"
    assert not arm.state.now.is_busy
    assert arm.move_jp(start).wait(timeout=5.0), "a good command works after a bad one"


@pytest.mark.parametrize("kind", ["nan", "no rotation", "base"])
@on_every_arm
def test_poses_that_cannot_be_reached_change_nothing(arm, kind, listen):
    from std_msgs.msg import Bool

    from tests.ros.crtk import pose7

    base = between(arm.measured_cp(), pose7(arm.hear("local/measured_cp").pose))
    pose = {"nan": [np.nan] * 7, "no rotation": [0.0] * 7, "base": base}[kind]
    goals = listen(arm.topic("goal_reached"), Bool)
    start = arm.setpoint_jp()
    arm.servo_cp(pose)
    assert not arm.move_cp(pose).wait(timeout=0.4)
    np.testing.assert_allclose(arm.setpoint_jp(), start, atol=1e-9)
    assert not arm.state.now.is_busy
    assert goals.wait().data is False


@on_every_arm
def test_commands_to_an_arm_that_is_not_ready_are_ignored_with_a_warning(arm, listen):
    from std_msgs.msg import String

    warnings = listen(arm.topic("warning"), String)
    start = arm.measured_jp()
    assert arm.disable(2.0)
    arm.servo_jp(start + 0.05)
    assert not arm.move_jp(start + 0.05).wait(timeout=0.5)
    warnings.wait(lambda message: "not ready" in message.data)
    assert arm.state.now.state == "DISABLED"


@on_every_arm
def test_ratios_are_echoed_and_slow_moves_down(arm, listen):
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Float64

    ratios = listen(arm.topic("trajectory_j/ratio"), Float64)
    setpoints = listen(arm.topic("setpoint_js"), JointState)
    start = arm.setpoint_jp()
    step = np.zeros(len(start))
    step[0] = 0.2
    top_speed = {}
    for ratio, goal in ((0.25, start + step), (1.0, start)):
        arm.send("trajectory_j/set_ratio", Float64(ratio))
        ratios.wait(lambda message, ratio=ratio: message.data == ratio)
        setpoints.messages.clear()
        assert arm.move_jp(goal).wait()
        top_speed[ratio] = max(abs(message.velocity[0]) for message in setpoints.messages)
    assert top_speed[0.25] < 0.6 * top_speed[1.0]  # half of it where the move is too short for full speed
    arm.send("trajectory_j/set_ratio", Float64(1.5))
    stays(lambda: ratios.messages[-1].data == 1.0, "the ratio of 1")


@on_every_arm
def test_the_frame_of_a_tip_is_no_frame_for_its_own_base(arm, listen):
    """On /tf the arm would be its own parent."""
    from geometry_msgs.msg import PoseStamped
    from std_msgs.msg import String

    from tests.ros.crtk import pose_message

    base = PoseStamped(pose=pose_message([0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]))
    base.header.frame_id = arm.name
    before, pose = arm.hear("measured_cp").header.frame_id, arm.measured_cp()
    warnings = listen(arm.topic("warning"), String)
    arm.publish("set_base_frame", base)
    warnings.wait(lambda message: f"'{arm.name}' is the frame of the tip" in message.data)
    assert arm.hear("measured_cp").header.frame_id == before
    np.testing.assert_allclose(arm.measured_cp(), pose, atol=1e-3)


@on_every_arm
def test_a_base_frame_moves_poses_and_commands_but_not_local_ones(arm, node):
    from geometry_msgs.msg import PoseStamped

    from tests.ros.crtk import pose7, pose_message, shifted

    base = PoseStamped(pose=pose_message([0.1, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]))
    base.header.frame_id = "table"
    local, reference = arm.hear("local/measured_cp"), arm.hear("measured_cp").header.frame_id
    before = arm.measured_cp()
    arm.publish("set_base_frame", base)
    until(lambda: {arm.hear(reading).header.frame_id for reading in ("measured_cp", "setpoint_cp")} == {"table"})
    there = arm.setpoint_cp()
    np.testing.assert_allclose(there[:3], pose7(arm.hear("local/setpoint_cp").pose)[:3] + [0.1, 0.2, 0.3], atol=1e-6)
    assert arm.hear("local/measured_cp").header.frame_id == local.header.frame_id
    assert arm.move_cp(shifted(there, [0.01, 0.0, 0.0])).wait()
    np.testing.assert_allclose(arm.setpoint_cp()[:3], there[:3] + [0.01, 0.0, 0.0], atol=1e-4)
    assert arm.move_cp(there).wait()
    back = PoseStamped(pose=pose_message(between(before, pose7(local.pose))))
    back.header.frame_id = reference
    arm.publish("set_base_frame", back)
    until(lambda: arm.hear("measured_cp").header.frame_id == reference, "the base frame is back")


def between(pose: np.ndarray, local: np.ndarray) -> np.ndarray:
    """Pose (4, 4) of the base in the frame in which the tip has ``pose``, given that in the base it has ``local``."""
    from ligature.model.frames import inverse, pose7_matrix

    return pose7_matrix(pose) @ inverse(pose7_matrix(local))


@pytest.mark.parametrize("position", [[np.nan], [], [0.1, 0.2], [1e300]], ids=str)
def test_a_move_of_the_jaw_that_is_invalid_has_not_reached_its_goal(arms, position, listen):
    """Whether the ROS process rejects it for its numbers, or the arm for its length."""
    from sensor_msgs.msg import JointState
    from std_msgs.msg import Bool

    psm = at_home(arms["PSM1"])
    reached = listen(psm.topic("goal_reached"), Bool)
    assert psm.jaw.move_jp(0.2).wait(timeout=5.0)
    reached.wait(lambda message: message.data)
    psm.jaw.send("move_jp", JointState(position=position))
    # what moves before this one reached may still arrive before the answer
    reached.wait(lambda message: not message.data)
    assert psm.jaw.setpoint_jp() == pytest.approx(0.2)


@pytest.mark.parametrize("name", ["PSM1", "PSM2"])
def test_a_jaw_opens_and_closes(arms, name):
    psm = at_home(arms[name])
    assert psm.jaw.open_jaw().wait(timeout=5.0)
    assert psm.jaw.measured_jp() == pytest.approx(np.deg2rad(60.0), abs=0.02)
    assert psm.jaw.close_jaw().wait(timeout=5.0)
    until(lambda: abs(psm.jaw.setpoint_jp() + np.deg2rad(20.0)) < 1e-3, "it was sent to its end")
    psm.jaw.servo_jp(0.3)
    until(lambda: abs(psm.jaw.measured_jp() - 0.3) < 0.02, "the jaw is where it was sent")
