"""Our client on the running simulator: finding objects, handles, commands, what happens when the simulator goes."""

from __future__ import annotations

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from tests.ros.conftest import BIN, ROOT, SMALL, Listener, Program, free_port
from tests.waiting import steady, until

pytestmark = pytest.mark.ros
NEEDLE = "/ambf/env/phantom/Needle"
BASE = "/ambf/env/psm1/baselink"
NAMES = ROOT / "simulator" / "ligature" / "client" / "names" / "ambf"
SCRIPT_PATH = os.pathsep.join(map(str, [ROOT / "build" / "python", ROOT / "simulator", NAMES]))
CLIENTS = ROOT / "docs" / "clients.md"
JOINTS = [0.1, -0.1, 0.1, 0.2, 0.1, -0.1, 0.3, 0.3]


@pytest.fixture(scope="module")
def simulator(start: Callable[..., Program]) -> Program:
    program = start(BIN / "ligature", "run", SMALL, "-p", "500", "--min-hz", "100", "--max-hz", "200")
    program.wait_for("first state published")
    return program


@pytest.fixture(scope="module")
def client(simulator: Program, node: Any) -> Iterator[Any]:
    from ligature.client import Client

    client = Client("client_tests")
    client.connect()
    yield client
    client.clean_up()


def wait_for(condition: Callable[[], Any], seconds: float = 5.0) -> Any:
    return until(condition, seconds=seconds)


def test_all_objects_are_found_under_their_topics(client: Any) -> None:
    names = client.get_obj_names()
    assert {NEEDLE, BASE, "/ambf/env/World", "/ambf/env/cameras/cameraL", "/ambf/env/ghosts/psm1/Actuator0"} <= set(
        names
    )
    assert client.get_common_namespace() == "/ambf/env/"


@pytest.mark.parametrize(
    ("part", "found"),
    [
        (NEEDLE, NEEDLE),
        ("phantom/Needle", NEEDLE),
        ("psm1/baselink", BASE),
        ("psm2/Actuator0", "/ambf/env/ghosts/psm2/Actuator0"),
    ],
)
def test_a_name_or_a_unique_part_of_it_gives_the_handle(client: Any, part: str, found: str) -> None:
    assert client.get_obj_handle(part).get_name() == found


def test_names_that_match_nothing_or_several_give_none_with_what_there_is(client: Any, caplog: Any) -> None:
    caplog.set_level("WARNING", logger="rosout")
    begin = time.monotonic()
    assert client.get_obj_handle("psm9/baselink") is None
    assert client.get_obj_handle("baselink") is None
    assert client.get_obj_pose("psm9/baselink") is None
    assert time.monotonic() - begin < 1.0, "each waited for an object that might appear"
    nothing, several, _ = (record.getMessage() for record in caplog.records)
    assert nothing.startswith("no object's name contains 'psm9/baselink' (get_obj_names() lists all ")
    assert "/ambf/env/psm1/baselink" in nothing and "/ambf/env/psm2/baselink" in nothing, "the closest are named"
    assert several.startswith("'baselink' is a part of 2 names, give more of one")
    assert "/ambf/env/psm1/baselink" in several and "/ambf/env/psm2/baselink" in several
    for text in (nothing, several):
        assert len(text.splitlines()) <= 3 and max(map(len, text.splitlines())) <= 160


def test_a_handle_knows_its_state_when_it_is_given_out(client: Any) -> None:
    from ligature.client import Client

    fresh = Client("fresh")
    fresh.connect()
    arm = fresh.get_obj_handle("psm2/baselink")
    arm.set_joint_pos(7, 0.2)
    assert arm.get_joint_pos(7) is not None and len(arm._cmd.joint_cmds) == 8
    needle = fresh.get_obj_handle("phantom/Needle")
    assert needle.get_pos().z == pytest.approx(0.7154, abs=2e-3)
    assert needle.get_identifier() == "/ambf/env/phantom/BODY Needle"
    assert needle.get_sim_step() > 0 and needle.get_inertia().x > 0
    assert abs(needle.get_msg_time_stamp().to_sec() - fresh.get_time()) < 2.0
    fresh.clean_up()


def test_joints_appear_within_half_a_second_and_follow(client: Any) -> None:
    arm = client.get_obj_handle("psm1/baselink")
    assert arm.get_num_joints() == 8
    assert arm.get_joint_names()[2] == "pitchendlink-maininsertionlink"
    assert arm.get_num_of_children() == len(arm.get_children_names()) > 0
    for index, value in enumerate(JOINTS):
        arm.set_joint_pos(index, value)
    wait_for(lambda: arm.get_all_joint_pos() == pytest.approx(JOINTS, abs=2e-3))
    arm.set_joint_vel("baselink-yawlink", 0.2)
    wait_for(lambda: arm.get_joint_pos(0) > 0.15)
    assert arm.get_joint_vel(0) == pytest.approx(0.2, abs=0.02)
    arm.set_joint_pos(0, 0.1)
    wait_for(lambda: arm.get_joint_pos(0) == pytest.approx(0.1, abs=2e-3))


def test_targets_hold_for_ever_without_being_set_again(client: Any) -> None:
    arm = client.get_obj_handle("psm1/baselink")
    for index, value in enumerate(JOINTS):
        arm.set_joint_pos(index, value)
    time.sleep(2.0)  # four times the simulator's time-out
    assert arm.get_all_joint_pos() == pytest.approx(JOINTS, abs=2e-3)


def test_commands_go_out_at_the_rate_given_to_connect_for_active_objects_only(
    client: Any, listen: Callable[..., Listener]
) -> None:
    from ambf_msgs.msg import CameraCmd, RigidBodyCmd
    from ligature.client import Client

    slow = Client("slow")
    slow.connect(default_publish_rate=50)
    slow.get_obj_handle("psm2/baselink")
    active = listen("/ambf/env/psm2/baselink/Command", RigidBodyCmd)
    idle = listen("/ambf/env/cameras/cameraL/Command", CameraCmd)
    active.wait()
    assert active.comes_at(47, 53, 2.0)
    assert idle.messages == []
    slow.clean_up()
    assert active.comes_at(0, 0, 0.5)


def test_a_body_is_moved_driven_and_pushed(client: Any) -> None:
    world = client.get_world_handle()
    needle = client.get_obj_handle("phantom/Needle")
    p = needle.get_pos()
    above = (p.x, p.y, p.z + 0.05)
    needle.set_pos(*above)
    wait_for(lambda: abs(needle.get_pos().z - above[2]) < 2e-3)
    needle.velocity_command(0.0, 0.0, 0.02, 0.0, 0.0, 0.0)
    wait_for(lambda: needle.get_pos().z > above[2] + 0.01)
    assert needle.get_linear_vel().z == pytest.approx(0.02, abs=1e-3)
    needle.set_force(0.0, 0.0, 0.0)
    needle.set_torque(0.0, 0.0, 0.0)
    wait_for(lambda: needle.get_pos().z < above[2])  # free: it falls
    world.reset_bodies()


def test_a_turn_keeps_the_place_and_a_move_keeps_the_turn(client: Any) -> None:
    frame = client.get_obj_handle("CameraFrame")
    p, rpy = frame.get_pos(), frame.get_rpy()
    frame.set_rpy(rpy[0] + 0.1, rpy[1], rpy[2])
    wait_for(lambda: frame.get_rpy() == pytest.approx((rpy[0] + 0.1, rpy[1], rpy[2]), abs=1e-4))
    frame.set_pos(p.x, p.y, p.z + 0.01)
    wait_for(lambda: frame.get_pose() == pytest.approx([p.x, p.y, p.z + 0.01, rpy[0] + 0.1, *rpy[1:]], abs=1e-4))
    frame.set_pos(p.x, p.y, p.z)
    frame.set_rpy(*rpy)


def test_reset_bodies_puts_bodies_back_and_reset_cameras_too(client: Any) -> None:
    world = client.get_world_handle()
    needle, camera = client.get_obj_handle("phantom/Needle"), client.get_obj_handle("cameraL")
    needle.set_force(0.0, 0.0, 0.0)
    time_before = world._state.sim_time
    home = camera.get_pos().x
    camera.set_pos(home + 0.1, 0.0, 0.0)
    wait_for(lambda: abs(camera.get_pos().x - home - 0.1) < 1e-6)
    world.reset_bodies()
    wait_for(lambda: abs(needle.get_pos().x - 0.005) < 1e-3 and needle.get_pos().z < 0.7165)
    assert camera.get_pos().x == pytest.approx(home + 0.1)
    camera._cmd.enable_position_controller = False

    def back() -> bool:  # a command that was on its way moves the camera once more
        world.reset()
        return abs(camera.get_pos().x - home) < 1e-6

    until(back, "the camera is home", 5.0, every=0.1)
    assert world._state.sim_time > time_before


def test_every_update_of_a_throttled_world_advances_the_given_steps(client: Any) -> None:
    world = client.get_world_handle()
    world.enable_throttling(True)
    world.set_num_step_skips(5)
    world.update()
    steps = [int(steady(world.get_sim_step, 0.1))]
    for _ in range(5):
        world.update()
        wait_for(lambda: world.get_sim_step() == steps[-1] + 5)
        steps.append(int(steady(world.get_sim_step, 0.05)))
    assert {b - a for a, b in zip(steps[:-1], steps[1:], strict=True)} == {5}
    wait_for(lambda: world.get_sim_step() > steps[-1] + 50)  # nobody updates: it runs freely again
    world.enable_throttling(False)


def test_an_active_world_is_kept_throttled_for_two_seconds_after_the_last_update(client: Any) -> None:
    from ligature.client import Client

    own = Client("throttling")
    own.connect()
    world = own.get_obj_handle("World")
    assert world.get_name() == "/ambf/env/World" and world.is_active()
    world.set_num_step_skips(1)
    world.enable_throttling(True)
    world.update()
    held = int(steady(world.get_sim_step, 1.2))
    wait_for(lambda: world.get_sim_step() > held + 50, 4.0)
    own.clean_up()


@pytest.mark.parametrize("name", ["/ambf/env/phantom/BODY Needle", "BODY Needle", "Needle"])
def test_an_actuator_grasps_what_the_ghosts_name_and_lets_go(client: Any, name: str) -> None:
    actuator = client.get_obj_handle("psm2/Actuator0")
    ghost = client.get_obj_handle("psm2/left_finger_ghost")
    assert ghost.get_all_sensed_obj_names() == [] or "/ambf/env/" in ghost.get_sensed_obj_name(0)
    actuator.actuate(name)
    wait_for(lambda: actuator._state.actuated)
    time.sleep(0.7)  # longer than the simulator's time-out
    assert actuator._state.actuated
    actuator.deactuate()
    wait_for(lambda: not actuator._state.actuated)


def test_several_ral_of_one_process_share_its_node(client: Any) -> None:
    from ligature.client import ral
    from std_msgs.msg import String

    one, two = ral("one"), ral("two", "/talk/")
    assert (one.namespace(), two.namespace(), two.node_name()) == ("", "talk", "two")
    child = two.create_child("/left")
    heard: list[str] = []
    child.subscriber("/word/", String, lambda message: heard.append(message.data))
    with pytest.raises(TimeoutError, match="subscriber of /talk/left/word"):
        two.check_connections(0.2)
    publisher = one.publisher("talk/left/word", String, latch=True)
    assert one.get_topic_name(publisher) == "/talk/left/word"
    publisher.publish("there")
    two.check_connections(5.0)
    one.check_connections(5.0)
    wait_for(lambda: heard == ["there"])
    with pytest.raises(RuntimeError, match="has a child 'left' already"):
        two.create_child("left")
    one.subscriber("talk/nobody", String, lambda _: None)
    one.check_connections(0.0)
    begin = time.monotonic()
    one.sleep(0.05)
    one.sleep(one.create_duration(0.05))
    assert 0.1 <= time.monotonic() - begin < 1.0


def test_a_ral_reports_time_stamps_messages_and_runs_functions(client: Any) -> None:
    from geometry_msgs.msg import PoseStamped
    from ligature.client import ral

    node = ral("any")
    message = PoseStamped()
    node.set_timestamp(message)
    assert abs(node.to_sec(message) - time.time()) < 1.0
    assert node.get_timestamp(message) == node.get_timestamp(message.header) == message.header.stamp
    assert node.to_sec(node.create_duration(1.5)) == 1.5 and node.to_sec(node.create_time()) == 0.0
    assert node.to_sec(node.now_msg()) >= node.to_sec(message.header)
    assert node.spin_and_execute(lambda a, b: a + b, 1, 2) == 3
    assert node.ros_version() == 1 and node.spin() is None and not node.is_shutdown()
    assert ral.parse_argv(["script", "-a", "PSM1", "__ns:=/foo"]) == ["script", "-a", "PSM1"]
    with pytest.raises(RuntimeError, match="ends with its process"):
        node.shutdown()
    rate = node.create_rate("100")
    begin = time.monotonic()
    for _ in range(20):
        rate.sleep()
    assert 0.15 < time.monotonic() - begin < 1.0


@pytest.mark.parametrize("example", re.findall(r"```python\n(.*?)```", CLIENTS.read_text(), re.DOTALL))
def test_the_examples_of_the_documentation_run(example: str, client: Any, ros_env: dict[str, str]) -> None:
    done = subprocess.run(
        ["/usr/bin/python3", "-c", example], env=dict(ros_env, PYTHONPATH=SCRIPT_PATH), capture_output=True, text=True,
        timeout=30,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "no object" not in done.stdout + done.stderr and "nobody listens" not in done.stdout + done.stderr


def test_handles_live_on_when_the_simulator_dies_and_comes_back(
    client: Any, simulator: Program, start: Callable[..., Program], caplog: Any
) -> None:
    caplog.set_level("WARNING", logger="rosout")
    arm, world = client.get_obj_handle("psm1/baselink"), client.get_world_handle()
    os.kill(simulator.process.pid, signal.SIGINT)
    simulator.process.wait(10)
    begin = time.monotonic()
    world.reset()
    arm.set_joint_pos(0, 0.2)
    assert time.monotonic() - begin < 2.0
    assert "no subscriber of /ambf/env/World/Command/Reset: is the simulator running?" in caplog.text
    last = arm.get_sim_step()
    again = start(BIN / "ligature", "run", SMALL, "-p", "500")
    again.wait_for("first state published")
    wait_for(lambda: arm.get_sim_step() != last, 10)
    wait_for(lambda: arm.get_joint_pos(0) == pytest.approx(0.2, abs=2e-3), 10)
    client.refresh()
    assert client.get_obj_handle("psm1/baselink") is arm
    again.end()
    client._attempts = 1
    client.refresh()
    assert client.get_obj_names() == [] and client.get_world_handle() is None


FOLLOWER = """
import time
from ambf_client import Client
client = Client("follower")
client.connect()
needle = client.get_obj_handle("phantom/Needle")
last = 0
while True:
    if needle.get_sim_step() != last:
        last = needle.get_sim_step()
        print("step", last, flush=True)
    time.sleep(0.1)
"""


def test_a_script_goes_on_when_simulator_and_master_were_started_again(
    ros_env: dict[str, str], start: Callable[..., Program]
) -> None:
    own = dict(ros_env, ROS_MASTER_URI=f"http://127.0.0.1:{free_port()}", PYTHONPATH=SCRIPT_PATH)

    def run() -> Program:
        program = start(BIN / "ligature", "run", SMALL, "-p", "200", env=own)
        program.wait_for("first state published")
        return program

    first = run()
    follower = start("/usr/bin/python3", "-c", FOLLOWER, env=own)
    follower.wait_for("step", 20)
    assert first.end() == 0
    seen = int(steady(lambda: len(follower.lines), 0.3))
    second = run()
    wait_for(lambda: len([line for line in follower.lines[seen:] if "step" in line]) > 5, 20)
    follower.process.kill()
    follower.process.wait()
    assert second.end() == 0


SCRIPT = """
import sys
from ambf_client import Client
from ligature.client import layer
layer.MASTER_TIMEOUT = 0.5
client = Client("alone", 1)
try:
    client.connect()
except ConnectionError as error:
    sys.exit(f"{type(error).__name__}: {error}")
print("objects:", client.get_obj_names(), "handle:", client.get_obj_handle("Needle"), "world:", client.get_world_handle())
"""


def alone(env: dict[str, str]) -> subprocess.CompletedProcess[str]:
    """A script with the system's own Python, none of whose packages is ours."""
    return subprocess.run(
        ["/usr/bin/python3", "-c", SCRIPT],
        env=dict(env, PYTHONPATH=SCRIPT_PATH),
        capture_output=True,
        text=True,
        timeout=60,
    )


def test_a_script_without_a_master_ends_with_what_to_do(ros_env: dict[str, str]) -> None:
    uri = f"http://127.0.0.1:{free_port()}"
    done = alone(dict(ros_env, ROS_MASTER_URI=uri))
    assert (
        done.returncode == 1 and f"ConnectionError: no ROS master answers at {uri}: start the simulator" in done.stderr
    )


def test_a_script_without_a_simulator_goes_on_with_no_objects(ros_env: dict[str, str]) -> None:
    done = alone(ros_env)
    assert "objects: [] handle: None world: None" in done.stdout
    assert "no AMBF objects on the ROS master after 1 attempts: is the simulator running?" in done.stderr + done.stdout
