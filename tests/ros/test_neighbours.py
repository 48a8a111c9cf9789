"""Two simulators on one ROS master."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from tests.ros.conftest import BIN, SMALL, Program
from tests.waiting import until

pytestmark = pytest.mark.ros


@pytest.fixture(scope="module", autouse=True)
def first(start: Callable[..., Program]) -> Iterator[Program]:
    program = start(BIN / "ligature", "run", SMALL, "-p", "100")
    program.wait_for("first state published")
    yield program
    assert "restarting it" not in program.output


def test_a_second_simulator_of_the_same_world_ends_and_states_what_to_do(
    start: Callable[..., Program], listen: Callable[..., Any]
) -> None:
    from ambf_msgs.msg import WorldState

    second = start(BIN / "ligature", "run", SMALL, "-p", "100")
    assert second.process.wait(20) == 1
    assert "another simulator runs on this ROS master (node /ligature at http://" in second.output
    assert "'--ns'" in second.output
    assert listen("/ambf/env/World/State", WorldState).comes_at(20, seconds=0.5)


@pytest.fixture(scope="module")
def left(start: Callable[..., Program]) -> Iterator[Program]:
    """A simulator with a prefix."""
    program = start(BIN / "ligature", "run", SMALL, "-p", "100", "--ns", "/left", "--src-crtk")
    program.wait_for("first state published")
    yield program
    assert program.end() == 0
    assert "stays silent" not in program.output


def test_a_simulator_with_a_prefix_lives_beside_it(left: Program, listen: Callable[..., Any]) -> None:
    from ambf_msgs.msg import RigidBodyState

    for prefix in ("", "/left"):
        message = listen(f"{prefix}/ambf/env/phantom/Needle/State", RigidBodyState).wait()
        assert message.identifier.data == f"{prefix}/ambf/env/phantom/BODY Needle"
    assert "left out" not in left.output


def test_frames_of_two_simulators_are_distinguished(left: Program, listen: Callable[..., Any]) -> None:
    from geometry_msgs.msg import PoseStamped
    from sensor_msgs.msg import CameraInfo
    from tf2_msgs.msg import TFMessage

    tf, fixed = listen("/tf", TFMessage), listen("/tf_static", TFMessage)
    info = listen("/left/ambf/env/cameras/cameraL/CameraInfo", CameraInfo).wait(seconds=60.0)
    poses = {
        topic: listen(f"/left/{topic}", PoseStamped).wait().header.frame_id
        for topic in ("PSM1/local/measured_cp", "MTML/measured_cp", "SUJ/PSM1/local/measured_cp")
    }
    wanted = {("world", "PSM1_base"), ("PSM1_base", "PSM1"), ("HRSV", "MTML"), ("world", "cameraL")}
    with_prefix = {(f"left/{parent}", f"left/{child}") for parent, child in wanted}

    def seen() -> set[tuple[str, str]]:
        messages = [*tf.messages, *fixed.messages]
        return {(t.header.frame_id, t.child_frame_id) for message in messages for t in message.transforms}

    tf.wait(lambda _: with_prefix <= seen(), 60.0)
    assert info.header.frame_id == "left/cameraL_optical"
    assert set(poses.values()) == {"left/PSM1_base", "left/HRSV", "left/Cart"}
    half = [pair for pair in seen() if pair[0].startswith("left/") != pair[1].startswith("left/")]
    assert half == []  # no frame of one hangs below a frame of the other


@pytest.fixture(scope="module")
def both(left: Program, start: Callable[..., Program], node: Any) -> Iterator[dict[str, Any]]:
    """A PSM of each of two simulators with prefixes, beside the one without."""
    from tests.ros import crtk

    right = start(BIN / "ligature", "run", SMALL, "-p", "100", "--no-cameras", "--ns", "/right", "--src-crtk")
    right.wait_for("first state published")
    arms = {side: crtk.Psm(node, f"{side}/PSM1") for side in ("left", "right")}
    for arm in arms.values():
        arm.check_connections(10.0)
    yield arms
    for arm in arms.values():
        arm.close()
    assert right.end() == 0
    assert "stays silent" not in right.output


def test_two_simulators_with_prefixes_are_driven_independently(both: dict[str, Any], node: Any) -> None:
    from tests.ros import crtk

    system = crtk.System(node, "left/system")
    system.check_connections(10.0)
    system.send("power_on", crtk.Empty())
    left, right = both["left"], both["right"]
    until(lambda: left.state.now.state == "ENABLED", "the left one has power", 20.0)
    assert right.state.now.state == "DISABLED", "the right one has not"
    assert left.home(20.0) and right.enable(10.0) and right.home(20.0)
    goals = {"left": [0.2, 0.0, 0.13, 0.0, 0.0, 0.0], "right": [-0.2, 0.1, 0.11, 0.0, 0.0, 0.0]}
    moves = [both[side].move_jp(goal) for side, goal in goals.items()]
    assert all(move.wait() for move in moves)
    for side, goal in goals.items():
        until(lambda side=side, goal=goal: np.allclose(both[side].measured_jp(), goal, atol=2e-3), side, 10.0)
    left.send("servo_jp", crtk.JointState(position=[0.0] * 2 + [0.13, 0.0, 0.0, 0.0]))
    until(lambda: abs(left.measured_jp()[0]) < 2e-3, "the left one goes back", 10.0)
    assert np.allclose(right.measured_jp(), goals["right"], atol=2e-3)
    system.close()


def test_everything_of_a_simulator_with_a_prefix_is_below_it(both: dict[str, Any], listen: Callable[..., Any]) -> None:
    """No topic and no service of it stands elsewhere, but those that every node has, and frames for everybody."""
    import rosgraph
    from tf2_msgs.msg import TFMessage

    everybody = {"/rosout", "/diagnostics", "/tf", "/tf_static"}
    published, subscribed, services = rosgraph.Master("/look").getSystemState()
    names = [
        name for kind in (published, subscribed, services) for name, nodes in kind if "/ligature_left_ambf_env" in nodes
    ]
    assert len(names) > 300
    outside = {name for name in names if not name.startswith(("/left/", "/ligature_left_ambf_env/"))}
    assert outside <= everybody
    for side, other in (("left", "right"), ("right", "left")):
        tf = listen(f"/{side}/tf", TFMessage)
        tf.wait(lambda m: any(t.child_frame_id.endswith("PSM1") for t in m.transforms), 20.0)
        frames = {t.child_frame_id for m in tf.messages for t in m.transforms}
        assert f"{side}/PSM1" in frames and not any(name.startswith(f"{other}/") for name in frames)
