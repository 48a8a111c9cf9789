"""Which bodies of a scene are an arm: found, declared, or half there."""

from __future__ import annotations

import shutil
from pathlib import Path

import ligature
import pytest
from ligature.model.scene import ArmKind, Scene

ROOT = Path(__file__).parents[2]
SMALL = ROOT / "scenes" / "suturing_small"


@pytest.fixture(scope="module")
def small() -> Scene:
    return ligature.load(SMALL / "launch.yaml")


def scene_with(tmp_path: Path, arms: str, drop: str = "") -> Scene:
    """Our small scene with other files of its own: an ``arms`` key, and a joint left out of PSM1."""
    shutil.copytree(SMALL / "high_res", tmp_path / "high_res")
    for file in SMALL.glob("*.yaml"):
        text = file.read_text()
        if drop and file.name == "psm1.yaml":
            text = "".join(line for line in text.splitlines(keepends=True) if line.strip() != f"- {drop}")
            text = text.replace(f", {drop}", "").replace(f"{drop}, ", "")
        if file.name == "launch.yaml":
            text += arms
        (tmp_path / file.name).write_text(text)
    return ligature.load(tmp_path / "launch.yaml", roots=[ROOT])


def names(scene: Scene) -> list[str]:
    return [arm.name for arm in scene.arms]


def test_both_psms_the_camera_arm_and_the_masters_are_found(small: Scene) -> None:
    assert names(small) == ["PSM1", "PSM2", "ECM", "MTML", "MTMR"]
    psm = small.arms[0]
    assert psm.kind is ArmKind.PSM
    assert psm.tool == "420006"
    assert small.bodies[psm.base].identity.topic == "/ambf/env/psm1/baselink"
    assert small.bodies[psm.tip].identity.topic == "/ambf/env/psm1/toolyawlink"
    assert len(psm.joints) == 6
    assert [small.bodies[small.joints[j].child].identity.name for j in psm.jaw] == [
        "toolgripperleftlink", "toolgripperrightlink",
    ]  # fmt: skip
    ecm = small.arms[2]
    assert not ecm.joints
    assert small.bodies[ecm.tip].identity.name == "CameraFrame"


@pytest.mark.corpus
def test_the_arms_of_an_unmodified_lab_scene_are_found(corpus: Path) -> None:
    scene = ligature.load(corpus / "suturing_scene" / "launch.yaml", models=[10, 11, 6, 7, 8, 9])
    assert names(scene) == ["PSM1", "PSM2", "ECM", "MTML", "MTMR"]
    assert [arm.tool for arm in scene.arms[:2]] == ["400006", "400006"]


def test_half_an_arm_states_what_is_missing(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, "", drop="JOINT tool roll link-tool pitch link")
    assert "PSM1" not in names(scene)
    assert "PSM2" in names(scene)
    (found,) = [d for d in scene.diagnostics if d.code == "arm"]
    assert (
        "'PSM1' is not an arm: no revolute joint 'wrist pitch' is attached to '/ambf/env/psm1/BODY tool roll link'"
        in str(found)
    )


def test_a_launch_file_may_declare_its_arms(tmp_path: Path) -> None:
    declared = """
ligature arms:
  - {name: LEFT, kind: psm, base: psm2/BODY base link, tool: LARGE_NEEDLE_DRIVER:420006}
  - {name: EYE, kind: ecm, tip: BODY CameraFrame}
  - {name: MTML, kind: mtm}
"""
    scene = scene_with(tmp_path, declared)
    assert names(scene) == ["LEFT", "EYE", "MTML"]
    assert scene.bodies[scene.arms[0].base].identity.topic == "/ambf/env/psm2/baselink"


def test_a_launch_file_may_declare_that_there_are_none(tmp_path: Path) -> None:
    assert names(scene_with(tmp_path, "ligature arms: []\n")) == []


@pytest.mark.parametrize(
    ("entry", "why"),
    [
        ("{name: A, kind: robot}", "A: kind 'robot' must be one of psm, ecm, mtm"),
        ("{name: '1 2', kind: mtm}", "'1 2' is not a valid name; write letters, digits and '_'"),
        (
            "{name: A, kind: psm, base: nowhere}",
            "A: base 'nowhere' names no body, or several; give the identifier of one",
        ),
        ("{name: A, kind: psm, base: BODY CameraFrame}", "A: no revolute joint 'yaw' is attached to"),
        ("{name: A, kind: mtm, colour: red}", "unknown key 'colour'"),
        ("just words", "'just words' is not a mapping"),
    ],
)
def test_a_wrong_declaration_is_reported_and_the_others_stand(tmp_path: Path, entry: str, why: str) -> None:
    scene = scene_with(tmp_path, f"ligature arms:\n  - {entry}\n  - {{name: MTMR, kind: mtm}}\n")
    assert names(scene) == ["MTMR"]
    (found,) = [d for d in scene.diagnostics if d.code == "arm"]
    assert why in str(found)


def test_two_arms_of_one_name_are_refused(tmp_path: Path) -> None:
    scene = scene_with(tmp_path, "ligature arms: [{name: MTML, kind: mtm}, {name: MTML, kind: mtm}]\n")
    assert names(scene) == ["MTML"]
    assert any("another arm is already called 'MTML'" in str(d) for d in scene.diagnostics)
