"""A needle and a thread of real masses in a sprung hole, from a file of our own: left alone, pulled, dragged."""

from __future__ import annotations

import ligature
import numpy as np
import pytest
import yaml
from ligature.model.frames import matrix_pose7, pose_matrix

RADIUS, THICK, PIECES = 0.0095, 0.0003, 9
ANGLES = np.radians(np.linspace(180.0, 30.0, PIECES + 1))
MASS = 1.2e-4
THREAD = {"length": 0.1, "diameter": 3e-4, "elements": 40, "youngs modulus": 5e7, "density": 1200.0}


def _vector(values):
    return dict(zip("xyz", map(float, values), strict=True))


def _pose(at=(0, 0, 0), rpy=(0, 0, 0)):
    return {"position": _vector(at), "orientation": dict(zip("rpy", map(float, rpy), strict=True))}


def _capsule(at, rpy, axis, radius, height):
    geometry = {"axis": axis, "radius": float(radius), "height": float(height)}
    return {"shape": "CAPSULE", "geometry": geometry, "offset": _pose(at, rpy)}


def _body(name, mass, shapes, at, **keys):
    block = {"name": name, "mass": mass, "inertial offset": _pose(), "location": _pose(at), "collision margin": 1e-4}
    if shapes:
        block["compound collision shape"] = shapes
    return {**block, "mesh": "", "friction": {"static": 0.3, "rolling": 0.0}, **keys}


def _needle():
    points = RADIUS * np.column_stack([np.cos(ANGLES), np.sin(ANGLES)])
    shapes = []
    for a, b in zip(points[:-1], points[1:], strict=True):
        along = b - a
        yaw = np.arctan2(along[1], along[0])
        shapes.append(_capsule([*(a + b) / 2, 0.0], (0, 0, yaw), "X", THICK, np.hypot(*along)))
    return shapes


def _scene(folder, tissue):
    ring = [_capsule((s * 0.0025, 0, 0), (0, 0, 0), "Y", 0.0006, 0.006) for s in (-1, 1)]
    ring += [_capsule((0, s * 0.0025, 0), (0, 0, 0), "X", 0.0006, 0.006) for s in (-1, 1)]
    zero = _vector((0, 0, 0))
    along = {"linear": _vector((100.0, 100.0, 100.0)), "angular": zero}
    joint = {
        "type": "six dof spring", "parent": "BODY tissue", "child": "BODY hole",
        "parent pivot": zero, "child pivot": zero, "parent axis": _vector((0, 0, 1)), "child axis": _vector((0, 0, 1)),
        "joint limits": {
            "linear": {"low": _vector((-0.002, 0, 0)), "high": _vector((0.002, 0, 0))},
            "angular": {"low": zero, "high": zero},
        },
        "stiffness": along, "damping": {"linear": _vector((1.0, 1.0, 1.0)), "angular": zero},
    }  # fmt: skip
    inertia, still = {"ix": 3e-9, "iy": 3e-9, "iz": 6e-9}, {"linear": 0.999, "angular": 0.999}
    model = {
        "namespace": "/env/",
        "bodies": ["BODY tissue", "BODY hole", "BODY Needle", "BODY hand"],
        "BODY tissue": _body("tissue", 0.0, [], (0, 0, 0.3)),
        "BODY hole": _body("hole", 0.002, ring, (0, 0, 0.3)),
        "BODY Needle": _body("Needle", MASS, _needle(), (0.05, 0, 0.3), inertia=inertia, damping=still),
        "BODY hand": _body("hand", 0.0, [_capsule((0, 0, 0), (0, 0, 0), "X", 0.001, 0.004)], (0.2, 0, 0.3)),
        "joints": ["JOINT hole"], "JOINT hole": joint,
        "ghost objects": ["GHOST hole"],
        "GHOST hole": {
            "name": "ghosthole", "parent": "BODY hole", "location": _pose(), "collision shape": "BOX",
            "collision geometry": _vector((0.005, 0.005, 0.0005)), "ligature tissue": tissue,
        },
        "sutures": ["SUTURE thread"],
        # The thread leaves the tail, where the arc has its first point, backwards.
        "SUTURE thread": {**THREAD, "name": "thread", "parent": "BODY Needle",
                          "location": _pose((-RADIUS, 0, 0), (np.pi / 2, 0, 0))},
    }  # fmt: skip
    file = folder / "tissue.yaml"
    file.write_text(yaml.safe_dump(model, sort_keys=False))
    return ligature.load(file)


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    return _scene(tmp_path_factory.mktemp("tissue"), {"friction": 0.3, "drag": 10.0})


@pytest.fixture
def sim(scene):
    simulation = ligature.Simulation(scene)
    yield simulation
    simulation.close()


THREAD_UP = pose_matrix((0.0, 0.0, 0.0), (-np.pi / 2, 0.0, 0.0))
"""Rotation of the needle that sends its thread straight up, its own arc upright in the xz plane."""


def _at(sim, position, R=THREAD_UP):
    T = R.copy()
    T[:3, 3] = position
    sim.bodies["Needle"].set_pose(matrix_pose7(T))


def _passing(sim):
    return [sim.scene.bodies[i.body].identity.name for i in sim.insertions]


def test_the_hole_and_the_needle_of_the_file_are_recognised(scene):
    assert [scene.bodies[n.body].identity.name for n in scene.needles] == ["Needle"]
    assert scene.needles[0].arc.radius == pytest.approx(RADIUS, rel=0.01)
    assert [hole.name for hole in scene.holes] == ["/env/GHOST hole"]
    assert scene.holes[0].tissue.friction == 0.3
    assert [d for d in scene.diagnostics if d.severity.name in ("ERROR", "WARNING")] == []


def test_thread_left_in_a_hole_stays_with_its_needle_hanging_from_it(sim):
    """The tissue carries 0.12 g of needle and the thread on both sides."""
    _at(sim, (RADIUS, 0.0, 0.24))
    sim.step(2000)
    assert [name.startswith("thread") for name in _passing(sim)] == [True]
    before = sim.insertions[0]
    needle = sim.bodies["Needle"].pose
    sim.step(8000)
    after = sim.insertions[0]
    assert abs(after.depth - before.depth) < 1e-6
    assert sim.bodies["Needle"].pose[2] == pytest.approx(needle[2], abs=0.2e-3)


@pytest.mark.parametrize(("pull", "slides"), [(0.2, False), (0.5, True)])
def test_thread_in_a_hole_slides_when_it_is_pulled_harder_than_friction(sim, pull, slides):
    _at(sim, (RADIUS, 0.0, 0.24))
    sim.step(100)
    start = sim.insertions[0].depth
    sim.bodies["Needle"].command_wrench([0.0, 0.0, -pull, 0.0, 0.0, 0.0])
    sim.step(500)
    began = sim.insertions[0].depth
    sim.step(500)
    speed = (began - sim.insertions[0].depth) / 0.5
    weight = 9.81 * (MASS + 0.5 * 1200.0 * np.pi * 1.5e-4**2 * 0.1)
    assert speed == pytest.approx((pull + weight - 0.3) / 10.0 if slides else 0.0, rel=0.1, abs=1e-4)
    assert abs(began - start) < (0.02 if slides else 1e-4)
    assert len(sim.insertions) == 1


def test_released_needle_half_through_stays_with_its_thread(sim):
    """Upright, its middle in the hole and moving down through it."""
    middle = 0.5 * (ANGLES[0] + ANGLES[-1])
    R = pose_matrix((0, 0, 0), (-np.pi / 2, 0, 0)) @ pose_matrix((0, 0, 0), (0, 0, np.pi - middle))
    at = R[:3, :3] @ (RADIUS * np.array([np.cos(middle), np.sin(middle), 0.0]))
    _at(sim, np.array([0.0, 0.0, 0.3]) - at, R)
    sim.step(1)
    start = sim.bodies["Needle"].pose
    assert "Needle" in _passing(sim)
    sim.step(10_000)
    assert np.linalg.norm(sim.bodies["Needle"].pose[:3] - start[:3]) < 0.2e-3
    assert 2.0 * RADIUS * np.linalg.norm(sim.bodies["Needle"].pose[3:6] - start[3:6]) < 0.2e-3


def test_hole_gives_to_the_pull_of_a_thread_as_its_spring_states(sim):
    """The needle draws the thread sideways; tissue and ring together take the force."""
    _at(sim, (RADIUS, 0.0, 0.24))
    sim.step(200)
    sim.bodies["Needle"].command_wrench([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])
    sim.step(2000)
    assert sim.bodies["/env/hole"].pose[0] == pytest.approx(0.1 / 100.0, rel=0.05)


def test_needle_is_drawn_through_and_the_thread_follows_into_the_same_hole(sim):
    _at(sim, (RADIUS, 0.0, 0.3))
    sim.step(1)
    assert _passing(sim) == ["Needle"] or _passing(sim) == []
    for _ in range(30):
        sim.bodies["Needle"].command_twist([0.0, 0.0, -0.05, 0.0, 0.0, 0.0])
        sim.step(20)
    assert [name.startswith("thread") for name in _passing(sim)] == [True]
    assert np.abs(sim.insertions[0].point[:2]).max() < 2.5e-3
    assert np.isfinite(sim.state["body_pose"]).all()
    assert sim.problems == []
