"""Rays, resistance sensors, contact sensors and constraint actuators meet threads, which Bullet does not have.

Bullet's own rays against capsules, its distances and plain geometry are the oracles.
"""

from __future__ import annotations

import ligature
import numpy as np
import pybullet
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from ligature import Simulation
from ligature.model.commands import ActuatorCommand
from ligature.model.frames import minimal_rotation, quaternion_matrix
from ligature.model.hits import RayHits
from ligature.model.shapes import Box
from ligature.suture.queries import RodQueries

from tests.sensing.conftest import Make

LENGTH, ELEMENTS, RADIUS = 0.1, 10, 0.002
SCALE = 100.0
"""Bullet's units for a metre: its rays end up to a millimetre before or behind what they hit, whatever its size."""

THREAD = (
    "T: {name: Thread, length: 0.1, diameter: 0.004, elements: 10, youngs modulus: 1.0e+9, "
    "location: {position: {x: 0.1, y: 0, z: -0.05}}}\n"
)
"""A stiff, weightless thread along z through (0.1, 0, 0)."""

PROBE = (
    "Probe: {{name: Probe, mass: {mass}, inertia: {{ix: 1, iy: 1, iz: 1}}, inertial offset: {{}}, collision shape: SPHERE, "
    "collision geometry: {{radius: 0.01}}, collision margin: 0.0001, location: {{position: {{x: {x}, y: 0, z: 0.005}}}}}}\n"
)
RAYS = "array: [{offset: {x: 0.02, y: 0, z: 0}, direction: {x: 1, y: 0, z: 0}}]"


def scene(sensor: str, more: str = "", x: float = 0.0, mass: float = 0.0) -> str:
    return (
        "bodies: [Probe]\nsutures: [T]\nsensors: [S]\nactuators: [A]\n" + PROBE.format(x=x, mass=mass) + THREAD
        + f"S: {{name: S, parent: Probe, {sensor}}}\nA: {{name: A, type: Constraint, parent: Probe{more}}}\n"
    )  # fmt: skip


def element_at(sim: Simulation, z: float) -> int:
    """The element whose middle is nearest to a height."""
    chain = sim.scene.rods[0].bodies
    return min(chain, key=lambda body: abs(float(sim.state["body_pose"][0, body, 2]) - z))


# --- rays -------------------------------------------------------------------------------------


def test_a_ray_hits_a_thread_and_names_its_element(simulate: Make) -> None:
    sim = simulate(scene(f"type: Proximity, range: 0.2, {RAYS}"))
    sim.step(1)
    assert sim.state["ray_body"][0, 0] == element_at(sim, 0.005)
    assert sim.state["ray_point"][0, 0] == pytest.approx([0.1 - RADIUS, 0, 0.005], abs=1e-6)
    assert sim.state["ray_normal"][0, 0] == pytest.approx([-1, 0, 0], abs=1e-6)
    assert sim.state["ray_measurement"][0, 0] == pytest.approx(1 - (0.08 - RADIUS) / 0.2, abs=1e-5)


def test_the_nearer_of_a_body_and_a_thread_is_hit(simulate: Make) -> None:
    wall = (
        "Wall: {name: Wall, mass: 0, collision shape: BOX, collision geometry: {x: 0.02, y: 1, z: 1}, "
        "location: {position: {x: %g, y: 0, z: 0}}}\n"
    )
    for x, thread in ((0.06, False), (0.15, True)):
        text = scene(f"type: Proximity, range: 0.2, {RAYS}").replace("bodies: [Probe]", "bodies: [Probe, Wall]")
        sim = simulate(text + wall % x)
        sim.step(1)
        hit = int(sim.state["ray_body"][0, 0])
        assert (hit in sim.scene.rods[0].bodies) is thread, x
        assert thread or hit == sim.bodies["Wall"].body.index


_unit = st.floats(-1.0, 1.0, allow_nan=False)
_vector = st.tuples(_unit, _unit, _unit).filter(lambda v: np.linalg.norm(v) > 0.05)


@pytest.fixture(scope="module")
def bent(tmp_path_factory: pytest.TempPathFactory) -> tuple[Simulation, RodQueries, int]:
    """A thread in a random bend, our queries, and a Bullet client with a capsule in place of each element."""
    folder = tmp_path_factory.mktemp("bent")
    (folder / "m.yaml").write_text("sutures: [T]\n" + THREAD)
    sim = Simulation(ligature.load(folder / "m.yaml"))
    rod = sim._suture.rods.rods[0]
    rng = np.random.default_rng(5)
    directions = np.cumsum(rng.normal(0, 0.5, (ELEMENTS, 3)), axis=0) + [0, 0, 1]
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    ends = np.vstack([np.zeros(3), np.cumsum(directions * LENGTH / ELEMENTS, axis=0)])
    client = pybullet.connect(pybullet.DIRECT)
    poses = []
    for a, b, d in zip(ends[:-1], ends[1:], directions, strict=True):
        R = minimal_rotation(np.array([0.0, 0, 1]), d)
        w = 0.5 * np.sqrt(max(1 + np.trace(R), 1e-9))
        q = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1], 4 * w * w]) / (4 * w)
        poses.append(np.concatenate([0.5 * (a + b), q / np.linalg.norm(q)]))
        shape = pybullet.createCollisionShape(
            pybullet.GEOM_CAPSULE, radius=SCALE * RADIUS, height=SCALE * LENGTH / ELEMENTS, physicsClientId=client
        )
        pybullet.createMultiBody(0, shape, -1, SCALE * poses[-1][:3], poses[-1][3:], physicsClientId=client)
    rod.set_motion(np.array(poses), np.zeros((ELEMENTS, 6)))
    pybullet.stepSimulation(physicsClientId=client)
    return sim, RodQueries(sim._suture.rods, sim._world), client


@settings(max_examples=80, deadline=None, phases=[Phase.generate])
@given(
    start=_vector, aim=st.integers(0, ELEMENTS - 1), beside=st.tuples(_unit, _unit, _unit), reach=st.floats(0.2, 3.0)
)
def test_rays_hit_threads_where_geometry_and_bullet_have_them(
    bent: tuple[Simulation, RodQueries, int],
    start: tuple[float, ...],
    aim: int,
    beside: tuple[float, ...],
    reach: float,
) -> None:
    """The hit is on the skin and no point of the ray before it is inside; Bullet's coarser ray agrees."""
    sim, queries, client = bent
    rod = sim._suture.rods.rods[0]
    begin = rod.positions.mean(axis=0) + 0.1 * np.array(start)
    end = begin + reach * (rod.positions[aim] + 1.5 * RADIUS * np.array(beside) - begin)
    none = RayHits(np.array([-1], np.int32), np.ones(1), np.zeros((1, 3)), np.zeros((1, 3)))
    mine = queries.cast(begin[None], end[None], none)
    away = [_distance_to(rod, begin + s * (end - begin)) for s in np.linspace(0.0, 1.0, 400)]
    if away[0] < 0.2 * RADIUS:
        return  # rays that begin inside pass out
    if mine.body[0] < 0:
        assert min(away) > -0.01 * RADIUS
    else:
        at = int(np.floor(mine.fraction[0] * 399))
        assert min(away[: at + 1]) > -1e-9
        assert _distance_to(rod, mine.point[0]) == pytest.approx(0.0, abs=1e-9)
        assert _distance_to(rod, mine.point[0] + 1e-5 * mine.normal[0]) == pytest.approx(1e-5, abs=2e-6)
    segment = ((SCALE * begin).tolist(), (SCALE * end).tolist())
    (body, _, fraction, *_), *_ = pybullet.rayTest(*segment, physicsClientId=client)
    if abs(min(away)) > 0.2 * RADIUS and abs(away[-1]) > 0.2 * RADIUS:
        assert (mine.body[0] >= 0) == (body >= 0)
    if body >= 0 and mine.body[0] >= 0 and min(away) < -0.5 * RADIUS:
        assert mine.fraction[0] == pytest.approx(fraction, abs=0.5 * RADIUS / np.linalg.norm(end - begin))


def _distance_to(rod, point: np.ndarray) -> float:
    """Distance of a point from the skin of a rod, negative inside: plain geometry."""
    best = np.inf
    for x, q, (a, b) in zip(rod.positions, rod.orientations, rod.description.ends, strict=True):
        R = quaternion_matrix(q)
        a, b = R @ a + x, R @ b + x
        s = np.clip((point - a) @ (b - a) / ((b - a) @ (b - a)), 0, 1)
        best = min(best, float(np.linalg.norm(point - a - s * (b - a))))
    return best - RADIUS


# --- contacts ---------------------------------------------------------------------------------


def test_a_contact_sensor_sees_a_thread_that_touches_its_body(simulate: Make) -> None:
    for x, threshold, seen in ((0.0, 0.001, False), (0.0875, 0.001, True), (0.0, 0.09, True)):
        sim = simulate(scene(f"type: Contact, distance threshold: {threshold}", x=x))
        sim.step(1)
        count = int(sim.state["contact_count"][0])
        assert (count > 0) is seen
        if not seen:
            continue
        nearest = int(np.argmin(sim.state["contact_distance"][0, :count]))
        assert sim.state["contact_distance"][0, nearest] == pytest.approx(0.1 - x - 0.01 - RADIUS, abs=2e-4)
        assert sim.state["contact_body"][0, nearest] in sim.scene.rods[0].bodies
        assert sim.state["contact_point"][0, nearest] == pytest.approx([0.1 - RADIUS, 0, 0.005], abs=2e-3)
        assert sim.state["contact_normal"][0, nearest] == pytest.approx([-1, 0, 0], abs=0.1)


def test_a_contact_sensor_on_a_thread_sees_what_touches_its_element(simulate: Make) -> None:
    sim = simulate(
        scene("type: Contact", x=0.0885).replace("parent: Probe, type: Contact", "parent: T_005, type: Contact")
    )
    sensor = sim.scene.sensors[0]
    assert sensor.parent in sim.scene.rods[0].bodies, "the sensor is on the thread"
    sim.step(1)
    assert sim.state["contact_count"][0] == 1
    assert sim.state["contact_body"][0, 0] == sim.bodies["Probe"].body.index
    assert sim.state["contact_normal"][0, 0] == pytest.approx([1, 0, 0], abs=0.05)
    assert sim.state["contact_point"][0, 0, 0] == pytest.approx(0.0985, abs=2e-4)


def test_pairs_that_the_scene_keeps_apart_are_no_contacts(simulate: Make) -> None:
    swaged = THREAD.replace("location", "parent: Probe, location")
    sim = simulate(scene("type: Contact, distance threshold: 0.2").replace(THREAD, swaged))
    sim.step(1)
    first = sim.scene.rods[0].bodies[:3]
    count = int(sim.state["contact_count"][0])
    assert count == ELEMENTS - 3
    assert not set(first) & set(sim.state["contact_body"][0, :count].tolist())


@settings(max_examples=40, deadline=None)
@given(gap=st.floats(0.0, 0.05), threshold=st.floats(0.0, 0.05), turn=st.floats(-1.0, 1.0))
def test_a_threshold_of_any_size_counts_bodies_up_to_it(
    tmp_path_factory: pytest.TempPathFactory, gap: float, threshold: float, turn: float
) -> None:
    """Box against sphere: the distance is known; Bullet's own contact points end at 2 mm."""
    if abs(gap - threshold) < 2e-4:
        return
    folder = tmp_path_factory.getbasetemp()
    (folder / "m.yaml").write_text(
        "gravity: {x: 0, y: 0, z: 0}\nbodies: [Box, Ball]\nsensors: [S]\n"
        "Box: {name: Box, mass: 0, collision shape: BOX, collision geometry: {x: 0.1, y: 0.1, z: 0.1}, collision margin: 0.0001, "
        f"location: {{orientation: {{r: 0, p: 0, y: 0}}, position: {{x: 0, y: 0, z: 0}}}}}}\n"
        "Ball: {name: Ball, mass: 0.1, inertia: {ix: 1, iy: 1, iz: 1}, inertial offset: {}, collision shape: SPHERE, "
        "collision geometry: {radius: 0.02}, collision margin: 0.0001, "
        f"location: {{position: {{x: {0.07 + gap}, y: {0.04 * turn}, z: 0}}}}}}\n"
        f"S: {{name: S, parent: Ball, type: Contact, distance threshold: {threshold}}}\n"
    )
    sim = Simulation(ligature.load(folder / "m.yaml"))
    assert isinstance(sim.bodies["Box"].body.colliders[0].shape, Box)
    sim.step(1)
    assert (int(sim.state["contact_count"][0]) > 0) is (gap < threshold)
    if gap < threshold:
        assert sim.state["contact_distance"][0, 0] == pytest.approx(gap, abs=2e-4)
        assert sim.state["contact_point"][0, 0] == pytest.approx([0.05, 0.04 * turn, 0], abs=3e-4)
        assert sim.state["contact_normal"][0, 0] == pytest.approx([1, 0, 0], abs=1e-3)


# --- resistance -------------------------------------------------------------------------------


def test_a_resistance_sensor_pushes_a_thread_with_its_force(simulate: Make) -> None:
    """Momentum of the free thread after some ticks is force times time; the parent gets the opposite."""
    law = "contact stiffness: 0.02, friction: {static: 0, dynamic: 0, damping: 0}"
    sim = simulate(scene(f"type: Resistance, range: 0.2, {law}, {RAYS}", mass=1.0))
    rod = sim._suture.rods.rods[0]
    sim.step(20)
    momentum = rod.description.mass @ rod.twists[:, :3]
    force = 0.02 * (1 - (0.08 - RADIUS) / 0.2)
    assert momentum[0] == pytest.approx(force * 0.020, rel=0.1)
    assert sim.bodies["Probe"].twist[0] * 1.0 == pytest.approx(-momentum[0], rel=0.05)
    assert np.abs(momentum[1:]).max() < 0.05 * momentum[0]


@pytest.mark.parametrize("stiffness", [50.0, 1e3, 1e5])
def test_a_resistance_sensor_of_any_stiffness_holds_a_thread_while_it_moves(simulate: Make, stiffness: float) -> None:
    """Rays from both sides hold the thread; it follows the probe across the rays and is not thrown."""
    rays = (
        "array: [{offset: {x: 0.094, y: 0, z: 0}, direction: {x: 1, y: 0, z: 0}}, "
        "{offset: {x: 0.106, y: 0, z: 0}, direction: {x: -1, y: 0, z: 0}}]"
    )
    law = f"contact stiffness: 0.01, friction: {{static: {stiffness}, dynamic: 0, damping: {0.1 * stiffness}}}"
    sim = simulate(scene(f"type: Resistance, range: 0.01, {law}, {rays}"))
    rod, probe = sim._suture.rods.rods[0], sim.bodies["Probe"]
    at = probe.pose
    for _ in range(200):
        at[1] += 1e-4
        probe.command_pose(at)
        sim.step(1)
    held = rod.positions[rod.description.bodies.index(element_at(sim, 0.005))]
    assert held[1] == pytest.approx(0.02, abs=3e-3)
    assert np.abs(rod.twists).max() < 50.0
    assert np.abs(rod.positions).max() < 0.2
    assert not [p for p in sim.problems if p.code == "diverged"]


def test_a_snapshot_of_a_held_thread_continues_bit_for_bit(simulate: Make) -> None:
    law = "contact stiffness: 0.02, friction: {static: 5, dynamic: 1, damping: 1}"
    sim = simulate(scene(f"type: Resistance, range: 0.2, {law}, {RAYS}"))
    sim.step(30)
    taken, hashes = sim.snapshot(), []
    for other in (sim, Simulation(sim.scene)):
        other.restore(taken)
        other.step(40)
        hashes.append(other.state_hash())
    assert hashes[0] == hashes[1]


# --- grasping ---------------------------------------------------------------------------------


def _lift(sim: Simulation, way: float = 0.05, ticks: int = 500) -> float:
    """How far along y the element at the probe's height follows the probe, metres."""
    probe, element = sim.bodies["Probe"], element_at(sim, 0.005)
    at, before = probe.pose, float(sim.state["body_pose"][0, element, 1])
    for _ in range(ticks):
        at[1] += way / ticks
        probe.command_pose(at)
        sim.step(1)
    return float(sim.state["body_pose"][0, element, 1]) - before


@pytest.mark.parametrize("by", ["sensor", "name"])
def test_an_actuator_grasps_the_thread_that_a_ray_detects(simulate: Make, by: str) -> None:
    """The paper's rigid grasp: a ray between the fingers detects the thread, the actuator attaches what it names."""
    sim = simulate(scene(f"type: Proximity, range: 0.2, {RAYS}"))
    sim.step(1)
    seen = int(sim.state["ray_body"][0, 0])
    name = sim.scene.bodies[seen].identity.identifier
    command = ActuatorCommand(0, True, sensor="S") if by == "sensor" else ActuatorCommand(0, True, name)
    sim.apply(command)
    sim.step(1)
    assert sim.state["actuator_body"][0, 0] == seen
    assert not sim.problems
    assert _lift(sim) == pytest.approx(0.05, abs=2e-3)
    sim.apply(ActuatorCommand(0, False))
    assert _lift(sim, -0.05) > -0.001, "it goes on, and the probe goes back alone"
    assert sim.state["actuator_body"][0, 0] == -1


def test_an_actuator_that_slips_takes_a_thread_rigidly(simulate: Make) -> None:
    sim = simulate(scene(f"type: Proximity, range: 0.2, {RAYS}", more=", ligature slip: {normal force: 5.0}"))
    sim.step(1)
    sim.apply(ActuatorCommand(0, True, sensor="S"))
    assert _lift(sim) == pytest.approx(0.05, abs=2e-3)
