"""MJCF models against geometry and mechanics done by hand, and loaded in the simulator."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import gymnasium
import ligature
import numpy as np
import pytest
from ligature.adf import Resolver
from ligature.adf.frames import matrix_rpy, rpy_matrix
from ligature.authoring.conversion import Converted
from ligature.authoring.mjcf import from_mjcf
from ligature.authoring.placement import JointKeys, child_pose, joint_pose, matrix_of, moved_child_pose
from ligature.cli.main import app
from ligature.mesh.inertia import capsule_properties
from ligature.mesh.load import load_mesh
from ligature.model.frames import pose7_matrix
from ligature.model.scene import Scene
from typer.testing import CliRunner

mujoco = pytest.importorskip("mujoco", reason="MuJoCo, which reads MJCF, is not installed")
ROOT = Path(__file__).resolve().parent.parent.parent
HEAD = '<mujoco model="m"><compiler angle="radian"/><option gravity="0 0 -9.81"/>'


def converted(world: str, more: str = "") -> Converted:
    """What a world body's content, and sections after it, become."""
    return from_mjcf(mujoco.MjModel.from_xml_string(f"{HEAD}<worldbody>{world}</worldbody>{more}</mujoco>"))


def values(result: Converted, kind: str, name: str) -> dict[str, Any]:
    return next(dict(i.values) for i in result.parts.items if i.kind == kind and i.values["name"] == name)


def tensor(moments: Any, T: np.ndarray) -> np.ndarray:
    """Inertia tensor in a body of principal moments in a frame."""
    return T[:3, :3] @ np.diag(moments) @ T[:3, :3].T


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., tuple[Scene, str]]:
    """Converts by the command line and loads the model: the scene, and what was reported."""

    def convert(world: str, more: str = "") -> tuple[Scene, str]:
        (tmp_path / "m.xml").write_text(f"<!-- a <robot> -->\n{HEAD}<worldbody>{world}</worldbody>{more}</mujoco>")
        done = CliRunner().invoke(app, ["convert", str(tmp_path / "m.xml"), "-o", str(tmp_path / "out" / "m.yaml")])
        assert done.exit_code == 0, done.output
        scene = ligature.load(tmp_path / "out" / "m.yaml")
        assert not [str(d) for d in scene.diagnostics if d.severity >= 2]
        return scene, done.output

    return convert


ROD = """<body name="rod" pos="0.2 0.1 1.5" euler="0 0.1 0"><joint name="swing" type="hinge" axis="0 1 0"/>
<geom type="capsule" fromto="0 0 0 0 0 -0.5" size="0.02" density="1000"/></body>"""


def test_a_pendulum_has_the_rods_inertia_and_swings_with_its_period(load: Callable[..., tuple[Scene, str]]) -> None:
    scene, output = load(ROD)
    assert "2 bodies, 1 joint," in output and "note" not in output  # the world's own body holds the joint
    rod = next(b for b in scene.bodies if b.identity.key == "BODY rod")
    solid = capsule_properties(0.02, 0.54, 1000.0)
    assert rod.mass == pytest.approx(solid.mass, rel=1e-6)
    np.testing.assert_allclose(tensor(rod.inertia, rod.T_body_inertial), solid.inertia, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(rod.T_body_inertial[:3, 3], [0, 0, -0.25], atol=1e-9)
    np.testing.assert_allclose(rod.T_world_body[:3, :3], rpy_matrix(0, 0.1, 0), atol=1e-9)
    sim = ligature.Simulation(scene)
    crossings, last = [], 0.1
    for tick in range(3500):
        sim.step()
        now = sim.joints["swing"].position + 0.1  # it hangs at rest where the hinge has turned back
        if last > 0 >= now:
            crossings.append(tick + last / (last - now))
        last = now
    about_pivot = solid.inertia[1, 1] + solid.mass * 0.25**2
    exact = 2 * np.pi * np.sqrt(about_pivot / (solid.mass * 9.81 * 0.25)) * (1 + 0.1**2 / 16)
    assert np.diff(crossings).mean() * 1e-3 == pytest.approx(exact, rel=2e-3)


def test_a_turned_inertia_is_written_as_principal_moments_in_their_frame() -> None:
    given = np.array([[0.03, 0.004, -0.002], [0.004, 0.05, 0.001], [-0.002, 0.001, 0.06]])
    full = "0.03 0.05 0.06 0.004 -0.002 0.001"
    found = values(
        converted(f'<body name="b"><freejoint/><inertial pos="0.1 0 -0.2" mass="2" fullinertia="{full}"/></body>'),
        "body",
        "b",
    )
    T = matrix_of(found["inertial offset"])
    np.testing.assert_allclose(
        tensor([found[f"inertia.i{a}"] for a in "xyz"], T), given, atol=2e-8
    )  # MuJoCo's own quaternion

    np.testing.assert_allclose(T[:3, 3], [0.1, 0, -0.2], atol=1e-12)
    assert found["mass"] == 2.0


def keys_of(item: dict[str, Any]) -> JointKeys:
    names = ("parent pivot", "child pivot", "parent axis", "child axis", "offset", "joint offset")
    return JointKeys(*(item[name] for name in names))


def relative(model: Any, q: dict[str, float], parent: str, child: str) -> np.ndarray:
    """Pose of a body in another by MuJoCo's own kinematics, at joint positions by name."""
    data = mujoco.MjData(model)
    for name, value in q.items():
        data.qpos[model.joint(name).qposadr[0]] = value
    mujoco.mj_kinematics(model, data)
    poses = []
    for name in (parent, child):
        T = np.eye(4)
        T[:3, :3], T[:3, 3] = data.body(name).xmat.reshape(3, 3), data.body(name).xpos
        poses.append(T)
    return np.linalg.inv(poses[0]) @ poses[1]


BALL = '<geom type="sphere" size="0.1"/>'
CHAIN = f"""<body name="a" pos="1 0 0" euler="0.3 0.2 0.1"><freejoint/>{BALL}
  <body name="b" pos="0.5 0.1 0" euler="0 0.7 0"><joint name="turn" axis="1 2 2" pos="0.1 0 0" range="-1 2" ref="0.5"/>
    <inertial pos="0 0.01 0" euler="0.4 0 0" mass="1" diaginertia="0.01 0.02 0.025"/>
    <body name="c" pos="0 0 0.4" euler="0 0 2"><joint name="push" type="slide" axis="0 -1 1" range="0 0.1"/>{BALL}
      <body name="d" pos="0 0 0.3" euler="1 0 0">{BALL}
        <body name="e" pos="0 0.3 0"><joint name="ball" type="ball" pos="0 -0.1 0"/>{BALL}</body></body></body></body></body>"""


def test_joints_hold_bodies_where_the_file_puts_them_with_limits_from_there(
    load: Callable[..., tuple[Scene, str]],
) -> None:
    scene, output = load(CHAIN)
    assert "5 bodies, 4 joints" in output
    joints = {j.identity.name: j for j in scene.joints}
    kinds = {name: joint.type.value for name, joint in joints.items()}
    assert kinds == {"turn": "revolute", "push": "prismatic", "d": "fixed", "ball": "p2p"}
    assert (joints["turn"].low, joints["turn"].high) == pytest.approx((-1.5, 1.5))
    assert (joints["push"].low, joints["push"].high) == pytest.approx((0.0, 0.1))
    for joint in scene.joints:
        parent, child = scene.bodies[joint.parent], scene.bodies[joint.child]
        np.testing.assert_allclose(parent.T_world_body @ joint.T_parent_child_zero, child.T_world_body, atol=1e-6)
    sim = ligature.Simulation(scene)
    sim.step(50)
    assert all(np.isfinite(body.pose).all() for body in sim.bodies.values())


@pytest.mark.parametrize(("name", "parent", "child", "position"), [("turn", "a", "b", 0.8), ("push", "b", "c", 0.07)])
def test_joints_move_their_bodies_as_mujoco_does(name: str, parent: str, child: str, position: float) -> None:
    model = mujoco.MjModel.from_xml_string(f"{HEAD}<worldbody>{CHAIN}</worldbody></mujoco>")
    result = from_mjcf(model)
    ends = [matrix_of(values(result, "body", each)["inertial offset"]) for each in (parent, child)]
    found = moved_child_pose(keys_of(values(result, "joint", name)), position, ends[0], ends[1], name == "push")
    zero = float(model.qpos0[model.joint(name).qposadr[0]])
    np.testing.assert_allclose(found, relative(model, {name: zero + position}, parent, child), atol=1e-9)


SEVERAL = {
    "planar": [("x", "slide", "1 0 0"), ("y", "slide", "0 1 0"), ("yaw", "hinge", "0 0 1")],
    "wrist": [("roll", "hinge", "1 0 0"), ("pitch", "hinge", "0 1 0"), ("yaw", "hinge", "0 0 1")],
    "left-handed": [("a", "hinge", "0 0 1"), ("b", "hinge", "1 0 0"), ("c", "hinge", "0 1 0")],
    "along": [("s", "slide", "0 0 -1"), ("h", "hinge", "0 0.6 0.8"), ("g", "hinge", "0 -0.8 0.6")],
}


@pytest.mark.parametrize("case", ["planar", "wrist", "left-handed"])
def test_joints_in_one_place_become_a_six_dof_joint_that_moves_the_same_way(case: str) -> None:
    tags = "".join(
        f'<joint name="{n}" type="{t}" axis="{a}" pos="0.1 0 0.05" range="-0.5 {0.6 + 0.1 * i}"/>'
        for i, (n, t, a) in enumerate(SEVERAL[case])
    )
    world = f'<body name="p" pos="0 0 1"><freejoint/>{BALL}<body name="b" pos="0.2 0 0" euler="0.1 0.2 0.3">{tags}{BALL}</body></body>'
    model = mujoco.MjModel.from_xml_string(f"{HEAD}<worldbody>{world}</worldbody></mujoco>")
    result = from_mjcf(model)
    joint = values(result, "joint", " ".join(n for n, _, _ in SEVERAL[case]))
    assert joint["type"] == "six dof" and not result.notes
    q = {n: v for (n, _, _), v in zip(SEVERAL[case], (0.3, -0.2, 0.4), strict=True)}
    T_parent_a, at_rest = joint_pose(keys_of(joint)), child_pose(keys_of(joint))
    wanted = np.linalg.inv(T_parent_a) @ relative(model, q, "p", "b") @ np.linalg.inv(at_rest) @ T_parent_a
    found = [*wanted[:3, 3], *matrix_rpy(wanted[:3, :3])]  # turned by Rz Ry Rx, as the format composes them
    upper = dict(zip(q.values(), (0.6, 0.7, 0.8), strict=True))  # the position shows which joint an axis is
    seen = 0
    for path, value in zip([(half, a) for half in ("linear", "angular") for a in "xyz"], found, strict=True):
        low, high = (joint[f"joint limits.{path[0]}.{end}.{path[1]}"] for end in ("low", "high"))
        if low == high:
            assert value == pytest.approx(0.0, abs=1e-9)
            continue
        position = next(v for v in upper if abs(abs(v) - abs(value)) < 1e-9)
        expected = (-0.5, upper[position]) if position * value > 0.0 else (-upper[position], 0.5)
        assert (low, high) == pytest.approx(expected)
        seen += 1
    assert seen == 3


def test_joints_that_no_joint_of_the_format_expresses_are_reported_by_name() -> None:
    tags = "".join(f'<joint name="{n}" type="{t}" axis="{a}"/>' for n, t, a in SEVERAL["along"])
    result = converted(f'<body name="p"><freejoint/>{BALL}<body name="b">{tags}{BALL}</body></body>')
    assert [i.key for i in result.parts.items] == ["BODY p", "BODY b"]
    assert result.notes == [
        "body 'b' has the joints 's', 'h', 'g', which one joint of ADF cannot express; the body stays free"
    ]


def test_springs_and_dampers_of_joints_that_nothing_drives(load: Callable[..., tuple[Scene, str]]) -> None:
    scene, output = load(
        f"""<body name="a"><joint name="limited" axis="0 1 0" range="-1 1" stiffness="3" damping="0.2" springref="0.4"/>{BALL}</body>
        <body name="b" pos="1 0 0"><joint name="open" axis="0 1 0" damping="0.5"/>{BALL}</body>
        <body name="c" pos="2 0 0"><joint name="driven" axis="0 1 0" damping="0.5" frictionloss="0.1"/>{BALL}</body>""",
        '<actuator><motor name="m" joint="driven"/></actuator>',
    )
    joints = {j.identity.name: j for j in scene.joints}
    limited, six = joints["limited"], joints["open"].six_dof
    assert limited.type.value == "torsion spring"
    assert (limited.stiffness, limited.damping, limited.equilibrium) == pytest.approx((3.0, 0.2, 0.4))
    assert joints["open"].type.value == "six dof spring" and six is not None
    assert six.low[5] > six.high[5] and six.damping[5] == pytest.approx(0.5) and not six.high[:5].any()
    assert joints["driven"].type.value == "revolute"
    assert "joint 'driven': its damping, its friction cannot be expressed and is left out" in output
    assert "gains of the actuators are left out: 'm'" in output


def test_a_damped_hinge_slows_down_as_its_damper_states(load: Callable[..., tuple[Scene, str]]) -> None:
    """A wheel whose centre of mass is a little off swings out: the envelope decays with b / 2 I."""
    scene, _ = load(
        '<body name="w" euler="0 0.3 0"><joint name="spin" axis="0 1 0" damping="0.01"/>'
        '<inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.01"/></body>'
    )
    sim = ligature.Simulation(scene)
    about, peaks, last, before = 0.02, [], 0.0, 0.0
    for _ in range(3500):
        sim.step()
        R = rpy_matrix(*matrix_rpy(pose7_matrix(sim.bodies["w"].pose)[:3, :3]))
        angle = np.arctan2(R[0, 2], R[0, 0])
        if before < last > angle and last > 0.0:
            peaks.append(last)
        before, last = last, angle
    decay = np.log(peaks[0] / peaks[3]) / 3.0
    frequency = np.sqrt(9.81 * 0.1 / about - (0.01 / (2 * about)) ** 2)
    assert decay == pytest.approx(0.01 / (2 * about) * 2 * np.pi / frequency, rel=0.03)


def test_a_double_pendulum_on_a_cart_falls_as_in_mujoco(load: Callable[..., tuple[Scene, str]]) -> None:
    rod = '<geom type="capsule" fromto="0 0 0 0.1 0 -0.4" size="0.02" contype="0" conaffinity="0"/>'
    world = f"""<body name="cart" pos="0 0 1"><joint name="x" type="slide" axis="1 0 0"/>
      <geom type="box" size="0.1 0.05 0.05" contype="0" conaffinity="0"/>
      <body name="upper" euler="0 -0.9 0.2"><joint name="a" axis="0 1 0"/>{rod}
        <body name="lower" pos="0.1 0 -0.4" euler="0.5 0 0"><joint name="b" axis="1 0 0"/>{rod}</body></body></body>"""
    scene, _ = load(world)
    sim = ligature.Simulation(scene)
    model = mujoco.MjModel.from_xml_string(f"{HEAD}<worldbody>{world}</worldbody></mujoco>")
    model.opt.timestep, model.opt.integrator = 1e-4, mujoco.mjtIntegrator.mjINT_RK4
    data = mujoco.MjData(model)
    for _ in range(10):
        sim.step(40)
        mujoco.mj_step(model, data, 400)
        for name in ("cart", "upper", "lower"):
            T = pose7_matrix(sim.bodies[name].pose)
            np.testing.assert_allclose(T[:3, 3], data.body(name).xpos, atol=4e-3)
            np.testing.assert_allclose(T[:3, :3], data.body(name).xmat.reshape(3, 3), atol=0.03)
    assert np.abs(data.qpos).max() > 1.0  # it has gone far


def test_every_geom_becomes_a_shape_of_its_size(load: Callable[..., tuple[Scene, str]]) -> None:
    scene, output = load(
        """<geom name="floor" type="plane" size="1 1 .1" pos="0 0 -1"/>
        <body name="b" pos="0 0 1"><freejoint/><geom type="box" size="0.1 0.2 0.3" pos="0.5 0 0" rgba="1 0 0 1"/><geom type="sphere" size="0.1"/>
        <geom type="cylinder" size="0.1 0.2" pos="0 1 0"/><geom type="capsule" size="0.1 0.2" pos="0 2 0"/></body>
        <body name="drop" pos="0 0 -0.5"><freejoint/><geom type="sphere" size="0.1"/></body>"""
    )
    assert "3 bodies, 0 joints" in output
    body = next(b for b in scene.bodies if b.identity.key == "BODY b")
    shapes = {type(c.shape).__name__: (c.shape, c.T_body_shape[:3, 3]) for c in body.colliders}
    np.testing.assert_allclose(shapes["Box"][0].size, [0.2, 0.4, 0.6])
    assert shapes["Sphere"][0].radius == 0.1
    assert (shapes["Cylinder"][0].radius, shapes["Cylinder"][0].height) == (0.1, 0.4)
    assert (shapes["Capsule"][0].radius, shapes["Capsule"][0].height) == pytest.approx((0.1, 0.6))  # with both caps
    for y, name in enumerate(("Sphere", "Cylinder", "Capsule")):
        np.testing.assert_allclose(shapes[name][1], [0, y, 0], atol=1e-12)
    assert "note" not in output
    sim = ligature.Simulation(scene)
    sim.step(1500)
    assert sim.bodies["drop"].pose[2] == pytest.approx(-0.9, abs=2e-3)  # it lies on the floor


def test_meshes_are_written_in_the_bodys_frame_and_collide_as_hulls(
    tmp_path: Path, load: Callable[..., tuple[Scene, str]]
) -> None:
    (tmp_path / "wedge.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 2 0\nv 0 0 3\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n")
    scene, _ = load(
        '<body name="b"><freejoint/><geom type="mesh" mesh="wedge" pos="1 0 0"/><geom type="box" size=".1 .1 .1"/></body>',
        '<asset><mesh name="wedge" file="wedge.obj" scale="0.1 0.1 0.1"/></asset>',
    )
    body = next(b for b in scene.bodies if b.identity.key == "BODY b")
    solid = np.array([(1, 0, 0), (1.1, 0, 0), (1, 0.2, 0), (1, 0, 0.3)])
    vertices = load_mesh(tmp_path / "out" / "low_res" / "b_collision.OBJ", Resolver([tmp_path])).parts[0].vertices
    np.testing.assert_allclose(sorted(map(tuple, vertices)), sorted(map(tuple, solid)), atol=1e-6)
    assert len(body.colliders) == 2 and body.visual.mesh is not None
    volume = 0.1 * 0.2 * 0.3 / 6.0 + 0.2**3
    assert body.mass == pytest.approx(1000.0 * volume, rel=1e-5)


def test_bodies_fixed_to_the_world_stand_still_and_massless_ones_give_their_geoms(
    load: Callable[..., tuple[Scene, str]],
) -> None:
    scene, output = load(
        f"""<body name="table" pos="0 0 0.5"><geom type="box" size="1 1 .1"/></body>
        <body name="p" pos="0 0 2"><freejoint/>{BALL}<body name="mark" pos="0.3 0 0"><geom type="box" size=".01 .01 .01" mass="0"/></body></body>
        <body name="ghost"><freejoint/><geom type="sphere" size="0.1" contype="0" conaffinity="0"/><site name="tip"/></body>""",
        '<keyframe><key name="home"/></keyframe>',
    )
    bodies = {b.identity.key: b for b in scene.bodies}
    assert bodies["BODY table"].static and set(bodies) == {"BODY table", "BODY p", "BODY ghost"}
    assert len(bodies["BODY p"].colliders) == 2 and not bodies["BODY ghost"].colliders
    for note in (
        "body 'mark' has no mass; its geoms are part of 'p'",
        "sites are left out: 'tip'",
        "keyframes are left out: 'home'",
    ):
        assert note in output


def test_contact_masks_become_collision_groups_where_they_can() -> None:
    geom = '<geom type="sphere" size="0.1" contype="{0}" conaffinity="{0}"/>'
    result = converted(
        "".join(f'<body name="b{m}" pos="{m} 0 0"><freejoint/>{geom.format(m)}</body>' for m in (1, 2, 3))
    )
    groups = {m: values(result, "body", f"b{m}")["collision groups"] for m in (1, 2, 3)}
    assert groups == {1: (0,), 2: (1,), 3: (0, 1)} and not result.notes
    result = converted(f'<body name="a"><freejoint/>{geom.format(1)}{geom.format(2)}</body>')
    assert result.notes == [
        "contype and conaffinity differ in a way that collision groups cannot express; everything collides"
    ]


def test_a_file_that_is_no_mjcf_is_reported(tmp_path: Path) -> None:
    (tmp_path / "m.xml").write_text(f"{HEAD}<worldbody><geom type='cube'/></worldbody></mujoco>")
    done = CliRunner().invoke(app, ["convert", str(tmp_path / "m.xml"), "-o", str(tmp_path / "m.yaml")])
    assert done.exit_code == 1 and "this is not an MJCF that can be read" in done.output
    assert not (tmp_path / "m.yaml").exists()


def test_without_mujoco_it_is_reported_how_to_get_it(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "m.xml").write_text(f"{HEAD}<worldbody/></mujoco>")
    monkeypatch.setitem(sys.modules, "mujoco", None)
    done = CliRunner().invoke(app, ["convert", str(tmp_path / "m.xml"), "-o", str(tmp_path / "m.yaml")])
    assert done.exit_code == 1 and "run: pip install 'ligature-sim[convert]'" in done.output


MODELS = sorted((Path(gymnasium.__file__).parent / "envs" / "mujoco" / "assets").glob("*.xml"))


@pytest.mark.parametrize("file", MODELS, ids=lambda path: path.stem)
def test_models_of_a_learning_library_stand_as_in_mujoco(file: Path, tmp_path: Path) -> None:
    done = CliRunner().invoke(app, ["convert", str(file), "-o", str(tmp_path / "m.yaml")])
    assert done.exit_code == 0, done.output
    scene = ligature.load(tmp_path / "m.yaml")
    assert not [str(d) for d in scene.diagnostics if d.severity >= 2]
    model = mujoco.MjModel.from_xml_path(str(file))
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    bodies = {b.identity.key.removeprefix("BODY "): b for b in scene.bodies}
    assert len(bodies) > 1
    for name, body in bodies.items():
        if name.startswith("plane "):
            continue
        index = model.body(name).id if not name.startswith("body_") else int(name.removeprefix("body_"))
        np.testing.assert_allclose(body.T_world_body[:3, 3], data.xpos[index], atol=1e-9)
        np.testing.assert_allclose(body.T_world_body[:3, :3].ravel(), data.xmat[index], atol=1e-9)
        assert body.static or body.mass == pytest.approx(model.body_mass[index], rel=1e-6)
    joined = sum(int(n > 0) for n in model.body_jntnum) - int((model.jnt_type == 0).sum())
    assert len(scene.joints) >= joined
