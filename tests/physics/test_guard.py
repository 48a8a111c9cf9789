"""Bodies that move as no command asks for are reported once, with the likely cause; commanded ones are not."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.adf import Diagnostic
from ligature.cli.check import findings
from ligature.model.commands import CommandType
from ligature.physics.guard import STRONG_GRAVITY

BALL = "{name: ball, mass: 0.1, collision shape: SPHERE, collision geometry: {radius: 0.02}}"
ZERO, UP = "{x: 0, y: 0, z: 0}", "{x: 0, y: 0, z: 1}"


def scene(folder: Path, bodies: dict[str, str], joints: dict[str, str] | None = None) -> ligature.Simulation:
    """A simulation of ``bodies`` and ``joints`` without gravity, each given as an inline block."""
    joints = joints or {}
    lines = [f"bodies: [{', '.join(bodies)}]", f"joints: [{', '.join(joints)}]", f"gravity: {ZERO}"]
    lines += [f"{key}: {block}" for key, block in (bodies | joints).items()]
    file = folder / "model.yaml"
    file.write_text("\n".join(lines) + "\n")
    return ligature.Simulation(ligature.load(file))


def alarms(simulation: ligature.Simulation) -> list[Diagnostic]:
    return [problem for problem in simulation.problems if problem.code == "speed"]


def test_a_body_that_is_thrown_is_reported_once_with_its_name(tmp_path: Path) -> None:
    simulation = scene(tmp_path, {"BODY ball": BALL, "BODY other": BALL})
    simulation.bodies["BODY ball"].command_wrench([300.0, 0, 0, 0, 0, 0])
    simulation.step(20)
    assert not alarms(simulation), "pushed by command"
    simulation.bodies["BODY ball"].release()
    simulation.step(200)
    (alarm,) = alarms(simulation)
    assert "BODY ball' moves at" in alarm.message and alarm.mark is not None
    assert "BODY ball'" in alarm.message.split("likely cause: a command that pushed")[1]


@pytest.mark.parametrize("seed", range(3))
def test_the_thread_of_a_body_that_is_pushed_is_not_blamed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    simulation = ligature.Simulation(ligature.load("suturing_small"))
    needle = simulation.bodies["Needle"]
    needle.command_wrench([0, 0, 10.0 ** rng.uniform(4.0, 6.0), *rng.normal(size=3)])
    simulation.step(30)
    assert np.linalg.norm(needle.twist[:3]) > 50.0
    assert not alarms(simulation), "pushed by command"
    needle.release()
    simulation.step(10)
    simulation.step(10)
    (alarm,) = alarms(simulation)
    assert "a command that pushed '/ambf/env/phantom/BODY Needle'" in alarm.message
    simulation.close()


@pytest.mark.parametrize("ticks", [1, 3, 10, 25])
def test_a_push_of_any_length_is_named(ticks: int, tmp_path: Path) -> None:
    simulation = scene(tmp_path, {"BODY ball": BALL})
    simulation.bodies["BODY ball"].command_wrench([2e4 / ticks, 0, 0, 0, 0, 0])
    simulation.step(ticks)
    simulation.bodies["BODY ball"].release()
    simulation.step(20)
    (alarm,) = alarms(simulation)
    assert "a command that pushed" in alarm.message


def test_a_push_that_ended_in_rest_is_not_named(tmp_path: Path) -> None:
    simulation = scene(tmp_path, {"BODY ball": BALL})
    simulation.bodies["BODY ball"].command_wrench([0.1, 0, 0, 0, 0, 0])
    simulation.step(20)
    simulation.bodies["BODY ball"].release()
    simulation.step(20)
    simulation._world.engine.place_of[0].set_twist(np.array([70.0, 0.0, 0.0]), np.zeros(3))
    simulation.step(20)
    (alarm,) = alarms(simulation)
    assert "a command" not in alarm.message.split("likely cause")[1]


def test_energy_from_nowhere_is_reported_below_fifty_metres_a_second(tmp_path: Path) -> None:
    simulation = scene(tmp_path, {"BODY ball": BALL})
    simulation.step(20)
    place = simulation._world.engine.place_of[0]
    place.set_twist(np.array([15.0, 0.0, 0.0]), np.zeros(3))
    simulation.step(10)
    (alarm,) = alarms(simulation)
    assert "moves at 15 m/s, without a command for it" in alarm.message


def test_a_body_that_is_hit_is_not_reported(tmp_path: Path) -> None:
    heavy = "{name: heavy, mass: 10, collision shape: SPHERE, collision geometry: {radius: 0.1}, restitution: 1}"
    light = BALL.replace("}}", "}, restitution: 1, location: {position: {x: 0.5, y: 0, z: 0}}}")
    simulation = scene(tmp_path, {"BODY heavy": heavy, "BODY light": light})
    simulation.bodies["BODY heavy"].command_twist([9.0, 0, 0, 0, 0, 0])
    simulation.step(20)
    simulation.bodies["BODY heavy"].release()
    simulation.step(100)
    assert simulation.bodies["BODY light"].twist[0] > 10.0
    assert alarms(simulation) == []


@pytest.mark.parametrize("drive", ["command_twist", "command_pose", "joint"])
def test_what_is_commanded_moves_as_fast_as_it_likes(drive: str, tmp_path: Path) -> None:
    hinge = (
        f"{{name: hinge, type: revolute, parent: BODY base, child: BODY ball, parent pivot: {ZERO}, "
        f"child pivot: {{x: 2, y: 0, z: 0}}, parent axis: {UP}, child axis: {UP}, max motor impulse: 1000}}"
    )
    joined = drive == "joint"
    bodies = {"BODY base": "{name: base, mass: 0}", "BODY ball": BALL}
    simulation = scene(tmp_path, bodies, {"hinge": hinge} if joined else {})
    ball = simulation.bodies["BODY ball"]
    if joined:
        simulation.bodies["BODY base"].command_joints([40.0], CommandType.VELOCITY)
    elif drive == "command_twist":
        ball.command_twist([80.0, 0, 0, 0, 0, 0])
    else:
        ball.command_pose([10.0, 0, 0, 0, 0, 0, 1])
    top_speed = 0.0
    for _ in range(10):
        simulation.step(10)
        top_speed = max(top_speed, float(np.linalg.norm(ball.twist[:3])))
    assert top_speed > 10.0
    assert alarms(simulation) == []


def _gravity(folder: Path) -> tuple[ligature.Simulation, str]:
    body = BALL.replace("}}", "}, gravity: {x: 0, y: 0, z: -900}}")
    return scene(folder, {"BODY ball": body}), "gravity of 900 m/s²"


def _fall(folder: Path) -> tuple[ligature.Simulation, str]:
    body = BALL.replace("}}", "}, gravity: {x: 3, y: 0, z: -9}, damping: {linear: 0}}")
    simulation = scene(folder, {"BODY ball": body})
    simulation.step(5500)
    return simulation, "it falls, and nothing is below it"


def _masses(folder: Path) -> tuple[ligature.Simulation, str]:
    joint = (
        f"{{name: hinge, type: fixed, parent: BODY a, child: BODY b, parent pivot: {ZERO}, child pivot: {ZERO}, "
        f"parent axis: {UP}, child axis: {UP}}}"
    )
    bodies = {"BODY a": "{name: a, mass: 1000}", "BODY b": "{name: b, mass: 0.001}"}
    simulation = scene(folder, bodies, {"hinge": joint})
    simulation._world.engine.place_of[0].set_twist(np.array([70.0, 0.0, 0.0]), np.zeros(3))
    return simulation, "joined bodies of 0.001 kg and 1000 kg"


def _overlap(folder: Path) -> tuple[ligature.Simulation, str]:
    box = "{name: %s, mass: 1, collision shape: BOX, collision geometry: {x: 1, y: 1, z: 1}}"
    simulation = scene(folder, {"BODY a": box % "a", "BODY b": box % "b"})
    simulation._world.engine.place_of[0].set_twist(np.array([60.0, 0.0, 0.0]), np.zeros(3))
    return simulation, "it overlaps"


@pytest.mark.parametrize("make", [_gravity, _fall, _masses, _overlap], ids=lambda make: make.__name__[1:])
def test_the_likely_cause_is_named(make: Callable[[Path], tuple[ligature.Simulation, str]], tmp_path: Path) -> None:
    simulation, cause = make(tmp_path)
    simulation.step(10)
    simulation.step(90)
    (alarm,) = alarms(simulation)
    assert cause in alarm.message


@pytest.mark.parametrize("seed", range(6))
def test_check_reports_each_gravity_that_no_room_has_once(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    gravities = [rng.normal(size=3) * 10.0 ** rng.uniform(-1, 2.3) for _ in range(4)]
    gravities.append(gravities[0])
    lines = [f"bodies: [{', '.join(f'B{i}' for i in range(len(gravities)))}]"]
    for i, g in enumerate(gravities):
        vector = f"{{x: {g[0]}, y: {g[1]}, z: {g[2]}}}"
        lines.append(f"B{i}: {{name: b{i}, mass: {i % 4}, gravity: {vector}}}")
    (tmp_path / "m.yaml").write_text("\n".join(lines))
    found = [d.message for d in findings(tmp_path / "m.yaml", [], strict=False) if d.code == "speed"]
    moving = [float(np.linalg.norm(g)) for i, g in enumerate(gravities) if i % 4]
    strong = [g for g in moving if g > STRONG_GRAVITY]
    assert [message.split()[2] for message in found] == [f"{g:g}" for g in strong]


@pytest.mark.parametrize("seed", range(8))
def test_check_reports_resistance_sensors_that_throw_their_body(seed: int, tmp_path: Path) -> None:
    """A body is let go with its rays in a wall almost as far as they reach; without gravity nothing else moves it."""
    rng = np.random.default_rng(seed)
    reach, mass = float(rng.uniform(0.05, 0.5)), 10.0 ** float(rng.uniform(-3, 0))
    count, speed = int(rng.integers(1, 4)), float(rng.uniform(5.0, 45.0) if seed % 2 else rng.uniform(55.0, 90.0))
    force = mass * speed**2 / (count * reach)
    down = "direction: {x: 0, y: 0, z: -1}"
    rays = ", ".join(f"{{offset: {{x: {0.01 * i}, y: 0, z: 0}}, {down}}}" for i in range(count))
    (tmp_path / "m.yaml").write_text(
        f"gravity: {ZERO}\nbodies: [WALL, B]\nsensors: [S]\n"
        "WALL: {name: w, mass: 0, collision shape: BOX, collision geometry: {x: 9, y: 9, z: 0.2}, "
        f"location: {{position: {{x: 0, y: 0, z: {-0.1 - 0.01 * reach}}}}}}}\n"
        f"B: {{name: b, mass: {mass}, inertia: {{ix: 10, iy: 10, iz: 10}}, damping: {{linear: 0}}, location: {{}}}}\n"
        f"S: {{name: s, parent: B, type: Resistance, range: {reach}, contact stiffness: {force}, array: [{rays}]}}\n"
    )
    found = [d.message for d in findings(tmp_path / "m.yaml", [], strict=False) if d.code == "speed"]
    assert len(found) == 1 - seed % 2, found
    assert all(f"at {speed:.3g} m/s" in message for message in found)
    simulation = ligature.Simulation(ligature.load(tmp_path / "m.yaml"))
    simulation.step(200)
    assert simulation.state["body_twist"][0, 1, 2] == pytest.approx(speed, rel=0.1)


def test_the_guard_changes_no_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hashes = []
    for watched in (True, False):
        simulation = _overlap(tmp_path)[0]
        if not watched:
            monkeypatch.setattr(simulation, "_watch", lambda: None)
        simulation.step(10)
        simulation.step(90)
        assert bool(alarms(simulation)) == watched
        hashes.append(simulation.state_hash())
    assert hashes[0] == hashes[1]
