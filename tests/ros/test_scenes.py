"""Every scene of ours answers on ROS: its bodies report, its arms get ready and move."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import ligature
import numpy as np
import pytest

from tests.ros.conftest import BIN, ROOT, Listener, Program
from tests.ros.crtk import Psm

pytestmark = pytest.mark.ros
TRIED_ELSEWHERE = ("suturing", "suturing_small")
LAUNCHES = sorted(path for path in ROOT.glob("scenes/*/launch*.yaml") if path.parent.name not in TRIED_ELSEWHERE)
QUICK = ("blender_suturing", "ligating", "soft_suturing")
"""Scenes that `make test` runs: written by Blender, without a needle, with soft tissue; `make test-slow` runs them all."""


@pytest.mark.parametrize(
    "launch",
    [pytest.param(path, marks=[] if path.parent.name in QUICK else [pytest.mark.slow]) for path in LAUNCHES],
    ids=[path.parent.name for path in LAUNCHES],
)
def test_a_scene_of_ours_answers(
    launch: Path, ros_env: dict[str, str], node: Any, listen: Callable[..., Listener]
) -> None:
    from ambf_msgs.msg import RigidBodyState, WorldState

    name = ligature.load(launch).arms[0].name
    program = Program([str(BIN / "ligature"), "run", str(launch), "--no-cameras"], ros_env)
    try:
        program.wait_for("first state published")
        assert listen("/ambf/env/World/State", WorldState).wait().n_devices >= 0
        tool = listen(f"/ambf/env/{name.lower()}/toolyawlink/State", RigidBodyState)
        before = tool.wait().pose.position
        psm = Psm(node, name)
        psm.check_connections(10.0)
        assert psm.enable(10.0) and psm.home(20.0)
        assert psm.move_jp(psm.setpoint_jp() + [0.1, -0.1, 0.01, 0.0, 0.0, 0.0]).wait()
        after = tool.wait(lambda state: abs(state.pose.position.z - before.z) > 1e-3).pose.position
        assert np.isfinite([after.x, after.y, after.z]).all()
        psm.close()
        assert program.end() == 0, program.output
    finally:
        program.end()
