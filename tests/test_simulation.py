"""The Python API: stepping, commands, determinism over processes, snapshots, resets, and what bad input does."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature import Simulation
from ligature.model.commands import ActuatorCommand, BodyCommand, CommandType, ParentCommand, Release, Reset
from ligature.model.frames import matrix_pose7, pose7_matrix

SMALL = Path(__file__).resolve().parents[1] / "scenes" / "suturing_small" / "launch.yaml"
GOAL = [0.1, -0.1, 0.12, 0.3, 0.2, -0.2, 0.4, 0.4]

SCRIPT = """
import sys, ligature
sim = ligature.Simulation(ligature.load(sys.argv[1], eval_models(sys.argv[2])))
base = sim.bodies[sys.argv[3]]
needle = sim.bodies["BODY Needle"]
for second in range(5):
    base.command_joints([0.1 * second, 0.05, 0.1, 0.2, 0.1 * second, 0.1, 0.3, 0.3])
    if second == 2:
        needle.command_pose([*(needle.pose[:3] + [0, 0, 0.02]), *needle.pose[3:]])
    if second == 3:
        needle.release()
    sim.step(1000)
print(sim.state_hash())
""".replace("eval_models(sys.argv[2])", "[int(i) for i in sys.argv[2].split(',')] if sys.argv[2] else None")


@pytest.fixture
def sim() -> Simulation:
    return Simulation(ligature.load(SMALL))


def hash_in_a_fresh_process(launch: Path, models: str, base: str) -> str:
    done = subprocess.run(
        [sys.executable, "-c", SCRIPT, str(launch), models, base], capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


def test_two_fresh_processes_end_with_the_same_bits() -> None:
    first, second = (hash_in_a_fresh_process(SMALL, "", "psm1/baselink") for _ in range(2))
    assert len(first) == 64 and first == second


def test_the_corpus_scene_repeats_bit_for_bit(corpus: Path) -> None:
    launch = corpus / "suturing_scene" / "launch.yaml"
    hashes = {hash_in_a_fresh_process(launch, "10,11,6,7,8,9", "psm1/BODY base link simple") for _ in range(2)}
    assert len(hashes) == 1


def test_bodies_are_found_by_topic_identifier_or_part(sim: Simulation) -> None:
    assert sim.bodies["/ambf/env/phantom/Needle"].body is sim.bodies["BODY Needle"].body
    with pytest.raises(KeyError, match="'Thread_' does not name exactly one body"):
        sim.bodies["Thread_"]


def test_joints_go_where_they_are_reported(sim: Simulation) -> None:
    base = sim.bodies["psm1/baselink"]
    base.command_joints(GOAL)
    sim.step(2500)
    assert sim.state["joint_position"][0, list(base.body.joints)] == pytest.approx(GOAL, abs=1e-3)


def test_a_released_arm_without_gravity_stays(sim: Simulation) -> None:
    base = sim.bodies["psm1/baselink"]
    base.command_joints(GOAL)
    sim.step(2500)
    base.release()
    sim.step(1000)
    assert sim.state["joint_position"][0, list(base.body.joints)] == pytest.approx(GOAL, abs=5e-3)


def test_the_needle_follows_a_pose_and_falls_when_released(sim: Simulation) -> None:
    needle = sim.bodies["BODY Needle"]
    start = needle.pose
    needle.command_pose([*(start[:3] + [0, 0, 0.03]), *start[3:]])
    sim.step(2000)
    assert needle.pose[2] == pytest.approx(start[2] + 0.03, abs=2e-3)
    needle.release()
    sim.step(1000)
    assert needle.pose[2] == pytest.approx(start[2], abs=2e-3)


def test_a_static_body_moves_by_command_at_once(sim: Simulation) -> None:
    frame = sim.bodies["CameraFrame"]
    goal = [0.0, 0.3, 0.9, 0.0, 0.0, 0.0, 1.0]
    frame.command_pose(goal)
    sim.step(2)
    assert frame.pose == pytest.approx(goal)
    camera = sim.scene.cameras[0]
    expected = np.array(goal[:3]) + camera.attachment.T_parent_object[:3, 3]
    assert sim.state["camera_world"][0, 0, :3] == pytest.approx(expected)


def test_a_snapshot_continues_with_the_same_bits(sim: Simulation) -> None:
    base = sim.bodies["psm1/baselink"]
    base.command_joints(GOAL)
    sim.step(700)
    snapshot = sim.snapshot()
    sim.step(500)
    expected = sim.state_hash()
    sim.step(300)
    sim.restore(snapshot)
    sim.step(500)
    assert sim.state_hash() == expected
    other = Simulation(ligature.load(SMALL))
    other.restore(snapshot)
    other.step(500)
    assert other.state_hash() == expected


def test_a_camera_that_gets_another_parent_rides_on_it_and_snapshots_know(sim: Simulation) -> None:
    camera, needle = sim.cameras["cameraL"], sim.bodies["Needle"]
    before, local = sim.snapshot(), sim.state["camera_pose"][0, 0].copy()
    sim.apply(ParentCommand("camera", 0, needle.body.index))
    sim.step(50)
    assert (sim.state["camera_pose"][0, 0] == local).all()
    expected = matrix_pose7(pose7_matrix(needle.pose) @ pose7_matrix(local))
    assert np.allclose(camera.pose[:3], expected[:3]) and abs(camera.pose[3:] @ expected[3:]) == pytest.approx(1)
    sim.restore(before)
    sim.step(50)
    assert np.linalg.norm(camera.pose[:3] - needle.pose[:3]) > 0.01


def test_a_reset_puts_everything_back_and_time_goes_on(sim: Simulation) -> None:
    before = sim.state["body_pose"][0].copy()
    base = sim.bodies["psm1/baselink"]
    base.command_joints(GOAL)
    sim.step(500)
    base.release()
    sim.apply(Reset())
    assert sim.time == pytest.approx(0.5)
    assert np.allclose(sim.state["body_pose"][0], before, atol=1e-6)
    assert sim.state["resets"][0] == 1


def test_an_actuator_holds_the_needle_and_lets_it_go(sim: Simulation) -> None:
    needle, tool, base = sim.bodies["BODY Needle"], sim.bodies["psm1/toolyawlink"], sim.bodies["psm1/baselink"]

    def in_tool() -> np.ndarray:
        return (np.linalg.inv(pose7_matrix(tool.pose)) @ pose7_matrix(needle.pose))[:3, 3]

    held_at = in_tool()
    sim.apply(ActuatorCommand(0, True, "BODY Needle"))
    base.command_joints([0.0, -0.1, 0.0, 0, 0, 0, 0.3, 0.3])
    sim.step(1500)
    assert sim.state["actuator_active"][0, 0]
    assert needle.pose[2] > 0.72
    assert np.linalg.norm(in_tool() - held_at) < 4e-3  # 0.22 m away from the tool
    sim.apply(Release("actuator", 0))
    sim.step(1000)
    assert not sim.state["actuator_active"][0, 0]
    assert needle.pose[2] < 0.72


def test_an_actuator_that_cannot_find_its_body_reports_it(sim: Simulation) -> None:
    sim.apply(ActuatorCommand(0, True, "BODY Nothing"))
    assert "'BODY Nothing' does not name exactly one body" in str(sim.problems[-1])
    assert not sim.state["actuator_active"][0, 0]


def test_an_actuator_can_hold_the_thread(sim: Simulation) -> None:
    sim.apply(ActuatorCommand(0, True, "BODY Thread_020"))
    sim.step(50)
    assert sim.problems == []
    assert sim.state["actuator_body"][0, 0] == sim.bodies["BODY Thread_020"].body.index


@pytest.mark.parametrize(
    ("command", "text"),
    [
        (BodyCommand(0, CommandType.POSITION, (float("nan"),) * 7), "must be finite"),
        (BodyCommand(0, CommandType.POSITION, (0.0,) * 6), "must have 7 numbers, not 6"),
        (BodyCommand(0, CommandType.POSITION, (0.0,) * 7), "the quaternion has the length 0"),
        (BodyCommand(0, CommandType.FORCE, (1e30,) + (0.0,) * 5), "must stay within"),
    ],
)
def test_bad_commands_are_refused_and_change_nothing(sim: Simulation, command: BodyCommand, text: str) -> None:
    before = sim.state_hash()
    with pytest.raises(ValueError, match=text):
        sim.apply(command)
    assert sim.state_hash() == before


def test_ghosts_sense_what_enters_them(sim: Simulation) -> None:
    ghost = next(g for g in sim.scene.ghosts if g.identity.name == "left_finger_ghost")
    block = sim.bodies["BODY Block"]
    assert not sim.state["ghost_sensed"][0, ghost.index, block.body.index]
    tip = sim.state["ghost_world"][0, ghost.index]
    block.set_pose([*(tip[:3] - [0, 0, 0.0145]), 0, 0, 0, 1])
    sim.step(1)
    assert sim.state["ghost_sensed"][0, ghost.index, block.body.index]
    block.set_pose([1, 1, 1, 0, 0, 0, 1])
    sim.step(1)
    assert not sim.state["ghost_sensed"][0, ghost.index, block.body.index]


def test_ghosts_sense_the_thread_too(tmp_path: Path) -> None:
    scene = shutil.copytree(SMALL.parent, tmp_path / "scene")
    text = (scene / "phantom.yaml").read_text()
    ghost = (
        "ghost objects: [GHOST g]\nGHOST g: {name: g, parent: BODY Block, location: {position: {x: -0.035, y: 0.0, z: 0.0152}}, "
        "collision shape: BOX, collision geometry: {x: 0.05, y: 0.01, z: 0.002}}\n"
    )
    (scene / "phantom.yaml").write_text(text + ghost)
    simulation = Simulation(ligature.load(scene / "phantom.yaml"))
    simulation.step(5)
    sensed = simulation.state["ghost_sensed"][0, 0]
    inside = {simulation.scene.bodies[b].identity.name for b in np.flatnonzero(sensed)}
    middles = simulation.state["body_pose"][0, list(simulation.scene.rods[0].bodies), 1]
    expected = {
        simulation.scene.bodies[b].identity.name
        for b, y in zip(simulation.scene.rods[0].bodies, middles, strict=True)
        if abs(y - 0.18) < 0.005
    }
    assert expected and expected <= inside
    assert "Thread" not in inside and "Thread_039" not in inside
