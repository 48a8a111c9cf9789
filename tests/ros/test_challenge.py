"""The suturing challenge's scripts, call by call through our client, on the lab's scene and on our own."""

from __future__ import annotations

import os
import subprocess
import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest

from tests.ros.challenge import (
    CAMERA_STEP,
    NEEDLE_STEP,
    Insertions,
    Psm,
    Stage,
    angle,
    distance,
    drive,
    measured,
    message,
    set_up_task_3,
    stitch_path,
    turned,
    within,
)
from tests.ros.conftest import BIN, ROOT, Listener, Program
from tests.waiting import steady

pytestmark = pytest.mark.ros
FLAGS = [
    "-p",
    "200",
    "-t",
    "1",
    "-g",
    "0",
    "--override_max_comm_freq",
    "100",
    "--override_min_comm_freq",
    "100",
    "--names",
    "src",
]
HOLES = [f"{hole}{n}" for hole in ("Entry", "Exit") for n in (1, 2, 3, 4)]


@pytest.fixture(scope="module", params=["ours", pytest.param("lab", marks=pytest.mark.corpus)])
def stage(request: Any, ros_env: dict[str, str], node: Any) -> Iterator[Stage]:
    """A simulator started as the challenge starts its own, and a connected client."""
    from ligature.client import Client

    launch, models = ROOT / "scenes" / "suturing" / "launch.yaml", "0,1,2,3,4,5"
    if request.param == "lab":
        launch, models = request.getfixturevalue("corpus") / "suturing_scene" / "launch.yaml", "10,11,6,7,8,9"
    program = Program([str(BIN / "ambf_simulator"), "--launch_file", str(launch), "-l", models, *FLAGS], ros_env)
    try:
        program.wait_for("first state published")
        client = Client("challenge")
        client.connect()
        yield Stage(client, client.get_world_handle())
        client.clean_up()
    finally:
        program.end()


@pytest.fixture(scope="module")
def psm1(stage: Stage) -> Psm:
    return Psm(stage, "psm1")


@pytest.fixture(scope="module")
def psm2(stage: Stage) -> Psm:
    return Psm(stage, "psm2")


@pytest.fixture
def needle(stage: Stage) -> Any:
    return stage.client.get_obj_handle("Needle")


@pytest.fixture(scope="module")
def holes(stage: Stage) -> dict[str, Any]:
    return {name: stage.client.get_obj_handle(name) for name in HOLES}


SECOND_GENERATION = """
import time
from ambf_client import Client
from ambf_rigid_body import RigidBody
from ambf_world import World
from transformations import euler_from_quaternion

client = Client()
client.connect()
time.sleep(0.2)
names = client.get_obj_names()
arm = client.get_obj_handle("psm1/baselink")
assert isinstance(arm, RigidBody) and isinstance(client.get_world_handle(), World)
time.sleep(0.5)
p, q = arm.get_pos(), arm.get_rot()
assert arm.get_rpy() == euler_from_quaternion([q.x, q.y, q.z, q.w])
count = arm.get_num_joints()
assert arm.get_num_of_children() >= count == len(arm.get_all_joint_pos())
arm.set_joint_pos(0, 0.1)
arm.set_joint_pos(arm.get_joint_names()[1], 0.1)
end = time.time() + 20
while max(abs(arm.get_joint_pos(0) - 0.1), abs(arm.get_joint_pos(1) - 0.1)) > 5e-3 and time.time() < end:
    time.sleep(0.1)
print("joints", count, "at", round(arm.get_joint_pos(0), 2), round(arm.get_joint_pos(1), 2))
arm.set_joint_effort(0, 0.0)
arm.set_force(0, 0, 0)
arm.set_torque(0, 0, 0)
client.clean_up()
print("left", client.get_obj_names())
"""


def test_a_script_of_the_second_generation_runs_with_the_systems_python(stage: Stage, ros_env: dict[str, str]) -> None:
    names = ROOT / "simulator" / "ligature" / "client" / "names"
    path = [ROOT / "build" / "python", ROOT / "simulator", names / "ambf", names / "tf"]
    done = subprocess.run(
        ["/usr/bin/python3", "-c", SECOND_GENERATION],
        env=dict(ros_env, PYTHONPATH=os.pathsep.join(map(str, path))),
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "joints 8 at 0.1 0.1\nleft []" in done.stdout
    assert "Traceback" not in done.stderr and "cannot send the command" not in done.stderr + done.stdout


def test_an_arm_is_found_with_its_tool_and_knows_its_joints_within_half_a_second(psm1: Psm, psm2: Psm) -> None:
    for psm in (psm1, psm2):
        assert psm.tool_id in (400006, 420006)
        assert len(psm.base.get_joint_names()) == 8 and psm.base.get_num_joints() == 8
        assert psm.base.get_joint_names()[2].endswith("maininsertionlink")
        assert psm.virtual_targets == [None, None, None]
        assert None not in psm.ghosts and psm.actuator is not None


def test_joints_and_jaw_follow_a_streamed_move(stage: Stage, psm1: Psm) -> None:
    goal = [0.2, -0.1, 0.12, 0.3, 0.2, -0.2]
    psm1.move_jp(goal, 0.5)
    stage.until(lambda: np.allclose(psm1.measured_jp(), goal, atol=1e-3), 2.0)
    psm1.set_jaw_angle(0.7)
    stage.until(
        lambda: abs(psm1.base.get_joint_pos(6) - 0.7) < 5e-3 and abs(psm1.base.get_joint_pos(7) - 0.7) < 5e-3, 2
    )
    assert max(abs(psm1.base.get_joint_vel(index)) for index in range(6)) < 0.05


def test_a_joint_velocity_moves_the_joint(stage: Stage, psm1: Psm) -> None:
    before, begin = psm1.base.get_joint_pos(3), stage.sim_time
    psm1.base.set_joint_vel(3, 0.3)
    stage.sleep(0.5)
    moved, passed = psm1.base.get_joint_pos(3) - before, stage.sim_time - begin
    assert moved == pytest.approx(0.3 * passed, abs=0.03)
    psm1.base.set_joint_pos(3, 0.3)


def test_the_third_tasks_set_up_puts_the_needle_into_the_jaws_and_the_arm_carries_it(
    stage: Stage, psm2: Psm, needle: Any
) -> None:
    set_up_task_3(stage, psm2, needle)
    assert psm2.grasped == "/ambf/env/phantom/BODY Needle"
    stage.sleep(0.5)
    assert psm2.actuator._state.actuated
    held = within(measured(needle), measured(psm2.yaw_link))
    psm2.move_jp([-0.3, -0.12, 0.125, -1.4, -0.3, 0.0], 1.0)
    stage.sleep(0.5)
    now = within(measured(needle), measured(psm2.yaw_link))
    assert distance(held, now) < 1e-3 and angle(held, now) < 0.1
    assert distance(measured(needle), measured(psm2.yaw_link)) < 0.02


def test_opened_jaws_let_the_needle_fall_and_a_reset_puts_it_back(stage: Stage, psm2: Psm, needle: Any) -> None:
    before = needle.get_pos().z
    psm2.set_jaw_angle(0.5)
    stage.until(lambda: not psm2.actuator._state.actuated, 1.0)
    stage.until(lambda: needle.get_pos().z < before - 0.05, 2.0)
    time_before = stage.sim_time
    stage.world.reset()
    stage.sleep(0.2)
    home = measured(needle)
    stage.world.reset_bodies()
    stage.sleep(0.2)
    assert distance(measured(needle), home) < 1e-3 and angle(measured(needle), home) < 0.1
    assert needle.get_pos().z == pytest.approx(0.715, abs=2e-3)
    assert stage.sim_time > time_before
    stage.until(lambda: np.allclose(psm2.measured_jp(), [-0.3, -0.12, 0.125, -1.4, -0.3, 0.0], atol=5e-3), 3.0)


def test_the_camera_body_is_driven_in_small_steps_and_the_cameras_ride_on_it(stage: Stage) -> None:
    frame, camera = stage.client.get_obj_handle("CameraFrame"), stage.client.get_obj_handle("cameraL")
    start, on_frame = measured(frame), measured(camera)
    goal = start @ turned(1, 0.05)
    goal[:3, 3] += [0.01, -0.005, 0.004]
    drive(stage, frame, lambda: goal, CAMERA_STEP, 1e-5)
    stage.until(lambda: angle(measured(frame), goal) < 1e-4, 1.0)
    assert distance(measured(camera), on_frame) < 1e-9
    frame.set_pose(message(start))
    stage.until(lambda: distance(measured(frame), start) < 1e-5, 1.0)


def test_the_evaluation_reads_needle_and_camera_from_their_literal_topics(
    stage: Stage, needle: Any, listen: Callable[..., Listener]
) -> None:
    from ambf_msgs.msg import RigidBodyState

    for name in ("Needle", "CameraFrame"):
        state = listen(f"/ambf/env/{name}/State", RigidBodyState).wait()
        assert state.identifier.data == f"/ambf/env/phantom/BODY {name}"
    before = stage.world._state.sim_time
    stage.sleep(0.1)
    assert 0.09 < stage.world._state.sim_time - before < 0.3
    assert abs(stage.client.get_time() - time.time()) < 1.0


@pytest.mark.parametrize(
    "stage", ["ours", pytest.param("lab", marks=(pytest.mark.corpus, pytest.mark.slow))], indirect=True
)
def test_a_needle_driven_through_entry_and_exit_is_two_insertions_in_order(
    stage: Stage, needle: Any, holes: dict[str, Any]
) -> None:
    stage.world.reset_bodies()
    stage.sleep(0.2)
    path = stitch_path(measured(holes["Entry1"]), measured(holes["Exit1"]))
    above = path[0].copy()
    above[2, 3] += 0.03
    for pose in (above, path[0]):
        drive(stage, needle, lambda pose=pose: pose, NEEDLE_STEP, 0.0005)
    insertions = Insertions(needle, holes)
    for pose in path:
        # slowly: a needle that lags behind cuts the corner
        for _ in range(6):
            needle.set_pose(message(pose))  # again and again: who falls silent lets it go
            stage.sleep(0.05)
            insertions.sample()
    assert insertions.events == ["Exit1", "Entry1"]
    needle.set_force(0.0, 0.0, 0.0)
    needle.set_torque(0.0, 0.0, 0.0)
    stage.world.reset_bodies()


def test_reports_and_joint_errors_travel_over_the_clients_node(stage: Stage) -> None:
    from geometry_msgs.msg import PoseStamped
    from ligature.client import ral
    from sensor_msgs.msg import ChannelFloat32

    node, evaluator = stage.client.get_ral(), ral("evaluation")
    report, errors = (
        "/surgical_robotics_challenge/completion_report/team/task1/",
        "/ambf/env/psm1/errors_model/set_errors",
    )
    received: list[Any] = []
    ends = [
        (node, node.publisher(topic, type_, queue_size=1))
        for topic, type_ in ((report, PoseStamped), (errors, ChannelFloat32))
    ]
    ends += [(evaluator, evaluator.subscriber(report, PoseStamped, received.append))]
    ends += [(evaluator, evaluator.subscriber(errors.strip("/"), ChannelFloat32, received.append))]
    stage.until(lambda: all(end.get_num_connections() for _, end in ends), 10.0)
    ends[0][1].publish(PoseStamped())
    ends[1][1].publish(ChannelFloat32(values=[0.1]))
    stage.until(lambda: len(received) == 2, 10.0)
    for owner, end in ends:
        owner.forget(end)


def test_fifty_clock_edges_a_second_are_fifty_updates(stage: Stage) -> None:
    world, rate = stage.world, stage.client.create_rate(50)
    for _ in range(8):
        world.enable_throttling(True)
        world.set_num_step_skips(1)
        last = time.monotonic()
        world.update()
        step, sim_time = int(steady(world.get_sim_step, 0.2)), stage.sim_time
        longest = 0.0
        for edge in range(1, 51):
            longest, last = max(longest, time.monotonic() - last), time.monotonic()
            world.update()
            rate.sleep()
            behind = 5 if edge < 50 else 0  # a busy machine takes its time; within the simulator's time-out
            deadline = time.monotonic() + 0.45
            while world.get_sim_step() < step + edge - behind and time.monotonic() < deadline:
                time.sleep(0.002)
        steps, passed = world.get_sim_step() - step, stage.sim_time - sim_time
        world.enable_throttling(False)
        world.update()
        if longest < 0.4:  # else this machine let the simulation wait for half a second, after which it runs free
            break
        stage.sleep(0.1)
    assert steps == 50
    assert passed == pytest.approx(50 * 0.005, abs=1e-4)


def test_a_point_cloud_script_finds_its_parameter_and_may_rewrite_it(stage: Stage, node: Any) -> None:
    from sensor_msgs.msg import PointCloud

    name = "/ambf/env/World/point_cloud_topics"
    topics = node.get_param(name)
    node.set_param(name, [*topics, "/ambf/env/World/another_cloud"])
    publisher = stage.client.get_ral().publisher("/ambf/env/World/another_cloud", PointCloud)
    publisher.publish(PointCloud())
    before = stage.sim_time
    stage.sleep(0.2)
    assert stage.sim_time > before
    node.set_param(name, topics)
    stage.client.get_ral().forget(publisher)
