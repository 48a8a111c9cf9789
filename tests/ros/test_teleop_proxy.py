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
    start(BIN / "ligature", "teleop", launch, "-i", "0").wait_for("driving: arm1 → Proxy0")
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
        until(lambda: np.abs(np.array(state.messages[-1].joint_positions) - joints).max() < 0.03, "the grip closes")
        pen.muted = True
        status.wait(lambda m: "silent" in m.data, TIMEOUT)
        held = pose()
        count = len(state.messages)
        until(lambda: len(state.messages) > count + 100, "no states")
        assert apart(pose(), held)[0] < 0.5
        assert apart(pose(), before)[0] == pytest.approx(20.0, abs=0.5)
    finally:
        pen.close()
