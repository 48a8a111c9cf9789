"""A device drives its proxy on ROS where the scene has no arm: the pose by its scale, the grip, and it holds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ligature.model.frames import pose7_matrix

from tests.model.test_proxies import write_scene
from tests.ros.conftest import BIN
from tests.ros.drivers import TIMEOUT, Pen, apart
from tests.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.timeout(300)]


def test_a_pen_drives_its_proxy_which_holds_when_the_pen_falls_silent(
    node: Any, start: Callable[..., Any], listen: Callable[..., Any], tmp_path: Path
) -> None:
    from ambf_msgs.msg import RigidBodyState
    from std_msgs.msg import Bool, String

    launch = write_scene(tmp_path)
    start(BIN / "ligature", "run", launch, "-i", "0", "-p", "500", "--no-cameras").wait_for("first state published")
    patient = ("--timeout", "2.0")  # a busy machine keeps the pen waiting for longer than 0.1 s
    start(BIN / "ligature", "teleop", launch, "-i", "0", *patient).wait_for("driving: arm1 → Proxy0")
    state = listen("/ambf/env/simulated_device/palm/State", RigidBodyState)
    follows, status = listen("/arm1_Proxy0/following", Bool), listen("/arm1_Proxy0/status", String)
    pen = Pen(node)

    def pose() -> Any:
        p = state.messages[-1].pose.position
        q = state.messages[-1].pose.orientation
        return pose7_matrix(np.array([p.x, p.y, p.z, q.x, q.y, q.z, q.w]))

    try:
        until(lambda: follows.messages and follows.messages[-1].data, lambda: status.messages[-1:], 60.0)
        before = pose()
        pen.glide((0.04, 0.0, 0.0), (0.0, 0.0, 0.2))
        wanted = (20.0, np.rad2deg(0.2))
        until(lambda: apart(pose(), before) == pytest.approx(wanted, abs=0.5), lambda: apart(pose(), before))
        pen.press(white=1)
        joints = np.array([-0.3, 0.0])
        until(
            lambda: np.abs(np.array(state.messages[-1].joint_positions) - joints).max() < 0.03,
            lambda: f"the grip closes: {state.messages[-1].joint_positions}, {status.messages[-1].data}",
        )
        pen.muted = True
        status.wait(lambda m: "silent" in m.data, TIMEOUT)
        held = pose()
        count = len(state.messages)
        until(lambda: len(state.messages) > count + 100, "no states")
        assert apart(pose(), held)[0] < 0.5
        assert apart(pose(), before)[0] == pytest.approx(20.0, abs=0.5)
    finally:
        pen.close()


@pytest.mark.parametrize("forces", [True, False])
def test_a_proxy_presses_the_hand_that_is_ahead_of_it_unless_forces_are_off(
    node: Any, begin: Callable[..., Any], env: dict[str, str], tmp_path: Path, forces: bool
) -> None:
    """The driver takes `geometry_msgs/WrenchStamped`; the world's state counts the device. In a process of its own."""
    import subprocess
    import sys

    launch = write_scene(tmp_path)
    devices = tmp_path / "devices.yaml"
    gains = "  haptic gain: {linear: 200.0, angular: 2.0}\n"
    text = devices.read_text()
    devices.write_text(text.replace("arm1:\n", "arm1:\n" + gains, 1))
    assert gains in devices.read_text()
    command = [BIN / "ambf_simulator", "--launch_file", launch, "-l", "0", "-n", "1", "-p", "500"]
    begin(*command, "-e", int(forces), "-d", "500", "-f", "1", "-s", "0.9").wait_for("first state published")
    hand = subprocess.Popen([sys.executable, "-c", HAND], env=env, stdout=subprocess.PIPE, text=True)
    begin(BIN / "ligature", "teleop", launch, "-i", "0", "--timeout", 2).wait_for("driving: arm1 → Proxy0")
    output, _ = hand.communicate(timeout=120)
    devices_there, most, rate, step = (float(word) for word in output.split())
    assert devices_there == 1.0 and step == pytest.approx(0.9 / 500)
    if forces:
        assert 0.1 < most < 3.01, f"{most} N against a hand that moves on"
        assert rate < 550.0
    else:
        assert most == 0.0 and rate == 0.0


HAND = """
import sys, time
import rospy
from ambf_msgs.msg import WorldState
from geometry_msgs.msg import PoseStamped, WrenchStamped
from std_msgs.msg import Bool, String
rospy.init_node("hand", anonymous=True, disable_signals=True)
felt, follows, world, status = [], [], [], []
rospy.Subscriber("/arm1/force_feedback", WrenchStamped, lambda m: felt.append((time.monotonic(), m.wrench.force.x)))
rospy.Subscriber("/arm1_Proxy0/status", String, lambda m: status.append(m.data))
rospy.Subscriber("/arm1_Proxy0/following", Bool, lambda m: follows.append(m.data))
rospy.Subscriber("/World/State", WorldState, lambda m: world.append(m.n_devices))
pose = rospy.Publisher("/arm1/pose", PoseStamped, queue_size=10, tcp_nodelay=True)
message = PoseStamped()
message.pose.orientation.w = 1.0
end = time.monotonic() + 40.0
while not (follows and follows[-1] and world):
    assert time.monotonic() < end, (follows[-3:], world[-1:], status[-2:])
    pose.publish(message)
    time.sleep(0.005)
felt.clear()
start = time.monotonic()
for k in range(500):  # 0.2 m/s to the right, then still
    message.pose.position.x += 0.0004 if k < 300 else 0.0
    pose.publish(message)
    time.sleep(0.002)
seconds = time.monotonic() - start
print(world[-1], max([-x for _, x in felt], default=0.0), len(felt) / seconds, rospy.get_param("/ligature/haptics")["step"])
"""
