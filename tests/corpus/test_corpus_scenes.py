"""The scenes of others: what is created, where it stands, and that joints agree with the files' locations."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
import yaml
from ligature.adf import Severity
from ligature.bus.codec import decode, encode
from ligature.bus.ring import MOST_BYTES
from ligature.model.commands import BodyCommand, CommandType
from ligature.model.frames import matrix_quaternion, pose7_matrix
from ligature.model.reach import findings, reaches
from ligature.model.scene import Joint, JointType, OutputType, Scene

from tests.physics.test_loops import gaps

SUTURING = [10, 11, 6, 7, 8, 9]


@pytest.fixture(scope="module")
def scene(corpus: Path) -> Scene:
    return ligature.load(corpus / "suturing_scene" / "launch.yaml", SUTURING)


def test_the_suturing_scene_has_all_its_objects(scene: Scene) -> None:
    assert len(scene.bodies) == 54 + 10 + 10
    assert (len(scene.joints), len(scene.ghosts), len(scene.actuators)) == (64, 12, 2)
    assert (len(scene.cameras), len(scene.lights), len(scene.rods)) == (2, 1, 1)
    assert len(scene.rods[0].bodies) == 40


def test_only_the_floor_whose_mesh_is_absent_is_missing(scene: Scene) -> None:
    errors = [d for d in scene.diagnostics if d.severity >= Severity.ERROR]
    assert len(errors) == 1 and "Plane.OBJ" in str(errors[0])


def test_needle_and_phantom_collide_as_hulls_by_material(scene: Scene) -> None:
    count = {b.identity.key: len(b.colliders) for b in scene.bodies}
    assert count["BODY Needle"] == 9 and count["BODY Phantom"] == 11
    (needle,) = scene.needles
    assert scene.bodies[needle.body].identity.name == "Needle" and needle.arc.length == pytest.approx(0.0225, rel=0.01)


def test_inertias_are_those_that_the_reference_publishes(scene: Scene, golden: Path) -> None:
    compared = 0
    for sample in sorted((golden / "samples").glob("*.yaml")):
        message = yaml.safe_load(sample.read_text().split("\n", 2)[2])
        body = next(
            (b for b in scene.bodies if b.identity.identifier == message.get("identifier", {}).get("data")), None
        )
        if body is None or "pInertia" not in message or body.identity.name.startswith("tool_id"):
            continue
        published = [message["pInertia"][axis] for axis in "xyz"]
        expected = np.zeros(3) if body.static else body.inertia
        assert np.allclose(expected, published, rtol=1e-6), body.identity.key
        compared += 1
    assert compared == 17


def test_arms_list_their_joints_in_command_order(scene: Scene) -> None:
    base = scene.bodies[scene.body_index["/ambf/env/psm1/BODY base link simple"]]
    assert [scene.joints[j].identity.name for j in base.joints] == [
        "baselink-yawlink", "yawlink-pitchbacklink", "pitchendlink-maininsertionlink", "maininsertionlink-toolrolllink",
        "toolrolllink-toolpitchlink", "toolpitchlink-toolyawlink", "toolyawlink-toolgripper1link",
        "toolyawlink-toolgripper2link",
    ]  # fmt: skip


@pytest.mark.usefixtures("hulls")
def test_every_body_starts_at_its_location_or_is_reported(corpus: Path) -> None:
    """Positions of joints come from the locations; where those and a joint disagree, or a loop closes, it is stated."""
    compared = 0
    for file in sorted((corpus / "suturing_scene").rglob("*.yaml")) + sorted((corpus / "multibodies").rglob("*.yaml")):
        if file.name.startswith("launch"):
            continue
        try:
            scene = ligature.load(file, roots=[corpus])
        except ligature.SceneError:
            continue
        reported = " ".join(d.message for d in scene.diagnostics if d.code in ("moved", "loop"))
        simulation = ligature.Simulation(scene)
        poses = simulation.state["body_pose"][0]
        for joint in (scene.joints[link.joint] for tree in scene.articulations for link in tree.links[1:]):
            parent, child = scene.bodies[joint.parent], scene.bodies[joint.child]
            T = np.linalg.inv(pose7_matrix(poses[parent.index])) @ pose7_matrix(poses[child.index])
            located = np.linalg.inv(parent.T_world_body) @ child.T_world_body
            apart = float(np.linalg.norm(T[:3, 3] - located[:3, 3]))
            turn = 2 * np.arccos(min(1.0, matrix_quaternion(T[:3, :3].T @ located[:3, :3])[3]))
            compared += apart < 2e-3 and turn < 0.02
            assert (apart < 2e-3 and turn < 0.02) or f"'{joint.identity.key}'" in reported or "closes" in reported, file
        simulation.close()
    assert compared


def test_grippers_start_as_open_as_their_locations_state(corpus: Path) -> None:
    file = corpus / "multibodies/descriptions/multi-bodies/grippers/resistive/gripper1/gripperB.yaml"
    simulation = ligature.Simulation(ligature.load(file, roots=[corpus]))
    assert simulation.joints["JOINT Cylinder-LeftL1"].position == pytest.approx(1.048, abs=2e-3)
    assert simulation.joints["JOINT Cylinder-RightL1"].position == pytest.approx(1.048, abs=2e-3)
    for _ in range(200):
        simulation.step()
        assert np.abs(simulation.state["body_twist"]).max() < 4.0
    simulation.close()


LOOPS = (
    "environments/KnotEnv/env.yaml", "environments/KnotEnv2/env.yaml", "grippers/resistive/gripper1/gripperB.yaml",
    "grippers/resistive/gripper3/gripper.yaml", "puzzles/puzzle2.yaml", "robots/blender-ecm.yaml",
    "robots/blender-psm.yaml",
)  # fmt: skip


ARMS_AND_GRIPPERS = LOOPS[2:4] + LOOPS[-2:]
"""Those that somebody drives joint by joint."""


@pytest.mark.usefixtures("hulls")
@pytest.mark.parametrize("name", LOOPS)
def test_loops_of_others_stay_closed_while_the_scene_falls(name: str, corpus: Path) -> None:
    scene = ligature.load(corpus / "multibodies/descriptions/multi-bodies" / name, roots=[corpus])
    assert scene.closures
    simulation = ligature.Simulation(scene)
    for tick in range(1, 401):
        simulation.step()
        speed = np.linalg.norm(simulation.state["body_twist"][0, :, :3], axis=1).max()
        assert speed < 9.8 * tick * 1e-3 + 0.1
        if tick % 20 == 0:
            assert gaps(simulation).max() < 1e-4
    simulation.close()


def _reached(scene: Scene, joint: Joint, goal: float) -> tuple[float, float]:
    """Where a joint stops that is driven to ``goal`` for 2.5 s, and the widest gap meanwhile."""
    simulation = ligature.Simulation(scene)
    body = next(body for body in scene.bodies if joint.index in body.joints)
    row, start, widest = body.joints.index(joint.index), scene.start.coordinates[joint.index][0], 0.0
    for tick in range(2500):
        types, values = [CommandType.FORCE] * len(body.joints), [0.0] * len(body.joints)
        types[row], values[row] = CommandType.POSITION, start + (goal - start) * min(1.0, tick / 1500)
        simulation.apply(BodyCommand(body.index, CommandType.FORCE, (0.0,) * 6, tuple(types), tuple(values)))
        simulation.step()
        if tick % 20 == 0:
            widest = max(widest, float(gaps(simulation).max()))
    position = float(simulation.state["joint_position"][0, joint.index])
    simulation.close()
    return position, widest


def _driven(scene: Scene) -> list[Joint]:
    """Joints with limits and a motor that somebody can command; an effort without gains moves nothing."""
    commanded = {joint for body in scene.bodies for joint in body.joints}
    kinds = (JointType.REVOLUTE, JointType.PRISMATIC)
    return [
        j for j in scene.joints
        if j.type in kinds and j.low is not None and j.index in commanded
        and (j.output is OutputType.VELOCITY or j.controller.p > 0.0)
    ]  # fmt: skip


@pytest.mark.parametrize("side", [-0.8, 0.8])
def test_the_pitch_of_the_camera_arm_goes_all_its_way(side: float, corpus: Path) -> None:
    """Three loops hold one link, remote centre included; their roundings must not jam it."""
    scene = ligature.load(corpus / "multibodies/descriptions/multi-bodies/robots/blender-ecm.yaml", roots=[corpus])
    pitch = next(joint for joint in scene.joints if joint.identity.key == "JOINT yaw link-pitch back link")
    assert pitch.low is not None and pitch.high is not None
    goal = (pitch.low + pitch.high + side * (pitch.high - pitch.low)) / 2
    position, widest = _reached(scene, pitch, goal)
    assert position == pytest.approx(goal, abs=0.02)
    assert widest < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", ARMS_AND_GRIPPERS)
def test_every_driven_joint_of_a_loop_goes_all_its_way_or_stops_where_check_reports(name: str, corpus: Path) -> None:
    scene = ligature.load(corpus / "multibodies/descriptions/multi-bodies" / name, roots=[corpus])
    stops = {reach.joint: (reach.low, reach.high) for reach in reaches(scene)}
    for joint in _driven(scene):
        assert joint.low is not None and joint.high is not None
        low, high = stops.get(joint.index, (joint.low, joint.high))
        for side in (-0.8, 0.8):
            goal = (joint.low + joint.high + side * (joint.high - joint.low)) / 2
            position, widest = _reached(scene, joint, goal)
            expected = min(max(goal, low), high)
            assert position == pytest.approx(expected, abs=0.02 * (joint.high - joint.low)), joint.identity.key
            assert expected != goal or widest < 1e-4


@pytest.mark.parametrize(
    ("name", "key", "low", "high", "by"),
    [
        ("robots/blender-psm.yaml", "JOINT pitch front link-pitch bottom link", -0.76, 0.605,
         ["JOINT yaw link-pitch back link"]),
        ("robots/blender-psm.yaml", "JOINT yaw link-pitch back link", None, None, []),
    ],
)  # fmt: skip
def test_what_stops_a_joint_of_a_loop_is_found(
    name: str, key: str, low: float | None, high: float | None, by: list[str], corpus: Path
) -> None:
    """The figures are those at which the simulated joint stopped, found before this was computed."""
    scene = ligature.load(corpus / "multibodies/descriptions/multi-bodies" / name, roots=[corpus])
    joint = next(joint for joint in scene.joints if joint.identity.key == key)
    (reach,) = (reach for reach in reaches(scene) if reach.joint == joint.index)
    assert reach.low == pytest.approx(joint.low if low is None else low, abs=0.01)
    assert reach.high == pytest.approx(joint.high if high is None else high, abs=0.01)
    for stopping in (reach.stopped_low, reach.stopped_high):
        assert [scene.joints[j].identity.key for j in stopping] == by


AGREEING = (
    "multibodies/descriptions/multi-bodies/environments/KnotEnv/env.yaml",
    "multibodies/descriptions/multi-bodies/environments/KnotEnv2/env.yaml",
    "multibodies/descriptions/multi-bodies/grippers/multi joint1.yaml",
    "multibodies/descriptions/multi-bodies/grippers/multi joint2.yaml",
    "multibodies/descriptions/multi-bodies/grippers/pr2 gripper.yaml",
    "multibodies/descriptions/multi-bodies/grippers/resistive/gripper1/gripperA.yaml",
    "multibodies/descriptions/multi-bodies/grippers/resistive/gripper2/gripper.yaml",
    "multibodies/descriptions/multi-bodies/grippers/resistive/gripper4/gripper.yaml",
    "multibodies/descriptions/multi-bodies/grippers/single joint1.yaml",
    "multibodies/descriptions/multi-bodies/grippers/single joint2.yaml",
    "multibodies/descriptions/multi-bodies/puzzles/puzzle1.yaml",
    "multibodies/descriptions/multi-bodies/puzzles/puzzle2.yaml",
    "multibodies/descriptions/multi-bodies/puzzles/puzzle4.yaml",
    "multibodies/descriptions/multi-bodies/puzzles/puzzle5.yaml",
    "multibodies/descriptions/multi-bodies/puzzles/puzzle6.yaml",
    "multibodies/descriptions/multi-bodies/robots/blender-ecm.yaml",
    "multibodies/descriptions/multi-bodies/robots/blender-kuka-springy.yaml",
    "multibodies/descriptions/multi-bodies/robots/blender-pr2.yaml",
    "multibodies/descriptions/multi-bodies/robots/blender-psm.yaml",
    "multibodies/descriptions/multi-bodies/robots/blender-toy-car.yaml",
    "suturing_scene/ADF/PSMs/LND_400006_SIMPLE/psm1.yaml",
    "suturing_scene/ADF/PSMs/LND_400006_SIMPLE/psm2.yaml",
    "suturing_scene/ADF/Phantoms/Simple/phantom.yaml",
)
"""Files whose locations and joints agree."""

DIFFERING = {
    "multibodies/descriptions/multi-bodies/grippers/pr2 gripper small red.yaml": 4,
    "multibodies/descriptions/multi-bodies/grippers/pr2 gripper small.yaml": 4,
    "multibodies/descriptions/multi-bodies/grippers/resistive/gripper1/gripperB.yaml": 2,
    "multibodies/descriptions/multi-bodies/grippers/resistive/gripper3/gripper.yaml": 4,
    "multibodies/descriptions/multi-bodies/grippers/resistive/two_fists/gripper.yaml": 1,
    "multibodies/descriptions/multi-bodies/robots/blender-kuka-lbr-med.yaml": 1,
}
"""Files that were edited by hand, and how many of their joints differ: grippers, and the base of a KUKA."""


@pytest.mark.parametrize(("name", "count"), [*((name, 0) for name in AGREEING), *DIFFERING.items()])
def test_joints_at_zero_agree_with_the_locations(corpus: Path, name: str, count: int) -> None:
    """Within 0.01 m and 0.02 rad. The corpus grows: these files are judged, not whatever lies there."""
    scene = ligature.load(corpus / name, roots=[corpus])
    differ = 0
    for joint in scene.joints:
        T = np.linalg.inv(scene.bodies[joint.parent].T_world_body) @ scene.bodies[joint.child].T_world_body
        gap = np.linalg.inv(joint.T_parent_child_zero) @ T
        turn = 2 * np.arccos(min(1.0, matrix_quaternion(gap[:3, :3])[3]))
        differ += not (np.linalg.norm(gap[:3, 3]) < 0.01 and turn < 0.02)
    assert scene.joints and differ == count


@pytest.mark.slow  # `make test` looks at the same files in an archive (tests/adf/test_resolver.py)
@pytest.mark.usefixtures("hulls")
@pytest.mark.parametrize("strict", [False, True])
def test_no_file_makes_a_traceback(corpus: Path, strict: bool) -> None:
    from ligature.cli.check import findings

    for file in sorted(corpus.rglob("*.yaml")):
        if file.name != "launch.yaml":  # loaded below
            for diagnostic in findings(file, [corpus], strict):
                assert diagnostic.message


def test_files_that_the_reference_refuses_are_refused_in_strict_mode(corpus: Path) -> None:
    from ligature.adf import Resolver
    from ligature.adf.diagnostics import AdfError
    from ligature.adf.reader import read_any

    refused = []
    for file in sorted(corpus.rglob("*.yaml")):
        try:
            if read_any(file, Resolver([corpus]), strict=True).refused:
                refused.append(file.name)
        except AdfError:
            refused.append(file.name)
    assert refused == REFUSED


REFUSED = ["compound_example.yaml"]
"""The only file here that is no YAML for the reference either; all others it accepts."""


@pytest.mark.parametrize(
    "name", ["multibodies/descriptions/launch.yaml", *(f"multibodies/descriptions/multi-bodies/{n}" for n in LOOPS)]
)
def test_all_joints_of_a_tree_of_others_can_be_commanded_at_once(name: str, corpus: Path) -> None:
    scene = ligature.load(corpus / name, roots=[corpus])
    body = max(scene.bodies, key=lambda one: len(one.joints))
    count = len(body.joints)
    command = BodyCommand(body.index, CommandType.FORCE, (0.0,) * 6, (CommandType.POSITION,) * count, (0.01,) * count)
    command.check()
    assert decode(encode(command)) == command
    assert len(encode(command)) <= MOST_BYTES


def test_a_mechanism_too_large_for_its_reaches_is_reported(corpus: Path) -> None:
    scene = ligature.load(
        corpus / "multibodies/descriptions/multi-bodies/environments/KnotEnv/env.yaml", roots=[corpus]
    )
    assert any("reaches are computed for at most 64" in found.message for found in findings(scene))
