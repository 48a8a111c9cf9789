"""The examples of rostest that labs copy: objects, arms, a task's score, teleoperation; and what they wait for."""

from __future__ import annotations

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from tests.ros.conftest import BIN, ROOT, SMALL, Program

pytestmark = pytest.mark.ros
EXAMPLES = ROOT / "examples" / "rostest"


@pytest.mark.parametrize("name", sorted(path.stem for path in EXAMPLES.glob("*.test")))
def test_an_example_passes(name: str, ros_env: dict[str, str], tmp_path: Path) -> None:
    env = dict(ros_env, ROS_PACKAGE_PATH=f"{ROOT}:{ROOT / 'ros_msgs'}", ROS_HOME=str(tmp_path))
    done = subprocess.run(
        ["/usr/bin/rostest", EXAMPLES / f"{name}.test"], env=env, capture_output=True, text=True, timeout=280
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert "RESULT: SUCCESS" in done.stdout and " * TESTS: 1" in done.stdout


def test_a_package_of_a_stranger_tests_its_own_scene(ros_env: dict[str, str], tmp_path: Path) -> None:
    """The package to copy, where it is none of ours: its folder alone is known besides ours."""
    shutil.copytree(EXAMPLES / "my_lab", tmp_path / "my_lab")
    env = dict(ros_env, ROS_PACKAGE_PATH=f"{ROOT}:{ROOT / 'ros_msgs'}:{tmp_path}", ROS_HOME=str(tmp_path / "ros"))
    done = subprocess.run(
        ["/usr/bin/rostest", "my_lab", "fall.test"], env=env, capture_output=True, text=True, timeout=280
    )
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    assert "RESULT: SUCCESS" in done.stdout and " * TESTS: 1" in done.stdout


@pytest.mark.parametrize("prefix", ["", "/left"])
def test_ready_reaches_whoever_asks_later(start: Callable[..., Program], node: Any, prefix: str) -> None:
    """Latched, and not before states can be had."""
    from ambf_msgs.msg import RigidBodyState
    from std_msgs.msg import Bool

    given = ["--ns", prefix] if prefix else []
    program = start(BIN / "ligature", "run", SMALL, "-p", "200", "--no-cameras", *given)
    program.wait_for("first state published")
    for _ in range(2):
        assert node.wait_for_message(f"{prefix}/ligature/ready", Bool, 20.0).data
    assert node.wait_for_message(f"{prefix}/ambf/env/phantom/Needle/State", RigidBodyState, 5.0).sim_step > 0
    assert program.end(20) == 0
