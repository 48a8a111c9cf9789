"""The scenes of others: what is created, where it stands, and that joints agree with the files' locations."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
import yaml
from ligature.adf import Severity
from ligature.model.frames import matrix_quaternion
from ligature.model.scene import Scene

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


def test_every_joint_at_zero_agrees_with_the_locations(corpus: Path) -> None:
    """The joints that differ belong to hand-edited grippers and to a KUKA base."""
    agree, differ = 0, 0
    for file in sorted((corpus / "suturing_scene").rglob("*.yaml")) + sorted((corpus / "multibodies").rglob("*.yaml")):
        try:
            scene = ligature.load(file, roots=[corpus])
        except ligature.SceneError:
            continue
        for joint in scene.joints:
            T = np.linalg.inv(scene.bodies[joint.parent].T_world_body) @ scene.bodies[joint.child].T_world_body
            gap = np.linalg.inv(joint.T_parent_child_zero) @ T
            turn = 2 * np.arccos(min(1.0, matrix_quaternion(gap[:3, :3])[3]))
            if np.linalg.norm(gap[:3, 3]) < 0.01 and turn < 0.02:
                agree += 1
            else:
                differ += 1
    assert (agree, differ) == AGREEMENT


AGREEMENT = (498, 19)
"""Joints that agree within 0.01 m and 0.02 rad, and those of files that were edited by hand and differ."""


@pytest.mark.parametrize("strict", [False, True])
def test_no_file_makes_a_traceback(corpus: Path, strict: bool) -> None:
    from ligature.cli.check import findings

    for file in sorted(corpus.rglob("*.yaml")):
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
