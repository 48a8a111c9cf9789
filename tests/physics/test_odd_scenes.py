"""Scenes that `ligature check` passes, or should not: doubled joints, light parents of springs, overlaps, odd numbers."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.adf import Diagnostic, Severity
from ligature.cli.check import findings
from ligature.model.axis import Axis
from ligature.physics.response import moved_inertias

ZERO, UP = "{x: 0, y: 0, z: 0}", "{x: 0, y: 0, z: 1}"
BALL = "{name: ball, mass: 0.1, collision shape: SPHERE, collision geometry: {radius: 0.02}}"


def hinge(parent: str, child: str, more: str = "type: revolute", at: str = ZERO) -> str:
    return (
        f"{{name: hinge, {more}, parent: {parent}, child: {child}, parent pivot: {at}, child pivot: {ZERO}, "
        f"parent axis: {UP}, child axis: {UP}}}"
    )


def write(folder: Path, **lists: dict[str, str]) -> Path:
    """A model file with ``lists`` of inline blocks by kind."""
    lines = [f"{kind}: [{', '.join(blocks)}]" for kind, blocks in lists.items()]
    lines += [f"{key}: {block}" for blocks in lists.values() for key, block in blocks.items()]
    file = folder / "model.yaml"
    file.write_text("\n".join(lines) + "\n")
    return file


def errors(file: Path) -> list[Diagnostic]:
    return [found for found in findings(file, [], strict=False) if found.severity >= Severity.ERROR]


def test_two_hinges_between_the_same_bodies_are_no_jaw(tmp_path: Path) -> None:
    file = write(
        tmp_path,
        bodies={"A": "{name: a, mass: 0}", "B": BALL},
        joints={"one": hinge("A", "B"), "two": hinge("A", "B")},
    )
    assert not errors(file)
    loaded = ligature.load(file)
    assert loaded.jaws == ()
    simulation = ligature.Simulation(loaded)
    simulation.step(100)
    assert np.isfinite(simulation.state["body_pose"]).all()


def test_a_contact_sensor_with_rays_runs_beside_a_ray_sensor(tmp_path: Path) -> None:
    rays = f"array: [{{offset: {ZERO}, direction: {UP}}}]"
    kinds = {kind: f"{{name: {kind}, type: {kind}, parent: BALL, {rays}}}" for kind in ("Contact", "Proximity")}
    file = write(tmp_path, bodies={"BALL": BALL}, sensors=kinds)
    assert not errors(file)
    simulation = ligature.Simulation(ligature.load(file))
    simulation.step(10)
    assert simulation.state["ray_measurement"].shape == (1, 1)


def test_a_thread_on_a_thread_is_an_error_with_its_place(tmp_path: Path) -> None:
    threads = {
        "FIRST": "{name: first, length: 0.1, diameter: 0.0003}",
        "SECOND": "{name: second, length: 0.1, diameter: 0.0003, parent: FIRST_007}",
    }
    file = write(tmp_path, bodies={"BALL": BALL}, sutures=threads)
    (error,) = errors(file)
    assert "connects two rod elements" in error.message and error.mark is not None
    ligature.Simulation(ligature.load(file)).step(10)


@pytest.mark.parametrize(
    ("key", "value", "words"),
    [
        ("mass", "1e7", "at most 1e+06 kg, not 1e+07"),
        ("gravity", "{x: 0, y: 0, z: -1e9}", "at most 1000 m/s², not -1e+09"),
        ("location", "{position: {x: 1e6, y: 0, z: 0}, orientation: {r: 0, p: 0, y: 0}}", "at most 10000 m, not 1e+06"),
        ("collision margin", "-1.0", "at least 0, not -1"),
    ],
)
def test_numbers_that_cannot_be_simulated_are_errors(key: str, value: str, words: str, tmp_path: Path) -> None:
    blocks = {"name": "ball", "mass": "0.1", "collision shape": "SPHERE", "collision geometry": "{radius: 0.02}"}
    block = ", ".join(f"{k}: {v}" for k, v in (blocks | {key: value}).items())
    (error, *_) = errors(write(tmp_path, bodies={"BALL": f"{{{block}}}"}))
    assert words in str(error) and error.mark is not None


def test_points_without_radius_are_an_error(tmp_path: Path) -> None:
    (tmp_path / "part.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    body = "{name: a, mass: 1, mesh: part.obj, collision mesh type: POINT_CLOUD, collision margin: 0.0}"
    found = errors(write(tmp_path, bodies={"A": body}))
    assert any("points are spheres of radius 0" in str(error) for error in found)


@pytest.mark.parametrize("depth", [0.05, 0.9])
def test_bodies_that_overlap_where_they_start_part_at_walking_pace(depth: float, tmp_path: Path) -> None:
    box = "{name: %s, mass: %g, gravity: {x: 0, y: 0, z: 0}, collision shape: BOX, collision geometry: {x: 1, y: 1, z: 1}%s}"
    place = f", location: {{position: {{x: 0, y: 0, z: {1 - depth}}}}}"
    file = write(tmp_path, bodies={"A": box % ("a", 1.0, ""), "B": box % ("b", 0.1, place)})
    simulation = ligature.Simulation(ligature.load(file))
    top_speed = 0.0
    for _ in range(5000):
        simulation.step()
        top_speed = max(top_speed, float(np.abs(simulation.state["body_twist"][0, :, :3]).max()))
    assert top_speed < 0.5
    apart = np.abs(simulation.bodies["B"].pose[:3] - simulation.bodies["A"].pose[:3]).max()
    assert apart > 0.999


def test_a_stiff_spring_with_a_light_free_parent_holds(tmp_path: Path) -> None:
    spring = (
        "type: torsion spring, joint limits: {low: -1, high: 1}, stiffness: 100, damping: 5, equilibrium point: 0.5"
    )
    parent = "{name: a, mass: 0.01, inertia: {ix: 1e-7, iy: 1e-7, iz: 1e-7}, gravity: {x: 0, y: 0, z: 0}}"
    child = "{name: b, mass: 1, inertia: {ix: 0.01, iy: 0.01, iz: 0.01}, gravity: {x: 0, y: 0, z: 0}}"
    at = "{x: 0.05, y: 0, z: 0}"
    file = write(tmp_path, bodies={"A": parent, "B": child}, joints={"spring": hinge("A", "B", spring, at)})
    simulation = ligature.Simulation(ligature.load(file))
    top_speed = 0.0
    for _ in range(500):
        simulation.step()
        top_speed = max(top_speed, float(np.abs(simulation.state["body_twist"][0, :, :3]).max()))
    assert top_speed < 5.0
    assert abs(simulation.joints["spring"].velocity) < 1.0


def test_the_moved_inertia_of_two_free_bodies_is_the_reduced_one() -> None:
    hinged, slid = Axis(False, np.eye(3)[2]), Axis(True, np.eye(3)[0])
    masses, inertias = (2.0, 3.0), (np.full(3, 0.2), np.full(3, 0.3))
    frames = (np.eye(4), np.eye(4))
    assert moved_inertias(masses, inertias, frames, (hinged,))[0] == pytest.approx(0.2 * 0.3 / 0.5)
    assert moved_inertias(masses, inertias, frames, (slid,))[0] == pytest.approx(2.0 * 3.0 / 5.0)


def test_a_heavy_parent_leaves_a_pinned_body_its_inertia_about_the_pin() -> None:
    arm = np.eye(4)
    arm[0, 3] = 0.1
    hinged = Axis(False, np.eye(3)[2])
    (moved,) = moved_inertias((1e9, 3.0), (np.full(3, 1e9), np.full(3, 0.01)), (np.eye(4), arm), (hinged,))
    assert moved == pytest.approx(0.01 + 3.0 * 0.1**2, rel=1e-6)
