"""What a stranger's probe of CRTK finds: frames, scale, liveness, and the challenge's face over the same arms.

Ideas of black-box conformance suites, built by our own hand: a command's frame is distinguished by where the arm goes, its
scale by an anchor that does not speak CRTK (AMBF's state of the tool's body, in metres by the scene's file), its liveness
by the intervals in which a client hears it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ligature.model.frames import axis_rotation, frame, matrix_pose7, pose7_matrix

from tests.ros.conftest import BIN
from tests.waiting import stays, steady, until

pytestmark = pytest.mark.ros

ARMS = ("PSM1", "PSM2")
STEP = 0.01


@pytest.fixture(scope="module")
def program(start: Callable[..., Any], arms_scene: Path) -> Any:
    program = start(BIN / "ligature", "run", arms_scene, "-p", "500", "--no-cameras", "--src-crtk")
    program.wait_for("first state published")
    return program


@pytest.fixture(scope="module")
def arms(program: Any, node: Any) -> Iterator[dict[str, Any]]:
    from tests.ros import crtk

    found = {name: crtk.Psm(node, name) for name in ARMS}
    found["ECM"] = crtk.Arm(node, "ECM")
    for arm in found.values():
        arm.check_connections(10.0)
    yield found
    for arm in found.values():
        arm.close()


class Face:
    """One arm below ``/CRTK``, as the challenge's clients see it."""

    def __init__(self, node: Any, name: str) -> None:
        from geometry_msgs.msg import PoseStamped
        from sensor_msgs.msg import JointState

        from tests.ros.crtk import Link, arrays, pose7, pose_message

        self.link = Link(node, f"/CRTK/{name}")
        self._types = PoseStamped, JointState, pose_message
        self._pose7, self._arrays = pose7, arrays
        for topic in ("measured_cp", "setpoint_cp", "T_b_w"):
            self.link.listen(topic, PoseStamped)
        self.link.listen("measured_js", JointState)
        for topic in ("servo_cp", "move_cp", "servo_cr"):
            self.link.talk(topic, PoseStamped)
        for topic in ("servo_jp", "move_jp"):
            self.link.talk(topic, JointState)

    def pose(self, topic: str = "measured_cp") -> Any:
        return pose7_matrix(self._pose7(self.link.hear(topic).pose))

    def joints(self) -> Any:
        return self._arrays(self.link.hear("measured_js"))[0]

    def command(self, verb: str, T: Any) -> None:
        PoseStamped, _, message = self._types
        self.link.send(verb, PoseStamped(pose=message(matrix_pose7(T))))

    def command_joints(self, verb: str, q: Any) -> None:
        self.link.send(verb, self._types[1](position=list(q)))


@pytest.fixture(scope="module")
def faces(program: Any, node: Any) -> Iterator[dict[str, Face]]:
    found = {name: Face(node, name.lower()) for name in ARMS}
    for face in found.values():
        face.link.check_connections(10.0)
    yield found
    for face in found.values():
        face.link.close()


def near(one: Any, other: Any, metres: float = 5e-4) -> bool:
    return bool(np.linalg.norm(one[:3, 3] - other[:3, 3]) < metres)


# --- the challenge's face ---------------------------------------------------------------------


def reachable(face: Face, arm: Any, depth: float = 0.1) -> Any:
    """A pose below the remote centre, from the arm's own forward kinematics."""
    answer = arm.forward_kinematics([0.1, -0.1, depth, 0.2, 0.1, -0.1], local=True)
    assert answer.result
    from tests.ros.crtk import pose7

    return pose7_matrix(pose7(answer.cp))


def test_a_fresh_arm_goes_where_the_challenge_s_clients_send_it(
    arms: Any, faces: Any, listen: Callable[..., Any]
) -> None:
    """The challenge's node knows no states: a Cartesian demonstration begins at insertion zero."""
    from crtk_msgs.msg import OperatingState

    face, arm = faces["PSM1"], arms["PSM1"]
    assert arm.state.now.state == "DISABLED" and abs(face.joints()[2]) < 1e-3
    goal = reachable(face, arm)
    face.command("servo_cp", goal)
    until(lambda: near(face.pose(), goal), lambda: f"{face.pose()[:3, 3]} is not {goal[:3, 3]}", 20.0)
    assert near(face.pose("setpoint_cp"), goal, 1e-6)
    higher = reachable(face, arm, 0.13)
    face.command("move_cp", higher)
    until(lambda: near(face.pose(), higher), "the move ends", 20.0)
    state = listen("/PSM1/operating_state", OperatingState).wait()
    assert state.state == "ENABLED" and not state.is_homed, "the arm is driven, and was never homed"


def test_home_inserts_an_arm_that_the_challenge_s_face_drove(arms: Any, faces: Any) -> None:
    """A command below /CRTK leaves the arm's own face as it was: home homes it, and servo_cp is taken after it."""
    face, arm = faces["PSM2"], arms["PSM2"]
    face.command_joints("servo_jp", [0.2, 0.1, 0.02, 0.0, 0.0, 0.0])
    until(lambda: abs(face.joints()[0] - 0.2) < 1e-3, "the arm follows", 20.0)
    assert arm.state.now.state == "ENABLED" and not arm.state.now.is_homed
    arm.servo_jp([0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    stays(lambda: abs(face.joints()[0] - 0.2) < 2e-3, "its own face takes no motion before it is homed", 0.3)
    assert arm.home(20.0)
    until(lambda: abs(arm.measured_jp()[2] - 0.12) < 1e-3, "home inserts", 20.0)
    goal = arm.setpoint_cp()
    goal[2] -= STEP
    arm.servo_cp(goal)
    until(lambda: np.linalg.norm(arm.measured_cp()[:3] - goal[:3]) < 5e-4, "servo_cp is taken", 20.0)


def test_what_the_challenge_s_face_rejects_names_its_topic(
    program: Any, faces: Any, listen: Callable[..., Any]
) -> None:
    from std_msgs.msg import String

    warning = listen("/PSM1/warning", String)
    face = faces["PSM1"]
    before = len(program.lines)
    face.command("servo_cp", frame(np.eye(3), (0.0, 0.0, 0.0)))
    text = warning.wait(lambda m: m.data.startswith("CRTK/psm1/servo_cp: ")).data
    assert "PSM1" in text
    until(
        lambda: any("/CRTK/psm1/servo_cp: " in line for line in program.lines[before:]), "the terminal reports it", 10.0
    )
    assert not any("/PSM1: CRTK" in line or "/PSM1: servo_cp" in line for line in program.lines[before:])


def test_a_jaw_of_the_challenge_s_face_without_an_angle_is_rejected_in_words(program: Any, node: Any) -> None:
    from sensor_msgs.msg import JointState

    jaw = node.Publisher("/CRTK/psm1/jaw/servo_jp", JointState, queue_size=1)
    until(lambda: jaw.get_num_connections(), "the run listens", 20.0)
    jaw.publish(JointState())
    program.wait_for("/CRTK/psm1/jaw/servo_jp: command rejected: jaw/servo_jp takes the angle of a finger", 20.0)


def test_joints_that_are_out_of_reach_are_clipped_and_the_arm_moves(arms: Any, faces: Any) -> None:
    face = faces["PSM1"]
    face.command_joints("servo_jp", [9.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    until(lambda: face.joints()[0] > 1.4, "as far as the limit", 20.0)
    face.command_joints("servo_jp", [0.0, 0.0, 0.1, 0.0, 0.0, 0.0])
    until(lambda: abs(face.joints()[0]) < 1e-3, "back", 20.0)


def test_relative_steps_add_up_on_both_faces(arms: Any, faces: Any, publish: Callable[..., Any]) -> None:
    from geometry_msgs.msg import PoseStamped

    face = faces["PSM1"]
    face.command_joints("servo_jp", [0.0, 0.0, 0.12, 0.0, 0.0, 0.0])
    until(lambda: abs(face.joints()[2] - 0.12) < 5e-4, "ready", 20.0)
    before = face.pose("setpoint_cp")
    for _ in range(5):
        face.command("servo_cr", frame(axis_rotation(np.array([0.0, 0.0, 1.0]), 0.02), (0.001, 0.0, -0.001)))
        time.sleep(0.05)
    wanted = frame(axis_rotation(np.array([0.0, 0.0, 1.0]), 0.1) @ before[:3, :3], before[:3, 3] + [0.005, 0.0, -0.005])
    until(lambda: near(face.pose(), wanted, 3e-4), lambda: f"{face.pose()} is not {wanted}", 20.0)
    assert np.abs(face.pose()[:3, :3] - wanted[:3, :3]).max() < 5e-3
    arm = ready(arms["PSM2"])
    start = arm.setpoint_cp()
    step = publish("/PSM2/servo_cr", PoseStamped)
    for _ in range(3):
        message = PoseStamped()
        message.pose.position.y, message.pose.orientation.w = 0.002, 1.0
        step.publish(message)
        time.sleep(0.05)
    until(lambda: abs(arm.measured_cp()[1] - start[1] - 0.006) < 3e-4, "three steps", 20.0)


# --- frames, scale, liveness ------------------------------------------------------------------


def ready(arm: Any) -> Any:
    assert arm.enable(10.0)
    assert arm.home(20.0)
    home = np.array([0.0, 0.0, 0.12, 0.0, 0.0, 0.0])[: len(arm.setpoint_jp())]
    assert arm.move_jp(home).wait()
    steady(arm.measured_jp, within=1e-4)
    return arm


@pytest.fixture
def psm(arms: Any) -> Any:
    return ready(arms["PSM2"])


def turned_by(arm: Any, T: Any, node: Any, reference: str = "elsewhere") -> None:
    """Set the base frame of an arm."""
    from geometry_msgs.msg import PoseStamped

    from tests.ros.crtk import pose_message

    message = PoseStamped(pose=pose_message(matrix_pose7(T)))
    message.header.frame_id = reference
    arm.send("set_base_frame", message)
    # readings are topics of their own: each of them arrives in the new frame when it arrives
    for reading in ("measured_cp", "setpoint_cp"):
        until(lambda name=reading: arm.hear(name).header.frame_id == reference, f"{reading} in {reference}", 10.0)


def test_commands_are_in_the_frame_that_measured_cp_names_and_local_ones_in_the_base(psm: Any, node: Any) -> None:
    """Distinguished by a base that is turned by a right angle: a step in x of one is a step in y of the other."""
    turn = frame(axis_rotation(np.array([0.0, 0.0, 1.0]), np.pi / 2), (0.5, 0.0, 0.0))
    turned_by(psm, turn, node)
    try:
        local = pose7_matrix(np.array(_seven(psm.hear("local/measured_cp").pose)))
        assert np.abs(pose7_matrix(psm.measured_cp()) - turn @ local).max() < 1e-3
        goal = psm.setpoint_cp()
        goal[0] += STEP
        psm.servo_cp(goal)
        until(lambda: np.linalg.norm(psm.measured_cp()[:3] - goal[:3]) < 1e-4, "it gets there", 10.0)
        steady(psm.measured_jp, within=1e-4)
        moved = pose7_matrix(np.array(_seven(psm.hear("local/measured_cp").pose)))[:3, 3] - local[:3, 3]
        assert moved == pytest.approx(turn[:3, :3].T @ [STEP, 0.0, 0.0], abs=5e-4)
        assert psm.hear("local/measured_cp").header.frame_id == "PSM2_base"
    finally:
        turned_by(psm, np.eye(4), node, "PSM2_base")


def test_the_challenge_s_face_is_in_the_base_whatever_the_base_frame_is(psm: Any, faces: Any, node: Any) -> None:
    face = faces["PSM2"]
    before = face.pose()
    turned_by(psm, frame(axis_rotation(np.array([0.0, 0.0, 1.0]), np.pi / 2), (0.5, 0.0, 0.0)), node)
    try:
        assert near(face.pose(), before, 1e-3)
        goal = face.pose("setpoint_cp")
        goal[0, 3] += STEP
        face.command("servo_cp", goal)
        until(lambda: near(face.pose(), goal), "it gets there", 10.0)
    finally:
        turned_by(psm, np.eye(4), node, "PSM2_base")


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_a_metre_of_crtk_is_a_metre_of_the_scene(psm: Any, listen: Callable[..., Any], axis: int) -> None:
    """The anchor is AMBF's pose of the tool's body, which knows nothing of CRTK; a step of 10 mm is one of 10 mm."""
    from ambf_msgs.msg import RigidBodyState

    anchor = listen("/ambf/env/psm2/toolyawlink/State", RigidBodyState)

    def place() -> Any:
        p = anchor.wait().pose.position
        return np.array([p.x, p.y, p.z])

    start, begin = place(), psm.setpoint_cp()
    goal = begin.copy()
    goal[axis] += STEP if axis != 2 else -STEP
    psm.servo_cp(goal)
    until(lambda: np.linalg.norm(psm.measured_cp()[:3] - goal[:3]) < 2e-4, "it gets there", 10.0)
    steady(place, within=1e-5)
    assert np.linalg.norm(place() - start) / STEP == pytest.approx(1.0, abs=0.03)
    base = pose7_matrix(np.array(_seven(listen(*_base_of("PSM2")).wait().pose)))
    assert base[:3, :3] @ (goal - begin)[:3] == pytest.approx(place() - start, abs=3e-4)


def test_readings_live_at_their_rate(arms: Any, node: Any) -> None:
    """Rate, and the longest silence within 5 s; a client counts a reading as lost after 20 ms of the library's default."""
    from geometry_msgs.msg import PoseStamped
    from sensor_msgs.msg import JointState

    from tests.ros.conftest import Listener

    listeners = {
        f"{name}/{topic}": Listener(node, f"/{name}/{topic}", type_)
        for name in ("PSM1", "PSM2", "ECM") for topic, type_ in (("measured_cp", PoseStamped), ("measured_js", JointState))
    }  # fmt: skip
    for listener in listeners.values():
        listener.wait()
    time.sleep(5.0)
    for name, listener in listeners.items():
        stamps = np.array([message.header.stamp.to_sec() for message in listener.messages])
        rate = (len(stamps) - 1) / (stamps[-1] - stamps[0])
        assert 150.0 < rate < 250.0, f"{name}: {rate:.0f} Hz"
        assert (np.diff(stamps) >= 0.0).all(), f"{name}: stamps go back"
        assert np.percentile(np.diff(listener.times), 95) < 0.02, name
        listener.close()


def test_a_switch_and_a_scale_of_the_console_stay_fresh(program: Any, node: Any) -> None:
    """Clients take nothing that is older than a second, whether it changed or not."""
    from tests.ros.crtk import Console

    console = Console(node)
    console.check_connections(10.0)
    time.sleep(1.0)
    for _ in range(40):
        assert console.hear("teleop/scale").data == 0.2
        time.sleep(0.1)
    console.close()


def _seven(pose: Any) -> Any:
    from tests.ros.crtk import pose7

    return pose7(pose)


def _base_of(arm: str) -> tuple[str, Any]:
    from geometry_msgs.msg import PoseStamped

    return f"/SUJ/{arm}/local/measured_cp", PoseStamped
