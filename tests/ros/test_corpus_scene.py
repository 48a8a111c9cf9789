"""The scene that a lab already has, started with the lab's own command line, seen with ROS's own tools."""

from __future__ import annotations

import shlex
import subprocess
import xmlrpc.client
from collections.abc import Callable
from pathlib import Path

import pytest
import yaml

from tests.ros.conftest import BIN, Program, free_port
from tests.waiting import until

pytestmark = [pytest.mark.ros, pytest.mark.corpus]
NEEDLE = "/ambf/env/phantom/Needle"
FLAGS = "-l 10,11,6,7,8,9 -g 0 -p 200 -t 1 --override_max_comm_freq 100 --override_min_comm_freq 100"
EXTRA = {
    "/ligature/ready": "std_msgs/Bool",
    "/ligature/paused": "std_msgs/Bool",
    "/ligature/set_speed": "std_msgs/Float64",
    "/ligature/phase": "std_msgs/String",
    "/ambf/env/World/Command/ResetBodies": "std_msgs/Empty",
    "/ambf/env/phantom/BlackGround1/State": "ambf_msgs/RigidBodyState",
    "/ambf/env/phantom/BlackGround1/Command": "ambf_msgs/RigidBodyCmd",
    **{f"/ambf/env/cameras/camera{side}/State": "ambf_msgs/CameraState" for side in "LR"},
    **{f"/ambf/env/cameras/camera{side}/Command": "ambf_msgs/CameraCmd" for side in "LR"},
    "/diagnostics": "diagnostic_msgs/DiagnosticArray",
}
"""What is advertised beyond the reference's list, with the reason in docs/ros_interface.md."""

OURS = (
    "/rosout",
    "/tf",
    "/PSM1/",
    "/PSM2/",
    "/ECM/",
    "/MTML/",
    "/MTMR/",
    "/SUJ/",
    "/console/",
    "/system/",
    "/footpedals/",
)
"""Names of ROS itself and of the dVRK, which the reference has not; `tests/ros/test_arms.py` looks at them."""


@pytest.fixture(scope="module")
def env(ros_env: dict[str, str], start: Callable[..., Program], corpus: Path) -> dict[str, str]:
    """Environment of a master on which the lab's scene runs, and nothing else."""
    own = dict(ros_env, ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}", PYTHONUNBUFFERED="1")
    program = start(
        BIN / "ambf_simulator", "--launch_file", corpus / "suturing_scene" / "launch.yaml", *shlex.split(FLAGS), env=own
    )
    program.wait_for("first state published")
    return own


def test_topics_and_types_are_the_references_but_for_what_the_documentation_lists(
    env: dict[str, str], golden: Path
) -> None:
    wanted = dict(line.split() for line in (golden / "rostopic_types.txt").read_text().splitlines() if line)
    _, _, types = xmlrpc.client.ServerProxy(env["ROS_MASTER_URI"]).getTopicTypes("/test")  # type: ignore[misc]
    there = {name: type_ for name, type_ in types if not name.startswith(OURS)}  # type: ignore[union-attr]
    assert there == {name: type_ for name, type_ in wanted.items() if not name.startswith("/rosout")} | EXTRA


def test_rostopic_echo_shows_the_needle_where_the_file_puts_it(env: dict[str, str]) -> None:
    done = subprocess.run(
        ["/usr/bin/rostopic", "echo", "-n", "1", f"{NEEDLE}/State"],
        env=env, capture_output=True, text=True, timeout=20, check=True,
    )  # fmt: skip
    state = yaml.safe_load(done.stdout.partition("---")[0])
    assert [state["pose"]["position"][axis] for axis in "xy"] == pytest.approx([0.00919, 0.20961], abs=5e-4)


def test_rostopic_hz_reads_the_rate_that_was_asked_for(env: dict[str, str], start: Callable[..., Program]) -> None:
    hz = start("/usr/bin/rostopic", "hz", "-w", "300", f"{NEEDLE}/State", env=env)

    def rates() -> list[float]:
        return [float(line.rpartition(":")[2]) for line in hz.lines if "average rate" in line]

    until(lambda: any(abs(rate - 100) <= 5 for rate in rates()[3:]), rates, 30.0)
    hz.end()
