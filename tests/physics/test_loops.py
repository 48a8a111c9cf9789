"""Loops of any joint: they assemble, they hold, they move, and nothing is thrown."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
import yaml
from ligature import Simulation
from ligature.adf import Severity
from ligature.model.assembly import joint_coordinates
from ligature.model.commands import BodyCommand, CommandType
from ligature.model.frames import inverse, pose7_matrix
from ligature.model.scene import Scene
from ligature.physics import bullet
from ligature.physics.divergence import joined
from ligature.physics.world import World
from numpy.typing import NDArray

from tests.physics.linkages import CLOSING, KINDS, linkage

GAP = 1e-4
"""What a loop may open by, in metres, whatever its masses and wherever it passes."""

GAIN = 0.01
"""Share of the largest kinetic energy by which that of a linkage may grow beyond what falling and springs give."""

FAST = 100.0
"""Speed in m/s that no linkage reaches; one of 500, with a link of grams that whips about, comes to 61."""


def gaps(sim: Simulation) -> NDArray[np.float64]:
    """Metres by which each joint of a scene is open, its free axes aside."""
    scene, poses = sim.scene, sim.state["body_pose"][0]
    found = []
    for joint in scene.joints:
        parent, child = scene.bodies[joint.parent], scene.bodies[joint.child]
        T_a = pose7_matrix(poses[joint.parent]) @ parent.T_body_inertial @ joint.T_parent_a
        T_b = pose7_matrix(poses[joint.child]) @ child.T_body_inertial @ joint.T_child_b
        found.append(joint_coordinates(joint, inverse(T_a) @ T_b)[1])
    return np.array(found)


def energy(sim: Simulation) -> NDArray[np.float64]:
    """Kinetic energy (J) of all bodies, and potential energy of gravity and springs."""
    found = np.zeros(2)
    for body in sim.scene.bodies:
        if not body.static:
            T = pose7_matrix(sim.state["body_pose"][0, body.index]) @ body.T_body_inertial
            twist = sim.state["body_twist"][0, body.index]
            turning = T[:3, :3].T @ twist[3:]
            found[0] += 0.5 * (body.mass * twist[:3] @ twist[:3] + np.sum(body.inertia * turning**2))
            found[1] -= body.mass * body.gravity @ T[:3, 3]
    world = sim._world
    for k, control in enumerate(world.joints.controls):
        stretch = world.engine.motions.joints(k)[0] - control.axes.rest
        found[1] += 0.5 * np.sum(control.axes.stiffness * control.axes.sprung * stretch**2)
    return found


def run(sim: Simulation, ticks: int) -> tuple[NDArray[np.float64], NDArray[np.float64], float]:
    """The widest gap (m) of each of ``ticks``, the `energy` (ticks, 2) after it, and the largest speed (m/s)."""
    widest, energies, speed = np.zeros(ticks), np.zeros((ticks, 2)), 0.0
    for k in range(ticks):
        sim.step()
        widest[k], energies[k] = gaps(sim).max(), energy(sim)
        speed = max(speed, float(np.linalg.norm(sim.state["body_twist"][0, :, :3], axis=1).max()))
    return widest, energies, speed


def check(text: str, folder: Path, ticks: int) -> None:
    (folder / "model.yaml").write_text("namespace: /ambf/env/\n" + text, encoding="utf-8")
    scene = ligature.load(folder / "model.yaml")
    assert not [d for d in scene.diagnostics if d.severity >= Severity.WARNING], [str(d) for d in scene.diagnostics]
    assert scene.closures
    sim = Simulation(scene)
    assert gaps(sim).max() < 1e-6
    for body in scene.bodies:
        moved = np.linalg.norm(sim.state["body_pose"][0, body.index, :3] - body.T_world_body[:3, 3])
        assert moved < 0.02, body.identity.key
    start = energy(sim).sum()
    widest, energies, speed = run(sim, ticks)
    sim.close()
    assert not sim.problems
    assert widest.max() <= GAP
    assert speed < FAST
    assert (energies.sum(axis=1) - start).max() <= GAIN * energies[:, 0].max()


CASES = [(kind, closing) for kind in KINDS for closing in (CLOSING if kind != "spatial" else ("p2p",))]


@pytest.mark.parametrize(("kind", "closing"), CASES)
def test_any_rounded_linkage_assembles_and_holds(kind: str, closing: str, tmp_path: Path) -> None:
    rng = np.random.default_rng([KINDS.index(kind), CLOSING.index(closing)])
    check(linkage(rng, kind, closing), tmp_path, 300)


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "closing"), CASES)
def test_every_rounded_linkage_holds_as_it_falls_for_a_second(kind: str, closing: str, tmp_path: Path) -> None:
    """Through stretched and flat configurations, where grams hold kilograms: 500 of them, of masses of 1 to 10 000."""
    failed = {}
    for seed in range(20):
        rng = np.random.default_rng([KINDS.index(kind), CLOSING.index(closing), seed])
        try:
            check(linkage(rng, kind, closing), tmp_path, 1000)
        except AssertionError as error:
            failed[seed] = str(error).split("\n")[0]
    assert not failed


def scene_of(text: str, folder: Path) -> Scene:
    (folder / "model.yaml").write_text("namespace: /ambf/env/\n" + text, encoding="utf-8")
    return ligature.load(folder / "model.yaml")


def kinetic(world: World) -> float:
    """Kinetic energy (J) of all links, also of those parts of bodies that closing joints carry."""
    motions = world.engine.motions
    motions.everything()
    trees, found = motions.trees, 0.0
    for pose, twist, mass, inertia in zip(trees.pose, trees.twist, trees.mass, trees.inertia, strict=True):
        found += 0.5 * (mass * twist[:3] @ twist[:3] + inertia @ (pose7_matrix(pose)[:3, :3].T @ twist[3:]) ** 2)
    return float(found)


@pytest.mark.parametrize("kind", KINDS)
def test_closing_loops_takes_kinetic_energy_and_adds_none(kind: str, tmp_path: Path) -> None:
    """A linkage with joints put elsewhere, at any speeds, closes; it moves on as its loops allow, with less energy."""
    rng = np.random.default_rng(KINDS.index(kind))
    scene = scene_of(linkage(rng, kind, "p2p" if kind == "spatial" else "revolute"), tmp_path)
    sim = Simulation(scene)
    world, start = sim._world, sim.snapshot()
    looped = {closure.joint for closure in scene.closures}
    single = [j.index for j in scene.joints if len(scene.start.coordinates[j.index]) == 1 and j.index not in looped]
    for _ in range(20):
        sim.restore(start)
        for joint in single:
            at = scene.start.coordinates[joint][0] + rng.normal(0.0, 1e-3)
            world.set_joint_position(joint, at, rng.normal(0.0, 3.0))
        world.write_state(sim.state)
        before = kinetic(world)
        assert gaps(sim).max() > 1e-5
        assert not world._closures.project(False)
        world.write_state(sim.state)
        assert gaps(sim).max() < 1e-8
        assert kinetic(world) <= (1.0 + 1e-9) * before
        dt = 1e-5  # along the speeds that are left the loops stay closed
        for k, tree in enumerate(world.engine.trees):
            q, v, _ = world.engine.motions.joints(k).copy()
            world.joints.controls[k].set_state(range(len(tree.axes)), q + dt * v)
        world.write_state(sim.state)
        assert gaps(sim).max() < 1e-7
    sim.close()


def test_linkages_fall_as_in_mujoco_until_they_stretch(tmp_path: Path) -> None:
    """A four-bar whose crank of 9 kg is held by 7 and 9 g, beside MuJoCo in ticks of 10 µs; it stretches at 0.26 s."""
    oracle = pytest.importorskip("tests.physics.oracle", reason="MuJoCo is not installed")
    scene = scene_of(linkage(np.random.default_rng([0, 0, 9]), "four-bar"), tmp_path)
    sim = Simulation(scene)
    crank = max(scene.bodies, key=lambda body: body.mass)
    expected = oracle.motion(scene, sim.state["body_pose"][0].copy(), 250)
    for k in range(250):
        sim.step()
        T = pose7_matrix(sim.state["body_pose"][0, crank.index]) @ crank.T_body_inertial
        assert np.linalg.norm(T[:3, 3] - expected[k, crank.index]) < 2e-3
    assert np.ptp(expected[:, crank.index], axis=0).max() > 0.1
    sim.close()


def test_a_loop_that_opens_is_reported_once_with_its_gap(tmp_path: Path) -> None:
    scene = scene_of(linkage(np.random.default_rng(3), "four-bar", gravity=0.0), tmp_path)
    sim = Simulation(scene)
    looped = {closure.joint for closure in scene.closures}
    joint = next(j.index for j in scene.joints if j.index not in looped)
    sim._world.set_joint_position(joint, scene.start.coordinates[joint][0] + 1.5)
    sim.step(5)
    found = [d.message for d in sim.problems if d.code == "loop"]
    (name,) = (scene.joints[index].identity.key for index in looped)
    assert len(found) == 1 and f"the loop of joint '{name}' is open by " in found[0]
    sim.step(3000)
    assert gaps(sim).max() < GAP
    sim.close()


def test_without_a_handle_loops_close_to_the_same_bits(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    scene = scene_of(linkage(np.random.default_rng(4), "double parallelogram"), tmp_path)
    hashes = []
    for found in (True, False):
        if not found:
            monkeypatch.setattr(bullet._Clients, "begin", 0)
        sim = Simulation(scene)
        assert bool(sim._world.engine.motions.handle) == found
        sim.step(200)
        hashes.append(sim.state_hash())
        sim.close()
    assert hashes[0] == hashes[1]


def test_a_loop_repeats_after_reset_and_restore(tmp_path: Path) -> None:
    text = linkage(np.random.default_rng(3), "double parallelogram")
    (tmp_path / "model.yaml").write_text("namespace: /ambf/env/\n" + text, encoding="utf-8")
    scene = ligature.load(tmp_path / "model.yaml")
    sim, fresh = Simulation(scene), Simulation(scene)
    start = sim.state["body_pose"].copy()
    sim.step(100)
    snapshot = sim.snapshot()
    sim.step(100)
    end = sim.state_hash()
    fresh.restore(snapshot)
    fresh.step(100)
    assert fresh.state_hash() == end
    sim.reset()
    np.testing.assert_allclose(sim.state["body_pose"], start, atol=1e-12)
    sim.close()
    fresh.close()


def test_a_joint_that_closes_a_loop_is_reported_and_driven(tmp_path: Path) -> None:
    text = linkage(np.random.default_rng(5), "four-bar", gravity=0.0)
    (tmp_path / "model.yaml").write_text("namespace: /ambf/env/\n" + text, encoding="utf-8")
    sim = Simulation(ligature.load(tmp_path / "model.yaml"))
    (index,) = sim.scene.loops
    closing = sim.scene.joints[index]
    start = sim.scene.start.coordinates[index][0]
    body = next(body for body in sim.scene.bodies if index in body.joints)
    types, values = [CommandType.FORCE] * len(body.joints), [0.0] * len(body.joints)
    types[body.joints.index(index)], values[body.joints.index(index)] = CommandType.POSITION, start + 0.1
    sim.apply(BodyCommand(body.index, CommandType.FORCE, (0.0,) * 6, tuple(types), tuple(values)))
    assert sim.joints[closing.identity.key].position == pytest.approx(start, abs=1e-9)
    sim.step(1500)
    assert sim.joints[closing.identity.key].position == pytest.approx(start + 0.1, abs=2e-3)
    sim.close()


def test_a_joint_between_bodies_without_mass_is_reported(tmp_path: Path) -> None:
    ends = "parent: A, child: B, parent pivot: {x: 0, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}"
    axes = "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}"
    (tmp_path / "model.yaml").write_text(
        "bodies: [A, B]\njoints: [J]\nA: {name: A, mass: 0}\nB: {name: B, mass: 0}\n"
        f"J: {{name: J, type: revolute, {ends}, {axes}}}\n",
        encoding="utf-8",
    )
    found = [d for d in ligature.load(tmp_path / "model.yaml").diagnostics if d.code == "loop"]
    assert [d.message for d in found] == ["joint 'J' has no effect: neither 'A' nor 'B' has a mass"]
    assert found[0].mark is not None and found[0].mark.line == 5


def test_a_body_that_its_joint_holds_elsewhere_is_reported(tmp_path: Path) -> None:
    ends = "parent: A, child: B, parent pivot: {x: 0, y: 0, z: 0.3}, child pivot: {x: 0, y: 0, z: 0}"
    axes = "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}"
    (tmp_path / "model.yaml").write_text(
        "namespace: /n/\nbodies: [A, B]\njoints: [J]\nA: {name: A, mass: 0}\nB: {name: B, mass: 1}\n"
        f"J: {{name: J, type: revolute, {ends}, {axes}}}\n",
        encoding="utf-8",
    )
    scene = ligature.load(tmp_path / "model.yaml")
    (found,) = [d for d in scene.diagnostics if d.code == "moved"]
    assert found.message == "'/n/B' starts 300 mm and 0 rad away from its location: joint 'J' requires it"
    assert scene.start.coordinates[0] == (0.0,)


@pytest.mark.parametrize(("low", "expected"), [(-1.0, 0.6), (0.8, 0.8)])
def test_a_joint_starts_where_the_locations_state_within_its_limits(
    low: float, expected: float, tmp_path: Path
) -> None:
    ends = "parent: A, child: B, parent pivot: {x: 0, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}"
    axes = "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}"
    (tmp_path / "model.yaml").write_text(
        "namespace: /n/\nbodies: [A, B]\njoints: [J]\nA: {name: A, mass: 0}\n"
        "B: {name: B, mass: 1, location: {position: {x: 0, y: 0, z: 0}, orientation: {r: 0, p: 0, y: 0.6}}}\n"
        f"J: {{name: J, type: revolute, joint limits: {{low: {low}, high: 1.0}}, {ends}, {axes}}}\n",
        encoding="utf-8",
    )
    sim = Simulation(ligature.load(tmp_path / "model.yaml"))
    assert sim.joints["J"].position == pytest.approx(expected)
    sim.close()


def _chain_file(folder: Path, children: int, joint: str, static: bool = True) -> Path:
    """A model file of ``children`` bodies on one base, by inline blocks ``joint``."""
    names = [f"B{i}" for i in range(children)]
    lines = [f"bodies: [A, {', '.join(names)}]", f"joints: [{', '.join('J' + n for n in names)}]"]
    lines += [f"A: {{name: A, mass: {0 if static else 1}}}", *(f"{n}: {{name: {n}, mass: 1}}" for n in names)]
    pivots = "parent pivot: {x: 0, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}"
    axes = "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}"
    lines += [f"J{n}: {{name: J{n}, parent: A, child: {n}, {pivots}, {axes}, {joint}}}" for n in names]
    (folder / "model.yaml").write_text("\n".join(lines) + "\n", encoding="utf-8")
    return folder / "model.yaml"


@pytest.mark.parametrize(
    ("children", "joint"), [(200, "type: revolute"), (60, "type: cone twist, joint limits: {x: 1, y: 1, z: 1}")]
)
def test_more_links_than_a_tree_has_are_errors_with_their_place(children: int, joint: str, tmp_path: Path) -> None:
    scene = ligature.load(_chain_file(tmp_path, children, joint))
    errors = [d for d in scene.diagnostics if d.severity >= Severity.ERROR]
    assert errors and all("more than 120 degrees of freedom" in d.message and d.mark is not None for d in errors)
    sim = Simulation(scene)
    sim.step(3)
    assert np.isfinite(sim.state["body_pose"]).all()
    sim.close()


def test_an_axis_that_is_locked_off_zero_stays_there(tmp_path: Path) -> None:
    linear = "linear: {low: {x: 0.2, y: 0, z: 0}, high: {x: 0.2, y: 0, z: 0}}"
    angular = "angular: {low: {x: 0, y: 0.5, z: -1}, high: {x: 0, y: 0.5, z: 1}}"
    file = _chain_file(tmp_path, 1, f"type: six dof, joint limits: {{{linear}, {angular}}}")
    sim = Simulation(ligature.load(file))
    for _ in range(10):
        sim.step(50)
        D = pose7_matrix(sim.state["body_pose"][0, 1])
        values, metres, radians = joint_coordinates(sim.scene.joints[0], D)
        assert max(metres, radians) < 1e-3
        assert values[[0, 2]] == pytest.approx([0.2, 0.5], abs=1e-3)
    sim.close()


def test_a_controller_with_force_output_moves_a_light_link_without_throwing_it(tmp_path: Path) -> None:
    """Damping of 0.014 N·m·s on 4e-7 kg·m²: D dt is 35 times the inertia."""
    control = "controller: {P: 7, I: 0, D: 0.014}, controller output type: FORCE"
    file = _chain_file(tmp_path, 1, f"type: revolute, joint limits: {{low: -1, high: 1}}, {control}")
    text = file.read_text().replace(
        "B0: {name: B0, mass: 1}", "B0: {name: B0, mass: 0.005, inertia: {ix: 4e-7, iy: 4e-7, iz: 4e-7}}"
    )  # noqa: E501
    file.write_text(text)
    sim = Simulation(ligature.load(file))
    sim.bodies["A"].command_joints([0.5])
    for _ in range(500):
        sim.step()
        assert abs(sim.joints["JB0"].velocity) < 300.0
    assert sim.joints["JB0"].position == pytest.approx(0.5, abs=1e-3)
    sim.close()


def test_a_loop_that_diverges_restarts_as_a_whole(tmp_path: Path) -> None:
    text = linkage(np.random.default_rng(3), "spatial")
    (tmp_path / "model.yaml").write_text("namespace: /ambf/env/\n" + text, encoding="utf-8")
    sim = Simulation(ligature.load(tmp_path / "model.yaml"))
    start = sim.state["body_pose"].copy()
    sim.step(100)
    sim._world.engine.motions.everything()
    engine = sim._world.engine
    moving = next(k for k, tree in enumerate(engine.trees) if tree.axes)
    for k in joined(engine, [moving]):
        engine.restart(k)
    sim._world.write_state(sim.state)
    np.testing.assert_allclose(sim.state["body_pose"], start, atol=1e-9)
    assert gaps(sim).max() < 1e-6
    sim.close()


@pytest.mark.parametrize("kind", KINDS)
def test_nothing_that_hangs_on_a_loop_turns_faster_than_bullet_allows(kind: str, tmp_path: Path) -> None:
    """A light pendulum on a linkage is turned by a torque about its joint, which moves nothing of the loop itself."""
    rng = np.random.default_rng((11, KINDS.index(kind)))
    model = yaml.safe_load(linkage(rng, kind))
    bar = model[next(key for key in model["bodies"] if model[key]["mass"] > 0)]
    small = dict.fromkeys(("ix", "iy", "iz"), 1e-7)
    model["P"] = {"name": "P", "mass": 1e-3, "inertia": small, "location": bar["location"]}
    place, axis = dict.fromkeys("xyz", 0.0), {"x": 0.0, "y": 0.0, "z": 1.0}
    sides = {
        f"{side} {what}": value for side in ("parent", "child") for what, value in (("pivot", place), ("axis", axis))
    }
    model["JP"] = {"name": "JP", "parent": bar["name"], "child": "P", "type": "revolute", **sides}
    model["bodies"].append("P")
    model["joints"].append("JP")
    sim = Simulation(scene_of(yaml.safe_dump(model, sort_keys=False), tmp_path))
    max_velocity = 0.0
    for torque in (1e-3, 0.1, 10.0):
        for _ in range(20):
            about = pose7_matrix(sim.bodies["P"].pose)[:3, 2]
            sim.bodies["P"].command_wrench([0.0, 0.0, 0.0, *(torque * about)])
            sim.step()
            max_velocity = max(max_velocity, float(np.abs(sim.state["joint_velocity"]).max()))
    assert 99.0 < max_velocity < 100.1
    assert gaps(sim).max() < GAP
    assert not [problem for problem in sim.problems if problem.code == "diverged"]
    sim.close()


@pytest.mark.parametrize("type_", ["revolute", "prismatic", "p2p", "fixed", "torsion spring", "linear spring"])
@pytest.mark.parametrize("masses", [(0, 0), (0, 0.5), (0.5, 0)])
def test_two_bodies_may_have_two_joints_whether_they_move_or_not(
    type_: str, masses: tuple[float, float], tmp_path: Path
) -> None:
    keys = "axis: {x: 0, y: 0, z: 1}", "pivot: {x: 0, y: 0, z: 0}"
    both = ", ".join(f"{side} {key}" for side in ("parent", "child") for key in keys)
    lines = ["bodies: [A, B]", "joints: [J, K]"]
    lines += [
        f"{name}: {{name: {name}, mass: {mass}, location: {{}}}}" for name, mass in zip("AB", masses, strict=True)
    ]
    lines += [f"{name}: {{name: {name}, type: {type_}, parent: A, child: B, {both}}}" for name in "JK"]
    file = tmp_path / "twice.yaml"
    file.write_text("\n".join(lines))
    simulation = ligature.Simulation(ligature.load(file))
    assert len(simulation.scene.joints) == 2
    simulation.step(20)
    assert np.isfinite(simulation.state["body_pose"]).all()
    simulation.close()
