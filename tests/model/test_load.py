"""From files to scenes: references, parents, trees, rods, and what is stated when something is missing."""

from __future__ import annotations

import struct
from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.adf import Severity
from ligature.adf.schema import MOST_RAYS
from ligature.model.scene import JointType, Scene

LAUNCH = "world config: world.yaml\ncolor config: c.yaml\ninput devices config: d.yaml\nmultibody configs: [{models}]\n"
WORLD = "namespace: /ambf/env/\ngravity: {x: 0, y: 0, z: -9.8}\n"
AXES = (
    "parent pivot: {x: 0, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}, "
    "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}"
)


@pytest.fixture
def lab(tmp_path: Path):
    def load(**files: str) -> Scene:
        (tmp_path / "world.yaml").write_text(WORLD)
        (tmp_path / "d.yaml").write_text("input devices: []\n")
        (tmp_path / "c.yaml").write_text("")
        names = []
        for name, text in files.items():
            (tmp_path / f"{name}.yaml").write_text(text)
            names.append(f"{name}.yaml")
        (tmp_path / "launch.yaml").write_text(LAUNCH.replace("{models}", ", ".join(names)))
        return ligature.load(tmp_path / "launch.yaml")

    return load


def reported(scene: Scene, least: Severity = Severity.WARNING) -> str:
    return "\n".join(str(d) for d in scene.diagnostics if d.severity >= least)


def bodies(*names: str, extra: str = "") -> str:
    text = f"bodies: [{', '.join(f'BODY {n}' for n in names)}]\nnamespace: /ambf/env/\n"
    return text + "".join(f"BODY {n}: {{name: {n}, mass: 1, {extra} location: {{}}}}\n" for n in names)


def test_names_lose_their_blanks_and_keys_keep_them(lab) -> None:
    scene = lab(
        m="bodies: [BODY tool yaw]\nnamespace: /ambf/env/psm1/\nBODY tool yaw: {name: tool yaw link, mass: 1}\n"
    )
    identity = scene.bodies[0].identity
    assert identity.topic == "/ambf/env/psm1/toolyawlink"
    assert identity.identifier == "/ambf/env/psm1/BODY tool yaw"


def test_a_body_listed_twice_becomes_two_with_their_own_topics(lab) -> None:
    scene = lab(m=bodies("a").replace("[BODY a]", "[BODY a, BODY a]"))
    assert [b.identity.identifier for b in scene.bodies] == ["/ambf/env/BODY a", "/ambf/env/BODY a1"]
    assert [b.identity.topic for b in scene.bodies] == ["/ambf/env/a", "/ambf/env/a1"]


def test_gravity_is_the_bodys_else_the_files_else_the_worlds(lab) -> None:
    own = bodies("a", extra="gravity: {x: 1, y: 0, z: 0},")
    scene = lab(
        one=own + "gravity: {x: 0, y: 0, z: 0}\n", two=bodies("b") + "gravity: {x: 0, y: 2, z: 0}\n", three=bodies("c")
    )
    assert [b.gravity.tolist() for b in scene.bodies] == [[1, 0, 0], [0, 2, 0], [0, 0, -9.8]]


def test_without_mass_the_inertial_block_has_no_effect_and_that_is_stated(lab) -> None:
    text = "bodies: [BODY a]\nBODY a: {name: a, inertia: {ix: 5, iy: 5, iz: 5}, collision shape: SPHERE, collision geometry: {radius: 1}}\n"
    scene = lab(m=text)
    assert scene.bodies[0].mass == 1.0
    assert np.allclose(scene.bodies[0].inertia, 2 / 3)
    assert "has no 'mass'; using 1 kg, and its inertia has no effect" in reported(scene)


def test_a_joint_finds_its_body_in_the_file_before_the_world(lab) -> None:
    joint = f"joints: [J]\nJ: {{name: j, type: revolute, parent: BODY a, child: BODY b, {AXES}}}\n"
    scene = lab(one=bodies("a", "b").replace("/ambf/env/", "/ambf/one/"), two=bodies("a", "b") + joint)
    assert [scene.bodies[i].identity.identifier for i in (scene.joints[0].parent, scene.joints[0].child)] == [
        "/ambf/env/BODY a", "/ambf/env/BODY b",
    ]  # fmt: skip


def test_an_exact_name_in_the_namespace_beats_forty_parts(lab) -> None:
    names = ["Thread", "Thread_001", "Thread_002"]
    joint = f"joints: [J]\nJ: {{name: j, type: fixed, parent: BODY Thread, child: BODY Thread_001, {AXES}}}\n"
    scene = lab(m=bodies(*names) + joint)
    assert (scene.joints[0].parent, scene.joints[0].child) == (0, 1)


def test_an_ambiguous_parent_is_reported_with_its_candidates(lab) -> None:
    joint = f"joints: [J]\nJ: {{name: j, type: fixed, parent: Thr, child: BODY b, {AXES}}}\n"
    scene = lab(m=bodies("Thr1", "Thr2", "b") + joint)
    assert scene.joints == ()
    assert (
        "joint 'J' is left out: its parent 'Thr' is ambiguous (/ambf/env/BODY Thr1, /ambf/env/BODY Thr2); "
        "write one of these in full"
    ) in reported(scene)


def test_of_many_candidates_three_are_named_once(lab) -> None:
    sensor = "sensors: [S]\nS: {name: s, type: Contact, parent: Thr}\n"
    scene = lab(m=bodies(*(f"Thr{i}" for i in range(9))) + sensor)
    names = ", ".join(f"/ambf/env/BODY Thr{i}" for i in range(3))
    assert f"its parent 'Thr' is ambiguous ({names}, …); write one of these in full" in reported(scene)


@pytest.mark.parametrize("kind", ["sensors", "actuators", "joints"])
@pytest.mark.parametrize("start", [0, 1, 9, 10, 11, 14, 15, 16, 17])
def test_a_part_of_a_name_is_reported_with_the_body_that_it_stands_for(lab, kind: str, start: int) -> None:
    whole = "/ambf/env/BODY Base"
    content = {
        "sensors": "type: Contact", "actuators": "type: Constraint", "joints": f"type: fixed, child: BODY tip, {AXES}",
    }[kind]  # fmt: skip
    for end in (len(whole), len(whole) - 1):
        text = whole[start:end]
        if not text or whole.count(text) != 1 or text in "/ambf/env/BODY tip":
            continue
        scene = lab(m=bodies("Base", "tip") + f"{kind}: [X]\nX: {{name: x, parent: '{text}', {content}}}\n")
        (made,) = getattr(scene, kind)
        assert made.parent == 0
        warned = f"parent '{text}' of {kind[:-1]} 'X' is incomplete; using '{whole}'" in reported(scene, Severity.INFO)
        assert warned == (not text.endswith("BODY Base"))


def test_a_chain_commands_its_joints_from_base_to_tip(lab) -> None:
    joints = "joints: [J1, J2, J3]\n" + "".join(
        f"J{i}: {{name: j{i}, type: revolute, parent: BODY {p}, child: BODY {c}, passive: {passive}, {AXES}}}\n"
        for i, (p, c, passive) in enumerate([("a", "b", "false"), ("b", "c", "true"), ("c", "d", "false")], 1)
    )
    scene = lab(m=bodies("a", "b", "c", "d") + joints)
    assert [scene.joints[j].identity.name for j in scene.bodies[0].joints] == ["j1", "j3"]
    assert scene.bodies[1].joints == (2,)
    assert len(scene.articulations) == 1 and [link.body for link in scene.articulations[0].links] == [0, 1, 2, 3]


def test_a_four_bar_linkage_has_one_loop(lab) -> None:
    pairs = [("a", "b"), ("b", "c"), ("c", "d"), ("d", "a")]
    joints = "joints: [J0, J1, J2, J3]\n" + "".join(
        f"J{i}: {{name: j{i}, type: revolute, parent: BODY {p}, child: BODY {c}, {AXES}}}\n"
        for i, (p, c) in enumerate(pairs)
    )
    scene = lab(m=bodies("a", "b", "c", "d") + joints)
    assert len(scene.loops) == 1


def test_a_static_body_is_the_root_of_its_tree(lab) -> None:
    joint = f"joints: [J]\nJ: {{name: j, type: revolute, parent: BODY a, child: BODY b, {AXES}}}\n"
    text = bodies("a", "b").replace("BODY b: {name: b, mass: 1", "BODY b: {name: b, mass: 0")
    scene = lab(m=text + joint)
    assert scene.articulations[0].links[0].body == 1


def test_groups_that_share_nothing_do_not_collide(lab) -> None:
    text = bodies("a", "b", "c", "d").replace("BODY a: {", "BODY a: {collision groups: [1, 2], ")
    text = text.replace("BODY b: {", "BODY b: {collision groups: [2], ").replace(
        "BODY c: {", "BODY c: {collision groups: [3], "
    )
    scene = lab(m=text)
    assert [sorted(b.no_collision_with) for b in scene.bodies] == [[2], [2], [0, 1], []]


def test_jointed_bodies_do_not_collide_unless_asked_to(lab) -> None:
    joint = f"joints: [J]\nJ: {{name: j, type: revolute, parent: BODY a, child: BODY b, {AXES}}}\n"
    assert lab(m=bodies("a", "b") + joint).bodies[0].no_collision_with == {1}
    apart = joint.replace("name: j", "name: j, ignore inter-collision: false")
    assert lab(m=bodies("a", "b") + apart).bodies[0].no_collision_with == frozenset()


def test_a_parent_may_come_in_a_later_file(lab) -> None:
    ghost = (
        "ghost objects: [GHOST g]\nnamespace: /ambf/env/\nGHOST g: {name: g, parent: BODY late, "
        "collision shape: SPHERE, collision geometry: {radius: 0.1}}\n"
    )
    scene = lab(ghosts=ghost, later=bodies("late"))
    assert scene.ghosts[0].attachment.parent == ("body", 0)


def test_a_camera_that_hangs_on_another_resolves_although_its_own_name_holds_the_text(lab) -> None:
    text = (
        "bodies: [BODY a]\nBODY a: {name: a, mass: 1}\ncameras: [cameraL2, cameraL]\n"
        "cameraL: {name: cameraL}\ncameraL2: {name: cameraL2, parent: cameraL}\n"
    )
    scene = lab(m=text)
    assert scene.cameras[0].identity.key == "cameraL2"
    assert scene.cameras[0].attachment.parent == ("camera", 1)


def test_a_parent_that_never_comes_is_reported(lab) -> None:
    text = "bodies: [BODY a]\nBODY a: {name: a, mass: 1}\nlights: [L]\nL: {name: L, parent: BODY none}\n"
    assert "has the parent 'BODY none', which is missing or ambiguous" in reported(lab(m=text))


def test_cameras_look_along_minus_x_with_z_up(lab) -> None:
    text = (
        "bodies: [BODY a]\nBODY a: {name: a, mass: 1}\ncameras: [C]\n"
        "C: {name: C, location: {x: 0, y: 0, z: 0}, look at: {x: 0, y: 0, z: -1}, up: {x: 0, y: 1, z: 0}}\n"
    )
    from ligature.model.frames import matrix_quaternion

    T = lab(m=text).cameras[0].attachment.T_parent_object
    assert np.allclose(T[:3, :3].T, [[0, 0, 1], [1, 0, 0], [0, 1, 0]])
    assert np.allclose(matrix_quaternion(T[:3, :3]), [-0.5, -0.5, -0.5, 0.5])


def test_a_missing_mesh_leaves_the_body_out(lab) -> None:
    scene = lab(m="bodies: [BODY a, BODY b]\nBODY a: {name: a, mass: 1, mesh: no.obj}\nBODY b: {name: b, mass: 1}\n")
    assert [b.identity.key for b in scene.bodies] == ["BODY b"]
    assert "body 'BODY a': mesh 'no.obj' does not exist; looked for" in reported(scene)


def test_a_capsule_along_x_is_turned(lab) -> None:
    text = "bodies: [B]\nB: {name: b, mass: 1, collision shape: CAPSULE, collision geometry: {radius: 1, height: 4, axis: X}}\n"
    collider = lab(m=text).bodies[0].colliders[0]
    assert np.allclose(collider.T_body_shape[:3, 2], (1, 0, 0))


def test_a_file_without_bodies_cannot_run(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text("bodies: []\n")
    with pytest.raises(ligature.SceneError, match="contains no body to simulate"):
        ligature.load(tmp_path / "m.yaml")


def test_an_index_beyond_the_list_is_reported(lab, tmp_path: Path) -> None:
    lab(m=bodies("a"))
    scene = ligature.load(tmp_path / "launch.yaml", models=[0, 7])
    assert "model index 7 is out of range; 'multibody configs' lists 1, counted from 0" in reported(scene)


def chain(extra: str = "") -> str:
    names = [f"T{i}" for i in range(5)]
    text = f"bodies: [{', '.join(names)}]\njoints: [{', '.join(f'J{i}' for i in range(4))}]\nnamespace: /ambf/env/\n{extra}"
    for i, n in enumerate(names):
        text += (
            f"{n}: {{name: {n}, mass: 0.01, collision shape: CAPSULE, collision geometry: {{radius: 0.001, height: 0.01}}, "
            f"location: {{position: {{x: 0, y: 0, z: {0.01 * i}}}}}}}\n"
        )
    zero, wide = "{x: 0, y: 0, z: 0}", "{x: 1, y: 1, z: 1}"
    for i in range(4):
        text += (
            f"J{i}: {{name: j{i}, type: six dof spring, parent: T{i}, child: T{i + 1}, parent pivot: {{x: 0, y: 0, z: 0.005}}, "
            "child pivot: {x: 0, y: 0, z: -0.005}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}, "
            f"joint limits: {{linear: {{low: {zero}, high: {zero}}}, angular: {{low: {{x: -1, y: -1, z: -1}}, high: {wide}}}}}}}\n"
        )
    return text


def test_a_chain_of_sprung_capsules_is_one_rod(lab) -> None:
    scene = lab(m=chain())
    assert [rod.bodies for rod in scene.rods] == [(0, 1, 2, 3, 4)]
    assert np.allclose(scene.rods[0].lengths, 0.01)
    assert "5 bodies from '/ambf/env/T0' on are simulated as one elastic rod" in reported(scene, Severity.INFO)


@pytest.mark.parametrize("where", ["file", "body", "joint"])
def test_a_chain_can_opt_out(lab, where: str) -> None:
    text = chain("ligature rod: false\n") if where == "file" else chain()
    if where == "body":
        text = text.replace("T2: {", "T2: {ligature rod: false, ")
    if where == "joint":
        text = text.replace("J1: {", "J1: {ligature rod: false, ")
    assert lab(m=text).rods == ()


def test_six_dof_blocks_keep_their_signs(lab) -> None:
    six = lab(m=chain()).joints[0].six_dof
    assert six is not None
    assert six.low.tolist() == [0, 0, 0, -1, -1, -1] and six.high.tolist() == [0, 0, 0, 1, 1, 1]
    assert six.stiffness.tolist() == [1] * 6 and six.damping.tolist() == [0.7] * 6


def test_a_fixed_joint_ignores_limits_but_not_offsets(lab) -> None:
    joint = f"joints: [J]\nJ: {{name: j, type: fixed, offset: 0.5, joint limits: {{low: -1, high: 1}}, parent: BODY a, child: BODY b, {AXES}}}\n"
    found = lab(m=bodies("a", "b") + joint).joints[0]
    assert found.type is JointType.FIXED and found.low is None
    assert np.allclose(found.T_parent_child_zero[:2, :2], [[np.cos(0.5), -np.sin(0.5)], [np.sin(0.5), np.cos(0.5)]])


RAYS = {
    "parametric": (
        "{resolution: {count}, horizontal angle: 1, vertical angle: 1, start offset: 0}",
        "at most 256, not 257",
    ),
    "mesh": ("rays.stl", "'mesh' of sensor 'S' gives 65537 rays; at most 65536 are cast"),
}


@pytest.mark.parametrize("source", RAYS)
@pytest.mark.parametrize("beyond", [0, 1])
def test_a_sensor_has_only_so_many_rays(lab, tmp_path: Path, source: str, beyond: int) -> None:
    """Each is cast in every tick; a resolution of 100 000 would be 10 000 million."""
    value, words = RAYS[source]
    triangle = struct.pack("<12fH", 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0)
    (tmp_path / "rays.stl").write_bytes(
        bytes(80) + struct.pack("<I", MOST_RAYS + beyond) + triangle * (MOST_RAYS + beyond)
    )
    text = bodies("a") + "sensors: [S]\nS: {name: s, type: Proximity, parent: BODY a, " + f"{source}: {value}}}\n"
    scene = lab(m=text.replace("{count}", str(256 + beyond)))
    assert [len(sensor.rays) for sensor in scene.sensors] == ([] if beyond else [MOST_RAYS])
    assert (words in reported(scene, Severity.ERROR)) == bool(beyond), reported(scene)


@pytest.mark.parametrize(
    ("keys", "shape"),
    [
        ("shape: BOX, geometry: {x: 1, y: 1, z: 1}", "shape"),
        ("compound shape: [{shape: SPHERE, geometry: {radius: 1}}]", "compound shape"),
        ("shape: BOX, geometry: {x: 1, y: 1, z: 1}, collision shape: SPHERE, collision geometry: {radius: 1}", ""),
        ("shape: BOX, geometry: {x: 1, y: 1, z: 1}, ligature tissue: {youngs modulus: 1.0e+9, cell size: 0.3}", ""),
        ("friction: {static: 0.5}", ""),
    ],
)
def test_a_body_that_is_drawn_but_collides_with_nothing_is_noted(tmp_path: Path, keys: str, shape: str) -> None:
    (tmp_path / "m.yaml").write_text(f"bodies: [B]\nB: {{name: b, mass: 1, {keys}}}\n")
    found = [d for d in ligature.load(tmp_path / "m.yaml").diagnostics if "collides with nothing" in d.message]
    assert [(d.severity, f"'{shape}'" in d.message, bool(d.hint)) for d in found] == [
        (Severity.INFO, True, True)
    ] * bool(shape)
