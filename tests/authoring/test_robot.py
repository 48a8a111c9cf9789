"""Robots of URDF and SDF: random ones against other readers and engines, both ways; bad files are rejected with a reason."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from xml.sax.saxutils import quoteattr

import ligature
import numpy as np
import pybullet
import pytest
import yourdfpy
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.adf import Document, Resolver, read_any
from ligature.adf.frames import axis_rotation, frame, inverse, pose7_matrix
from ligature.adf.update import new_text
from ligature.authoring.placement import JointKeys, matrix_of, moved_child_pose
from ligature.authoring.robot import (
    Joint,
    Link,
    PlacedShape,
    Robot,
    RobotError,
    exported,
    read_sdf,
    read_urdf,
    sdf_text,
    to_adf,
    urdf_text,
)
from ligature.authoring.save import checked_text
from ligature.authoring.shapes import Shape
from ligature.cli.main import app
from ligature.mesh.inertia import box_properties
from ligature.mesh.load import load_mesh
from typer.testing import CliRunner

ROOT = Path(__file__).resolve().parent.parent.parent
SEEDS = st.integers(0, 2**32 - 1)
KINDS = ("revolute", "continuous", "prismatic", "fixed")


def pose(rng: np.random.Generator) -> np.ndarray:
    axis = rng.normal(size=3)
    return frame(axis_rotation(axis / np.linalg.norm(axis), rng.uniform(-3.0, 3.0)), rng.uniform(-0.5, 0.5, 3))


def random_robot(seed: int, base_still: bool = True) -> Robot:
    """A tree of 2 to 7 links, every frame, axis, inertia and shape at random; the first link may be without mass."""
    rng = np.random.default_rng(seed)
    links, joints = [], []
    for n in range(rng.integers(2, 8)):
        solid = box_properties(rng.uniform(0.02, 0.3, 3), rng.uniform(500.0, 3000.0)).placed(pose(rng))
        shapes = [
            Shape("BOX", size=tuple(rng.uniform(0.01, 0.2, 3))),
            Shape("SPHERE", radius=rng.uniform(0.01, 0.1)),
            Shape("CYLINDER", radius=rng.uniform(0.01, 0.1), height=rng.uniform(0.02, 0.3)),
        ]
        looks = tuple(PlacedShape(pose(rng), shapes[i]) for i in rng.integers(0, 3, rng.integers(0, 3)))
        T = np.eye(4) if n == 0 else pose(rng)
        links.append(Link(f"link{n}", T, None if n == 0 and base_still else solid, looks, looks))
        if n:
            kind = KINDS[rng.integers(0, 4)]
            axis = rng.normal(size=3)
            low = -rng.uniform(0.0, 1.5)
            limits = (low, low + rng.uniform(0.1, 3.0)) if kind in ("revolute", "prismatic") else (None, None)
            parent = f"link{rng.integers(0, n)}"
            joints.append(Joint(f"joint{n}", kind, parent, f"link{n}", pose(rng), axis / np.linalg.norm(axis), *limits))
    return Robot("robot", tuple(links), tuple(joints))


def as_model(robot: Robot, folder: Path) -> Document:
    """The robot as a model file, read again."""
    done = to_adf(robot, folder)
    file = folder / "robot.yaml"
    file.write_bytes(checked_text(new_text("model", {"namespace": "/r/"}, done.parts.items), file))
    document = read_any(file, Resolver([folder]))
    assert document.ok, document.diagnostics
    return document


def positions_of(robot: Robot, rng: np.random.Generator) -> dict[str, float]:
    """A position of every joint, within its limits."""
    found = {}
    for joint in robot.joints:
        if joint.kind != "fixed":
            low, high = (-2.0, 2.0) if joint.lower is None or joint.upper is None else (joint.lower, joint.upper)
            found[joint.name] = rng.uniform(low, high)
    return found


def model_poses(document: Document, positions: dict[str, float]) -> dict[str, np.ndarray]:
    """Where the bodies of a model are at joint positions, by the rules of the format; parents come first."""
    bodies = {body.key: body for body in document.elements("bodies")}
    inertial = {key: matrix_of(body.pose("inertial offset")) for key, body in bodies.items()}
    T = {key: matrix_of(body.pose("location")) for key, body in bodies.items()}
    for joint in document.elements("joints"):
        parent, child = joint.text("parent"), joint.text("child")
        keys = JointKeys(
            *(joint.vector(n) for n in ("parent pivot", "child pivot", "parent axis", "child axis")),
            joint.number("offset"), joint.number("joint offset"),
        )  # fmt: skip
        along = joint.text("type") == "prismatic"
        moved = moved_child_pose(keys, positions.get(joint.text("name"), 0.0), inertial[parent], inertial[child], along)
        T[child] = T[parent] @ moved
    return {bodies[key].text("name"): pose for key, pose in T.items()}


def near(actual: np.ndarray, expected: np.ndarray, size: float = 1e-6) -> None:
    np.testing.assert_allclose(actual, expected, atol=size)


@settings(max_examples=25)
@given(SEEDS)
def test_a_model_of_any_urdf_moves_as_another_reader_finds_its_links(
    tmp_path_factory: pytest.TempPathFactory, seed: int
) -> None:
    folder = tmp_path_factory.mktemp("robot")
    robot = random_robot(seed)
    file = folder / "robot.urdf"
    file.write_text(urdf_text(robot)[0])
    read = read_urdf(file)
    document = as_model(read, folder)
    positions = positions_of(read, np.random.default_rng(seed))
    theirs = yourdfpy.URDF.load(str(file), load_meshes=False)
    theirs.update_cfg(positions)
    for name, T in model_poses(document, positions).items():
        near(T, theirs.get_transform(name, "link0"))
    for link, body in zip(read.links, document.elements("bodies"), strict=True):
        inertial = theirs.link_map[link.name].inertial
        assert body.number("mass") == pytest.approx(inertial.mass if inertial else 0.0)


@settings(max_examples=25)
@given(SEEDS, st.sampled_from(["urdf", "sdf"]))
def test_a_robot_comes_back_from_the_file_that_it_is_written_as(
    tmp_path_factory: pytest.TempPathFactory, seed: int, kind: str
) -> None:
    """Where the joints are, how they turn, and where mass and shapes are in the world; URDF chooses frames of its own."""
    robot = random_robot(seed)
    file = tmp_path_factory.mktemp("robot") / f"robot.{kind}"
    file.write_text((urdf_text if kind == "urdf" else sdf_text)(robot)[0])
    back = (read_urdf if kind == "urdf" else read_sdf)(file)
    for one, two in zip(robot.links, back.links, strict=True):
        assert one.name == two.name and (one.solid is None) == (two.solid is None)
        if one.solid is not None and two.solid is not None:
            before, after = one.solid.placed(one.T), two.solid.placed(two.T)
            assert after.mass == pytest.approx(before.mass)
            near(after.centre, before.centre)
            near(after.inertia, before.inertia)
        for first, second in zip(one.visuals, two.visuals, strict=True):
            near(two.T @ second.T_link, one.T @ first.T_link)
            assert second.shape == first.shape
    joints = {joint.name: joint for joint in back.joints}
    for joint in robot.joints:
        other = joints[joint.name]
        near(other.T[:3, 3], joint.T[:3, 3])
        assert (other.parent, other.child, other.kind) == (joint.parent, joint.child, joint.kind)
        if joint.kind != "fixed":
            near(other.T[:3, :3] @ other.axis, joint.T[:3, :3] @ joint.axis)
            assert (other.lower, other.upper) == pytest.approx((joint.lower, joint.upper))


@pytest.fixture
def bullet() -> int:
    client = pybullet.connect(pybullet.DIRECT)
    yield client
    pybullet.disconnect(client)


@pytest.mark.parametrize("seed", range(8))
def test_bullet_loads_a_model_as_urdf_and_moves_it_alike(tmp_path: Path, bullet: int, seed: int) -> None:
    robot = random_robot(seed)
    document = as_model(robot, tmp_path)
    done = exported(document, Resolver([tmp_path]), "robot")
    file = tmp_path / "out.urdf"
    file.write_text(urdf_text(done.robot)[0])
    body = pybullet.loadURDF(
        str(file), useFixedBase=True, flags=pybullet.URDF_USE_INERTIA_FROM_FILE, physicsClientId=bullet
    )
    positions = positions_of(robot, np.random.default_rng(seed))
    links = {}
    for index in range(pybullet.getNumJoints(body, physicsClientId=bullet)):
        found = pybullet.getJointInfo(body, index, physicsClientId=bullet)
        links[found[12].decode()] = index
        if found[1].decode() in positions:
            pybullet.resetJointState(body, index, positions[found[1].decode()], physicsClientId=bullet)
    expected = model_poses(document, positions)
    for element in document.elements("bodies")[1:]:
        name = element.text("name")
        state = pybullet.getLinkState(body, links[name], computeForwardKinematics=True, physicsClientId=bullet)
        centre = expected[name] @ matrix_of(element.pose("inertial offset"))
        near(pose7_matrix([*state[0], *state[1]])[:3, 3], centre[:3, 3], 1e-5)
        mass = pybullet.getDynamicsInfo(body, links[name], physicsClientId=bullet)[0]
        assert mass == pytest.approx(element.number("mass"), rel=1e-6)


@pytest.mark.parametrize("kind", ["urdf", "sdf"])
def test_a_real_scene_becomes_a_robot_and_what_is_lost_is_reported(tmp_path: Path, kind: str) -> None:
    source = ROOT / "scenes" / "suturing_small"
    model = next(f for f in sorted(source.glob("*.yaml")) if "joints:" in f.read_text())
    out = tmp_path / f"robot.{kind}"
    done = CliRunner().invoke(app, ["convert", str(model), "-o", str(out)])
    assert done.exit_code == 0, done.output
    document = read_any(model, Resolver.for_file(model))
    robot = (read_urdf if kind == "urdf" else read_sdf)(out)
    bodies = {body.text("name").replace(" ", "_"): body for body in document.elements("bodies")}
    assert set(bodies) == {link.name for link in robot.links} - {"world"}
    for link in robot.links:
        if link.name in bodies:
            assert (link.solid.mass if link.solid else 0.0) == pytest.approx(bodies[link.name].number("mass"))
        for look in (*link.visuals, *link.collisions):
            if hasattr(look.shape, "name"):
                assert (tmp_path / look.shape.name).is_file()
    kept = [j for j in document.elements("joints") if j.text("type") in ("revolute", "prismatic", "fixed")]
    assert {j.name for j in robot.joints} >= {j.text("name").replace(" ", "_") for j in kept}
    for joint in document.elements("joints"):
        if joint not in kept:
            assert f"joint '{joint.text('name').replace(' ', '_')}'" in done.output


def test_joints_that_start_away_from_zero_are_written_at_zero(tmp_path: Path) -> None:
    """The format holds where bodies start and where a joint's zero is apart; URDF has the zero alone."""
    file = tmp_path / "m.yaml"
    file.write_text(
        "bodies: [BODY a, BODY b]\njoints: [JOINT j]\n"
        "BODY a: {name: a, mass: 1.0, inertia: {ix: 1, iy: 1, iz: 1}}\n"
        "BODY b: {name: b, mass: 1.0, inertia: {ix: 1, iy: 1, iz: 1},\n"
        "  location: {position: {x: 0, y: 1, z: 0}, orientation: {r: 0, p: 0, y: 1.5707963267948966}}}\n"
        "JOINT j: {name: j, type: revolute, parent: BODY a, child: BODY b, parent pivot: {x: 0, y: 0, z: 0},\n"
        "  child pivot: {x: -1, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1},\n"
        "  joint limits: {low: -1, high: 2}}\n"
    )
    robot = exported(read_any(file, Resolver([tmp_path])), Resolver([tmp_path]), "m").robot
    near(robot.links[1].T, frame(np.eye(3), (1.0, 0.0, 0.0)))
    near(robot.joints[0].T[:3, 3], np.zeros(3))
    assert (robot.joints[0].lower, robot.joints[0].upper) == (-1.0, 2.0)


@settings(max_examples=25)
@given(SEEDS)
def test_links_without_mass_hold_no_robot_still(tmp_path_factory: pytest.TempPathFactory, seed: int) -> None:
    """Frames such as ``tool0`` have none: as static bodies they would fix all that carries them."""
    folder = tmp_path_factory.mktemp("robot")
    robot = random_robot(seed)
    rng = np.random.default_rng(seed)
    links = tuple(
        replace(link, solid=None if rng.random() < 0.5 else link.solid, visuals=looks, collisions=looks)
        for link, looks in ((link, link.visuals if rng.random() < 0.5 else ()) for link in robot.links)
    )
    (folder / "robot.urdf").write_text(urdf_text(replace(robot, links=links))[0])
    read = read_urdf(folder / "robot.urdf")
    done = to_adf(read, folder)
    bodies = {body.text("name"): body for body in as_model(read, folder).elements("bodies")}
    carried = {joint.child for joint in read.joints}
    for link in read.links:
        assert (bodies[link.name].number("mass") > 0.0) == (link.name in carried or link.solid is not None), link.name
        reported = any(note.startswith(f"link '{link.name}' has no mass") for note in done.notes)
        assert reported == (link.solid is None)
    scene = ligature.load(folder / "robot.yaml")
    assert not scene.loops and len(scene.articulations) == len(read.links) - len(carried)


@pytest.mark.parametrize(
    ("limit", "expected"),
    [
        ('lower="-1"', (-1.0, 0.0)), ('upper="2"', (0.0, 2.0)), ('lower="-1" upper="2"', (-1.0, 2.0)),
        ("", (None, None)),
    ],
)  # fmt: skip
def test_a_limit_that_urdf_leaves_out_is_zero(tmp_path: Path, limit: str, expected: tuple[float | None, ...]) -> None:
    (tmp_path / "r.urdf").write_text(
        f'<robot name="r">{LINKS}<joint name="j" type="revolute"><parent link="a"/><child link="b"/>'
        f'<limit {limit} effort="1" velocity="1"/></joint></robot>'
    )
    (joint,) = read_urdf(tmp_path / "r.urdf").joints
    assert (joint.lower, joint.upper) == expected


ODD = st.text("ab/._\\ \u624b", min_size=1, max_size=4).map(lambda text: text.replace("b", "_collision")) | st.sampled_from(
    ["/abs/olute", "../../up", "x" * 300, ".hidden", "a", "a_2", "a_collision"]
)  # fmt: skip
"""Names of links and bodies."""


@settings(max_examples=12)
@given(names=st.lists(ODD, min_size=1, max_size=5, unique_by=str.strip))
def test_links_of_any_name_have_meshes_of_their_own_beside_the_model(names: list[str]) -> None:
    """Each has another number of triangles to look at, and to collide by: written, read back, and turned into URDF."""
    with TemporaryDirectory() as place:
        folder = Path(place, "in", "out")
        folder.mkdir(parents=True)
        links = []
        for number, name in enumerate(names):
            for kind, faces in (("visual", 2 * number + 1), ("collision", 2 * number + 2)):
                text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\n" + "f 1 2 3\nf 1 2 4\n" * faces
                (folder / f"{kind}{number}.obj").write_text(text)
            parts = (
                f'<{kind}><geometry><mesh filename="{kind}{number}.obj"/></geometry></{kind}>'
                for kind in ("visual", "collision")
            )
            links.append(f"<link name={quoteattr(name)}>{''.join(parts)}</link>")
        (folder / "r.urdf").write_text(f"<robot name='r'>{''.join(links)}</robot>", "utf-8")
        written = folder / "made"
        done = CliRunner().invoke(app, ["convert", str(folder / "r.urdf"), "-o", str(written / "m.yaml")])
        assert done.exit_code == 0, done.output
        assert {path.name for path in Path(place).rglob("*")} - {path.name for path in written.rglob("*")} == {
            "in", "out", "made", "r.urdf", *(f"{k}{n}.obj" for n in range(len(names)) for k in ("visual", "collision")),
        }  # fmt: skip
        scene = ligature.load(written / "m.yaml")
        drawn = [body.visual.mesh for body in scene.bodies]
        shown = [sum(len(part.faces) for part in load_mesh(path, Resolver([written])).parts) for path in drawn if path]
        assert shown == [2 * (2 * number + 1) for number in range(len(names))]
        back = exported(read_any(written / "m.yaml", Resolver([written])), Resolver([written]), "m")
        files = [look.shape.name for link in back.robot.links for look in (*link.visuals, *link.collisions)]
        assert len(set(files)) == len(files) == 2 * len(names)
        assert all(Path(file).parent == Path("meshes") and file in back.files for file in files)


LINKS = '<link name="a"/><link name="b"/>'


@pytest.mark.parametrize(
    ("name", "content", "words"),
    [
        ("r.urdf", "<sdf/>", "the outermost element is <sdf>, not <robot>"),
        ("r.urdf", f'<robot>{LINKS}<link name="a"/></robot>', "two links have the same name"),
        ("r.urdf", f'<robot>{LINKS}<joint name="j" type="fixed"><parent link="a"/><child link="c"/></joint></robot>',
         "<joint name='j'>: its child is 'c', which is not a link"),
        ("r.urdf", '<robot><link name="a"><visual><origin xyz="0 nan 0"/><geometry><sphere radius="1"/></geometry></visual>'
         "</link></robot>", "<origin>: 'xyz' is '0 nan 0'; give 3 finite numbers"),
        ("r.urdf", '<robot><link name="a"><visual><geometry><sphere radius="-1"/></geometry></visual></link></robot>',
         "<sphere>: 'radius' is -1; give metres above 0"),
        ("r.urdf", f'<robot>{LINKS}<joint name="j" type="revolute"><parent link="a"/><child link="b"/><axis xyz="0 0 0"/>'
         "</joint></robot>", "<joint name='j'>: the axis has no direction"),
        ("r.sdf", "<sdf/>", "the file has no <model>"),
        ("r.sdf", '<sdf><model name="m"><link name="a"><pose relative_to="a">0 0 0 0 0 0</pose></link></model></sdf>',
         "the frame 'a' is stated relative to itself"),
        ("r.sdf", '<sdf><model name="m"><link name="a"><pose relative_to="z">0 0 0 0 0 0</pose></link></model></sdf>',
         "there is no frame 'z'"),
        ("r.sdf", '<sdf><model name="m"><link name="a"/><joint name="j" type="fixed"><parent>a</parent><child>q</child>'
         "</joint></model></sdf>", "its child is 'q', which is not a link of the model"),
    ],
)  # fmt: skip
def test_a_file_that_is_no_robot_is_rejected_with_a_reason(tmp_path: Path, name: str, content: str, words: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(RobotError) as refused:
        (read_urdf if name.endswith("urdf") else read_sdf)(tmp_path / name)
    assert words in str(refused.value)
    done = CliRunner().invoke(app, ["convert", str(tmp_path / name), "-o", str(tmp_path / "r.yaml")])
    assert done.exit_code == 1 and words in done.output and not (tmp_path / "r.yaml").exists()


@pytest.mark.parametrize("kind", ["fixed", "floating"])
def test_a_joint_without_an_axis_may_state_any(tmp_path: Path, kind: str) -> None:
    """Exporters of CAD programs write an axis of zeros."""
    joint = f'<joint name="j" type="{kind}"><parent link="a"/><child link="b"/><axis xyz="0 0 0"/></joint>'
    (tmp_path / "r.urdf").write_text(f"<robot>{LINKS}{joint}</robot>")
    assert [j.kind for j in read_urdf(tmp_path / "r.urdf").joints] == [kind]


def test_frames_of_sdf_are_followed_whatever_they_are_stated_in(tmp_path: Path) -> None:
    (tmp_path / "r.sdf").write_text(
        '<sdf version="1.7"><model name="m"><pose>1 0 0 0 0 0</pose>'
        '<frame name="f" attached_to="a"><pose>0 0 2 0 0 1.5707963267948966</pose></frame>'
        '<link name="a"><pose>0 1 0 0 0 0</pose></link><link name="b"><pose relative_to="f">3 0 0 0 0 0</pose></link>'
        '<joint name="j" type="revolute"><parent>a</parent><child>b</child><pose relative_to="a">0 0 5 0 0 0</pose>'
        '<axis><xyz expressed_in="f">1 0 0</xyz></axis></joint></model></sdf>'
    )
    robot = read_sdf(tmp_path / "r.sdf")
    near(robot.links[1].T[:3, 3], np.array([1.0, 4.0, 2.0]))
    joint = robot.joints[0]
    near(joint.T[:3, 3], np.array([1.0, 1.0, 5.0]))
    near(joint.T[:3, :3] @ joint.axis, np.array([0.0, 1.0, 0.0]))
    near(inverse(robot.links[0].T) @ joint.T, frame(np.eye(3), (0.0, 0.0, 5.0)))
