"""Two simulators on one ROS master."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.ros.conftest import BIN, SMALL, Program

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
    assert listen("/ambf/env/World/State", WorldState).rate(0.5) > 20


def test_a_simulator_with_a_prefix_lives_beside_it(start: Callable[..., Program], listen: Callable[..., Any]) -> None:
    from ambf_msgs.msg import RigidBodyState

    second = start(BIN / "ligature", "run", SMALL, "-p", "100", "--ns", "/left")
    second.wait_for("first state published")
    for prefix in ("", "/left"):
        message = listen(f"{prefix}/ambf/env/phantom/Needle/State", RigidBodyState).wait()
        assert message.identifier.data == f"{prefix}/ambf/env/phantom/BODY Needle"
    assert "left out" not in second.output
    assert second.end() == 0


def test_frames_of_two_simulators_are_distinguished(start: Callable[..., Program], listen: Callable[..., Any]) -> None:
    from geometry_msgs.msg import PoseStamped
    from sensor_msgs.msg import CameraInfo
    from tf2_msgs.msg import TFMessage

    second = start(BIN / "ligature", "run", SMALL, "-p", "100", "--ns", "/left")
    second.wait_for("first state published")
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
    assert second.end() == 0
