"""fmt, diff, inertia, convert and poses, as a user calls them."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.cli.main import app
from typer.testing import CliRunner

MODEL = "bodies:\n- BODY a\nnamespace: /x/\nBODY a:\n  name: a\n  collision shape: BOX\n  collision geometry: {x: 1, y: 2, z: 3}\n  mass: 6.0\n"
URDF = """<robot name="r">
  <link name="base"><inertial><mass value="1"/><inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <collision><geometry><box size="0.2 0.2 0.2"/></geometry></collision></link>
  <link name="arm"><inertial><origin xyz="0.1 0 0" rpy="0 0 0.5"/><mass value="0.5"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>
    <visual><origin xyz="0.1 0 0" rpy="0 1.5708 0"/><geometry><cylinder radius="0.02" length="0.2"/></geometry></visual></link>
  <link name="slide"><inertial><mass value="0.1"/><inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>
  <joint name="turn" type="revolute"><parent link="base"/><child link="arm"/><origin xyz="0 0 0.3" rpy="0.3 0 0.2"/>
    <axis xyz="0 1 0"/><limit lower="-1" upper="2" effort="1" velocity="1"/></joint>
  <joint name="push" type="prismatic"><parent link="arm"/><child link="slide"/><origin xyz="0.2 0 0"/>
    <axis xyz="0 0 -1"/><limit lower="0" upper="0.1" effort="1" velocity="1"/></joint>
</robot>
"""


def run(*words: object, status: int = 0) -> str:
    result = CliRunner().invoke(app, [str(word) for word in words])
    assert result.exit_code == status, result.output
    return result.output


def test_fmt_orders_keys_and_keeps_what_it_cannot_hold(tmp_path: Path) -> None:
    file = tmp_path / "m.yaml"
    file.write_text(MODEL)
    assert "is not in canonical form" in run("fmt", "--check", file, status=1)
    run("fmt", file)
    text = file.read_text()
    assert "collision geometry: {x: 1.0, y: 2.0, z: 3.0}\n" in text
    run("fmt", "--check", file)
    file.write_text(MODEL + "# a remark\n")
    assert "not written, because its comments would be lost" in run("fmt", file, status=1)
    assert file.read_text().endswith("# a remark\n")
    run("fmt", "--lossy", file)
    assert file.read_text() == text


def test_diff_reports_what_changed_in_meaning(tmp_path: Path) -> None:
    a, b = tmp_path / "a.yaml", tmp_path / "b.yaml"
    a.write_text(MODEL)
    b.write_text("# reordered\n" + MODEL.replace("  name: a\n", "").replace("mass: 6.0", "mass: 6.00\n  name: a"))
    assert run("diff", a, b) == ""
    b.write_text(
        MODEL.replace("mass: 6.0", "mass: 7").replace("- BODY a", "- BODY a\n- BODY b")
        + "BODY b:\n  name: b\n  mass: 1\n"
    )
    assert run("diff", a, b, status=1).splitlines() == ["  BODY a: mass: 6.0 -> 7.0", "+ body 'BODY b'"]


def test_inertia_of_a_box_is_its_closed_form(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(MODEL)
    assert "BODY a: mass 6 kg, volume 6 m³, inertia {ix: 6.5, iy: 5, iz: 2.5}" in run("inertia", tmp_path / "m.yaml")


@pytest.mark.parametrize("scale", [1, 0.001, 2.5, -2])
@pytest.mark.parametrize("key", ["mesh", "collision mesh"])
@pytest.mark.parametrize("folder", ["", "far"], ids=["beside", "absolute"])
def test_inertia_of_a_mesh_is_that_of_its_scaled_size(tmp_path: Path, scale: float, key: str, folder: str) -> None:
    corners = "".join(f"v {x} {y} {z}\n" for x in (0, 1) for y in (0, 2) for z in (0, 3))
    sides = "1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4"
    (tmp_path / folder).mkdir(exist_ok=True)
    (tmp_path / folder / "box.obj").write_text(f"{corners}f {sides}\n")
    path = tmp_path / folder if folder else "."
    (tmp_path / "m.yaml").write_text(
        f"high resolution path: {path}\nlow resolution path: {path}\nbodies: [P]\n"
        f"P: {{name: p, mass: 6, {key}: box.obj, scale: {scale}}}\n"
    )
    text = run("inertia", tmp_path / "m.yaml")
    moments = [float(text.split(f"{name}: ")[1].split(",")[0].rstrip("}")) for name in ("ix", "iy", "iz")]
    assert moments == pytest.approx([v * scale**2 for v in (6.5, 5.0, 2.5)], rel=1e-4)
    assert float(text.split("volume ")[1].split()[0]) == pytest.approx(6.0 * abs(scale) ** 3, rel=1e-4)
    assert float(text.split("position {x: ")[1].split(",")[0]) == pytest.approx(0.5 * scale, rel=1e-4)


@pytest.mark.parametrize(
    ("shapes", "volume"),
    [
        ("shape: BOX, geometry: {x: 0.04, y: 0.03, z: 0.02}", "2.4e-05"),
        ("compound shape: [{shape: BOX, geometry: {x: 0.04, y: 0.03, z: 0.02}}]", "2.4e-05"),
        (
            "shape: BOX, geometry: {x: 0.04, y: 0.03, z: 0.02}, collision shape: SPHERE, collision geometry: {radius: 1}",
            "2.4e-05",
        ),
        ("collision shape: BOX, collision geometry: {x: 0.04, y: 0.03, z: 0.02}", "2.4e-05"),
        ("friction: {static: 0.5}", "add a 'shape' or a 'mesh'"),
    ],
)
def test_inertia_of_tissue_is_that_of_what_it_fills(tmp_path: Path, shapes: str, volume: str) -> None:
    text = f"bodies: [P]\nP: {{name: p, mass: 1, {shapes}, ligature tissue: {{material: liver}}}}\n"
    (tmp_path / "m.yaml").write_text(text)
    assert volume in run("inertia", tmp_path / "m.yaml")


@pytest.mark.parametrize(
    ("tissue", "options", "density"),
    [
        ("material: liver", (), 1060.0),
        ("material: liver, density: 1200", (), 1200.0),
        ("youngs modulus: 1000", (), 1000.0),
        ("material: liver", ("--density", 500.0), 500.0),
    ],
)
def test_tissue_without_mass_has_that_of_its_density(
    tmp_path: Path, tissue: str, options: tuple[object, ...], density: float
) -> None:
    shape = "shape: BOX, geometry: {x: 0.1, y: 0.1, z: 0.1}"
    (tmp_path / "m.yaml").write_text(f"bodies: [P]\nP: {{name: p, mass: 0, {shape}, ligature tissue: {{{tissue}}}}}\n")
    assert f"P: mass {density / 1000:g} kg, volume 0.001 m³" in run("inertia", tmp_path / "m.yaml", *options)


def test_what_no_robot_holds_is_reported(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(
        "bodies: [A, B, P]\njoints: [J]\nghost objects: [G]\nsutures: [S]\nsoft bodies: [Q, R]\nsensors: [X]\n"
        "gravity: {x: 0, y: 0, z: -1}\n"
        "A: {name: a, mass: 1, friction: {static: 0.3}, ligature needle: true, restitution: 0.1}\n"
        "B: {name: b, mass: 1, friction: {static: 0.3}}\n"
        "P: {name: p, shape: BOX, geometry: {x: 1, y: 1, z: 1}, ligature tissue: {material: liver}}\n"
        "J: {name: j, type: revolute, parent: A, child: B, parent pivot: {x: 0, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}, "
        "parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}, controller: {P: 1, I: 0, D: 0}, damping: 0.3}\n"
        "G: {name: g, parent: A}\nS: {name: s, length: 0.1, diameter: 0.001}\nQ: {name: q}\nR: {name: r}\n"
        "X: {name: x, type: Proximity, parent: A}\n"
    )
    for end in ("urdf", "sdf"):
        output = " ".join(run("convert", tmp_path / "m.yaml", "-o", tmp_path / f"m.{end}").split())
        for words in (
            "1 ghost object is left out", "1 suture is left out", "2 soft bodies are left out", "1 sensor is left out",
            "body 'P' is soft tissue", "'friction' of 2 bodies", "'ligature needle' of 1 body", "'controller' of 1 joint",
            "'damping' of 1 joint", "'gravity' of the file",
        ):  # fmt: skip
            assert words in output, (words, output)
        assert "restitution" not in output  # it is the default's


def test_a_urdf_robot_moves_in_the_simulator_as_its_file_states(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text(URDF)
    output = run("convert", tmp_path / "r.urdf", "-o", tmp_path / "out" / "r.yaml")
    assert "3 bodies, 2 joints" in output
    scene = ligature.load(tmp_path / "out" / "r.yaml")
    arm = next(b for b in scene.bodies if b.identity.key == "BODY arm")
    np.testing.assert_allclose(arm.T_world_body[:3, 3], [0, 0, 0.3], atol=1e-9)
    assert [j.type.value for j in scene.joints] == ["revolute", "prismatic"]
    assert (scene.joints[0].low, scene.joints[0].high) == (-1.0, 2.0)
    for joint in scene.joints:  # at zero the joints hold the links where the file puts them
        parent, child = scene.bodies[joint.parent], scene.bodies[joint.child]
        np.testing.assert_allclose(parent.T_world_body @ joint.T_parent_child_zero, child.T_world_body, atol=1e-6)


def test_a_file_that_is_no_urdf_is_reported(tmp_path: Path) -> None:
    (tmp_path / "r.urdf").write_text("<robot")
    output = run("convert", tmp_path / "r.urdf", "-o", tmp_path / "r.yaml", status=1)
    assert "r.urdf:1:1: error: not well-formed XML" in output
    assert not (tmp_path / "r.yaml").exists()


def test_poses_of_a_falling_body_are_written(tmp_path: Path) -> None:
    (tmp_path / "m.yaml").write_text(MODEL)
    run("poses", tmp_path / "m.yaml", "--out", tmp_path / "p.npz", "--seconds", 0.1, "--rate", 100)
    with np.load(tmp_path / "p.npz") as motion:
        assert list(motion["identifiers"]) == ["/x/BODY a"] and motion["poses"].shape == (11, 1, 7)
        assert motion["poses"][-1, 0, 2] == pytest.approx(-0.5 * 9.8 * 0.01, rel=0.05)
