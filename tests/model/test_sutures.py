"""Sutures by physical data: one block of a file is a whole thread."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature import Scene, Simulation
from ligature.adf import Severity
from ligature.model import sutures
from ligature.model.frames import pose_matrix
from ligature.model.scene import JointType
from ligature.model.shapes import Capsule
from ligature.model.sutures import USP_MILLIMETRES
from ligature.suture.description import from_chain

NEEDLE = (
    "bodies: [BODY Needle]\nsutures: [SUTURE silk]\nnamespace: /ambf/env/\n"
    "BODY Needle: {name: Needle, mass: 0.001, collision shape: SPHERE, collision geometry: {radius: 0.001}, "
    "location: {position: {x: 0, y: 0, z: 0.5}}}\n"
)
SILK = (
    "SUTURE silk: {name: silk, length: 0.1, USP size: 2-0, youngs modulus: 1.0e+8, density: 1000, elements: 20, "
    "parent: BODY Needle, location: {position: {x: 0, y: 0, z: -0.001}, orientation: {r: 3.14159265358979, p: 0, y: 0}}}\n"
)


def load(tmp_path: Path, text: str) -> Scene:
    (tmp_path / "m.yaml").write_text(text)
    return ligature.load(tmp_path / "m.yaml")


def test_one_block_becomes_one_rod_of_the_given_data(tmp_path: Path) -> None:
    scene = load(tmp_path, NEEDLE + SILK)
    (rod,) = scene.rods
    assert len(rod.bodies) == 20 and rod.radius == pytest.approx(0.3195e-3 / 2)
    assert rod.lengths.sum() == pytest.approx(0.1)
    mass = sum(scene.bodies[b].mass for b in rod.bodies)
    assert mass == pytest.approx(1000 * np.pi * rod.radius**2 * 0.1)
    six = scene.joints[rod.joints[0]].six_dof
    assert six is not None
    assert six.stiffness[3] == pytest.approx(1e8 * np.pi * rod.radius**4 / 4 / 0.005)
    assert scene.bodies[rod.bodies[3]].identity.identifier == "/ambf/env/SUTURE silk_003"
    assert all(scene.bodies[b].identity.passive for b in rod.bodies)


TRIPLE = st.tuples(*[st.floats(-1.0, 1.0)] * 3)


def place(key: str, position: tuple[float, ...], turn: tuple[float, ...]) -> str:
    x, y, z = position
    r, p, w = turn
    return f"{key}: {{position: {{x: {x}, y: {y}, z: {z}}}, orientation: {{r: {r}, p: {p}, y: {w}}}}}"


@settings(max_examples=40, deadline=None)
@given(
    swaged=st.booleans(), n=st.integers(4, 12), length=st.floats(0.01, 1.0), diameter=st.floats(1e-4, 1e-2),
    density=st.floats(100.0, 5000.0), start=st.tuples(TRIPLE, TRIPLE), needle=st.tuples(TRIPLE, TRIPLE),
    inertial=st.tuples(TRIPLE, TRIPLE),
)  # fmt: skip
def test_elements_of_any_thread_are_cylinders_in_a_row_whose_joints_fit(
    tmp_path_factory: pytest.TempPathFactory, swaged: bool, n: int, length: float, diameter: float, density: float,
    start: tuple[tuple[float, ...], ...], needle: tuple[tuple[float, ...], ...], inertial: tuple[tuple[float, ...], ...],
) -> None:  # fmt: skip
    """At rest both frames of a joint coincide; second moments are sums over points, not the formula of a cylinder."""
    text = (
        "bodies: [BODY Needle]\nsutures: [SUTURE silk]\n"
        "BODY Needle: {name: Needle, mass: 0.001, collision shape: SPHERE, collision geometry: {radius: 0.001}, "
        f"{place('location', *needle)}, {place('inertial offset', *inertial)}}}\n"
        f"SUTURE silk: {{name: silk, length: {length}, diameter: {diameter}, youngs modulus: 1.0e+8, "
        f"density: {density}, elements: {n}, {'parent: BODY Needle, ' if swaged else ''}{place('location', *start)}}}\n"
    )
    scene = load(tmp_path_factory.mktemp("m"), text)
    T_start = pose_matrix(*start)
    if swaged:
        T_start = scene.bodies[0].T_world_body @ T_start
    elements = scene.bodies[1:]
    assert len(elements) == n
    each = length / n
    radius = diameter / 2
    around = [(np.cos(a), np.sin(a)) for a in np.pi / 2 * np.arange(4)]
    points = [
        (radius / np.sqrt(2) * x, radius / np.sqrt(2) * y, z * each / np.sqrt(12)) for x, y in around for z in (-1, 1)
    ]
    square = np.square(points).mean(axis=0)  # Gauss's points: exact for squares over a cylinder
    mass = density * np.pi * radius**2 * each
    for i, body in enumerate(elements):
        middle = T_start @ (0.0, 0.0, (i + 0.5) * each, 1.0)
        assert np.allclose(body.T_world_body[:3, 3], middle[:3]) and np.allclose(
            body.T_world_body[:3, :3], T_start[:3, :3]
        )
        assert body.mass == pytest.approx(mass)
        assert np.allclose(body.inertia, mass * (square.sum() - square), rtol=1e-9, atol=0.0)
        (collider,) = body.colliders
        assert isinstance(collider.shape, Capsule)
        assert (collider.shape.radius, collider.shape.height) == pytest.approx((radius, each + diameter))
        assert body.collision_margin == pytest.approx(radius / 10)
    assert len(scene.joints) == n - 1 + swaged
    for joint in scene.joints:
        parent, child = scene.bodies[joint.parent], scene.bodies[joint.child]
        inertials = [body.T_world_body @ body.T_body_inertial for body in (parent, child)]
        assert np.allclose(inertials[0] @ joint.T_parent_a, inertials[1] @ joint.T_child_b)
        assert np.allclose(parent.T_world_body @ joint.T_parent_child_zero, child.T_world_body)
        assert np.allclose(inertials[0][:3, :3] @ joint.axis, T_start[:3, 2])
        assert joint.passive and joint.identity.passive
        if joint.type is JointType.SIX_DOF_SPRING:
            assert joint.six_dof is not None
            assert not joint.six_dof.low[:3].any() and not joint.six_dof.high[:3].any()
            assert not joint.six_dof.stiffness[:3].any() and not joint.six_dof.equilibrium.any()
    fixed = [(joint.parent, joint.child) for joint in scene.joints if joint.type is JointType.FIXED]
    assert fixed == ([(0, 1)] if swaged else [])


def test_a_thread_may_have_the_fewest_and_the_most_elements(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sutures, "MOST_ELEMENTS", 7)
    for n, rods in ((3, 0), (4, 1), (7, 1), (8, 0)):
        assert len(load(tmp_path, NEEDLE + SILK.replace("elements: 20", f"elements: {n}")).rods) == rods


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.5])
def test_a_round_thread_twists_more_easily_than_it_bends_by_one_plus_the_poisson_ratio(
    tmp_path: Path, poisson: float
) -> None:
    """G J / (E I) of a circular section, with J = 2 I and G = E / (2 (1 + ν))."""
    scene = load(tmp_path, NEEDLE + SILK.replace("density:", f"poisson ratio: {poisson}, density:"))
    six = scene.joints[scene.rods[0].joints[0]].six_dof
    assert six is not None
    assert six.stiffness[5] == pytest.approx(six.stiffness[3] / (1.0 + poisson))
    assert six.stiffness[4] == six.stiffness[3]


@pytest.mark.parametrize("strain", [0.01, 0.05])
def test_a_bend_stays_from_the_moment_that_stretches_the_skin_by_the_yield_strain(
    tmp_path: Path, strain: float
) -> None:
    """M = E I ε / r of a round section (Euler, Bernoulli)."""
    elastic = load(tmp_path, NEEDLE + SILK).joints
    assert {joint.six_dof.yield_moment for joint in elastic if joint.six_dof} == {np.inf}
    scene = load(tmp_path, NEEDLE + SILK.replace("density:", f"yield strain: {strain}, density:"))
    radius = scene.rods[0].radius
    assert from_chain(scene, scene.rods[0]).yield_moment == pytest.approx(1e8 * np.pi * radius**3 / 4 * strain)


def test_a_joint_of_a_thread_states_the_moment_from_which_a_bend_stays(tmp_path: Path) -> None:
    names = [f"BODY b{i}" for i in range(6)]
    bodies = [
        f"{name}: {{name: b{i}, mass: 1.0e-5, collision shape: CAPSULE, "
        f"collision geometry: {{radius: 0.0004, height: 0.002, axis: Z}}, "
        f"location: {{position: {{x: 0, y: 0, z: {0.002 * i}}}}}}}"
        for i, name in enumerate(names)
    ]
    joints = [
        f"JOINT j{i}: {{name: j{i}, parent: {a}, child: {b}, type: six dof spring, "
        "parent pivot: {x: 0, y: 0, z: 0.001}, child pivot: {x: 0, y: 0, z: -0.001}, "
        "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}, ligature yield moment: 2.0e-5, "
        "joint limits: {linear: {low: {x: 0, y: 0, z: 0}, high: {x: 0, y: 0, z: 0}}, "
        "angular: {low: {x: -3, y: -3, z: -3}, high: {x: 3, y: 3, z: 3}}}, "
        "stiffness: {angular: {x: 0.001, y: 0.001, z: 0.001}}}"
        for i, (a, b) in enumerate(zip(names[:-1], names[1:], strict=True))
    ]
    head = f"bodies: [{', '.join(names)}]\njoints: [{', '.join(f'JOINT j{i}' for i in range(5))}]\n"
    scene = load(tmp_path, head + "\n".join([*bodies, *joints]) + "\n")
    assert from_chain(scene, scene.rods[0]).yield_moment.tolist() == [2e-5] * 5


USP_LIMITS = {
    "10-0": (0.020, 0.029), "9-0": (0.030, 0.039), "8-0": (0.040, 0.049), "7-0": (0.050, 0.069), "6-0": (0.070, 0.099),
    "5-0": (0.100, 0.149), "4-0": (0.150, 0.199), "3-0": (0.200, 0.249), "2-0": (0.300, 0.339), "0": (0.350, 0.399),
    "1": (0.400, 0.499), "2": (0.500, 0.599),
}  # fmt: skip
"""Limits on the average diameter in millimetres, United States Pharmacopeia, chapter 861."""


def test_every_usp_size_is_the_middle_of_its_range() -> None:
    assert pytest.approx({size: sum(limits) / 2 for size, limits in USP_LIMITS.items()}, abs=1e-9) == USP_MILLIMETRES


def test_a_colour_holds_for_the_whole_thread_and_half_of_it_in_the_shade(tmp_path: Path) -> None:
    scene = load(tmp_path, NEEDLE + SILK.replace("density:", "color rgba: {r: 0.8, g: 0.6, b: 0.4, a: 0.5}, density:"))
    for body in scene.rods[0].bodies:
        colour = scene.bodies[body].visual.colour
        assert (colour.diffuse, colour.alpha) == ((0.8, 0.6, 0.4), 0.5)
        assert colour.ambient == pytest.approx((0.4, 0.3, 0.2))


def test_it_hangs_from_its_needle(tmp_path: Path) -> None:
    simulation = Simulation(load(tmp_path, NEEDLE.replace("mass: 0.001", "mass: 0") + SILK))
    simulation.step(1000)
    end = simulation.bodies["SUTURE silk_019"].pose
    assert end[:3] == pytest.approx([0, 0, 0.5 - 0.001 - 0.0975], abs=2e-4)


@pytest.mark.parametrize(
    ("old", "new", "text"),
    [
        ("USP size: 2-0", "USP size: 99", "has the USP size '99'; give diameter, or one of 10-0"),
        ("elements: 20", "elements: 3", "has 3 elements; give 4 to 2000"),
        ("elements: 20", "elements: 2001", "has 2001 elements; give 4 to 2000"),
        ("length: 0.1", "length: 0", "has no length; give metres"),
        ("USP size: 2-0", "diameter: -1", "has the diameter -1; give metres"),
        ("USP size: 2-0", "diameter: 0", "has the diameter 0; give metres"),
    ],
)
def test_data_that_make_no_thread_are_reported(tmp_path: Path, old: str, new: str, text: str) -> None:
    scene = load(tmp_path, NEEDLE + SILK.replace(old, new))
    assert scene.rods == ()
    assert text in "\n".join(str(d) for d in scene.diagnostics if d.severity >= Severity.ERROR)


VALUES = st.one_of(
    st.sampled_from([0.0, -1.0, 0.5, -0.5]),
    st.builds(lambda sign, power: sign * 10.0**power, st.sampled_from([-1.0, 1.0]), st.floats(-9.0, 11.0)),
)


@settings(max_examples=60, deadline=None)
@given(
    key=st.sampled_from(["density", "youngs modulus", "poisson ratio", "damping time", "yield strain", "friction"]),
    value=VALUES,
)
def test_a_number_of_a_thread_is_refused_by_its_name_or_makes_one_that_falls(
    key: str, value: float, tmp_path_factory: pytest.TempPathFactory
) -> None:
    numbers = {"density": 1000.0, "youngs modulus": 1e8, key: value}
    block = ", ".join(f"{name}: {number!r}" for name, number in numbers.items())
    text = f"{NEEDLE}SUTURE silk: {{name: silk, length: 0.1, USP size: 2-0, elements: 20, {block}}}\n"
    scene = load(tmp_path_factory.mktemp("thread"), text)
    errors = [str(found) for found in scene.diagnostics if found.severity >= Severity.ERROR]
    if errors:
        assert f"'{key}'" in errors[0]
        assert not scene.rods
        return
    simulation = Simulation(scene)
    simulation.step(100)
    twists = simulation.state[0]["body_twist"][list(scene.rods[0].bodies)]
    assert twists[:, 2] == pytest.approx(-0.981, rel=0.05)
    simulation.close()


@pytest.mark.parametrize("seed", range(8))
def test_a_thread_leads_along_its_way_and_straight_on_beyond_it(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    turns = rng.uniform(-0.5, 0.5, (12, 3))
    way = 0.01 * np.cumsum(np.array([0.0, 0.0, 1.0]) + turns, axis=0)
    listed = ", ".join(f"{{x: {x}, y: {y}, z: {z}}}" for x, y, z in way.tolist())
    path = tmp_path / "silk.yaml"
    path.write_text(
        "sutures: [SUTURE silk]\nnamespace: /ambf/env/\n"
        f"SUTURE silk: {{name: silk, length: 0.4, diameter: 0.0005, elements: 200, way: [{listed}], location: "
        "{position: {x: 0.1, y: 0.2, z: 0.3}, orientation: {r: 0, p: 0, y: 0}}}\n"
    )
    scene = ligature.load(path)
    poses = np.array([scene.bodies[body].T_world_body for body in scene.rods[0].bodies])
    half = 0.001 * poses[:, :3, 2]
    begins, ends = poses[:, :3, 3] - half, poses[:, :3, 3] + half
    np.testing.assert_allclose(begins[0], [0.1, 0.2, 0.3], atol=1e-12)
    np.testing.assert_allclose(begins[1:], ends[:-1], atol=1e-9)
    corners = np.vstack([np.zeros(3), way]) + [0.1, 0.2, 0.3]
    edges = np.diff(corners, axis=0)
    share = np.clip(((ends[:, None] - corners[:-1]) * edges).sum(axis=2) / (edges**2).sum(axis=1), 0.0, 1.0)
    away = np.linalg.norm(ends[:, None] - corners[:-1] - share[..., None] * edges, axis=2).min(axis=1)
    on = int(np.linalg.norm(edges, axis=1).sum() / 0.002)
    # Chords cut corners, so that fewer elements are on it than its length has; a turn below 1 mrad is not made.
    assert away[: on - 6].max() < 1e-3 * 0.002
    np.testing.assert_allclose(poses[on + 2 :, :3, 2], poses[-1, :3, 2][None].repeat(198 - on, axis=0), atol=1e-9)
