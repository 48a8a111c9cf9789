"""The repository as ROS packages: built by Debian's catkin, started by roslaunch."""

from __future__ import annotations

import os
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest

from tests.ros.conftest import ROOT, Program, free_port

pytestmark = pytest.mark.ros


def test_message_packages_and_the_simulator_build_under_catkin(tmp_path: Path) -> None:
    source = tmp_path / "src"
    (source / "ligature").mkdir(parents=True)
    for name in ("ambf_msgs", "cisst_msgs", "crtk_msgs"):
        (source / name).symlink_to(ROOT / "ros_msgs" / name)
    for name in ("package.xml", "CMakeLists.txt", "setup.py", "simulator", "launch", "scenes"):
        (source / "ligature" / name).symlink_to(ROOT / name)
    env = {name: value for name, value in os.environ.items() if not name.startswith(("ROS_", "PYTHONPATH", "VIRTUAL"))}
    env.update(PATH="/usr/bin:/bin", PWD=str(tmp_path))
    done = subprocess.run(
        ["/usr/bin/catkin_make", "-DPYTHON_EXECUTABLE=/usr/bin/python3"],
        cwd=tmp_path, env=env, capture_output=True, text=True, timeout=240,
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-3000:] + done.stderr[-3000:]
    (packages,) = (tmp_path / "devel" / "lib").glob("python3*/*-packages")
    assert {"ambf_msgs", "cisst_msgs", "crtk_msgs", "ligature"} <= {path.name for path in packages.iterdir()}
    generated = (packages / "ambf_msgs" / "msg" / "_RigidBodyState.py").read_text()
    assert "c0ba0eb38f2481828a038f3b17ce0623" in generated


def test_roslaunch_starts_the_small_scene(start: Callable[..., Program], ros_env: dict[str, str]) -> None:
    env = dict(ros_env, ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}")
    env["ROS_PACKAGE_PATH"] = f"{ROOT}:{ROOT / 'ros_msgs'}"
    program = start("/usr/bin/roslaunch", ROOT / "launch" / "suturing_small.launch", "options:=-p 200", env=env)
    program.wait_for("first state published")
    assert program.end(20) == 0
