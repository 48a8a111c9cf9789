"""Generated needles, threads, holes, grasp sets and endoscopes load, weigh what they should, and simulate."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.adf.frames import pose_matrix
from ligature.adf.update import Item, new_text
from ligature.authoring.generate import (
    STEEL,
    Anchor,
    Needle,
    Parts,
    Thread,
    jaw_grasp_set,
    needle,
    needle_end,
    stereo_endoscope,
    suture,
    suture_chain,
    suture_hole,
)
from ligature.authoring.objfile import Paint, Surface, obj_texts
from ligature.authoring.placement import JointKeys, child_pose
from ligature.mesh.inertia import mass_properties
from ligature.mesh.surface import convex_surface

GROUND = Item("body", "BODY ground", {
    "name": "ground", "mass": 0.0, "collision shape": "BOX", "collision geometry.x": 1.0, "collision geometry.y": 1.0,
    "collision geometry.z": 0.1, "location": ((0.0, 0.0, -0.05), (0.0, 0.0, 0.0)),
})  # fmt: skip


def saved(parts: Parts, folder: Path) -> Path:
    top = {"namespace": "/ambf/env/", "high resolution path": "./high_res/", "low resolution path": "./low_res/"}
    for name, mesh in parts.meshes.items():
        target = folder / ("low_res" if "collision" in name else "high_res") / name
        target.parent.mkdir(exist_ok=True)
        surfaces = [Surface(Paint(p.name), p.vertices, p.faces) for p in mesh.parts]
        obj, mtl = obj_texts(surfaces, target.with_suffix(".mtl").name, name)
        target.write_text(obj)
        target.with_suffix(".mtl").write_text(mtl)
    (folder / "m.yaml").write_text(new_text("model", top, [GROUND, *parts.items]))
    return folder / "m.yaml"


def test_a_needle_is_closed_heavy_as_steel_and_made_of_convex_pieces() -> None:
    spec = Needle(taper=0.0)
    parts = needle(spec)
    visual, collision = parts.meshes["Needle.OBJ"].parts[0], parts.meshes["Needle_collision.OBJ"].parts
    volume = np.pi * (spec.thickness / 2) ** 2 * spec.radius * spec.arc
    mass = parts.items[0].values["mass"]
    assert mass == pytest.approx(STEEL * volume, rel=0.06)
    assert mass_properties(visual.vertices, visual.faces, STEEL).mass == pytest.approx(mass)
    assert len(collision) == spec.hulls
    for piece in collision:
        hull = mass_properties(*convex_surface(piece.vertices)).volume
        assert mass_properties(piece.vertices, piece.faces).volume == pytest.approx(hull, rel=0.02)


def test_the_thread_leaves_the_needle_at_its_blunt_end() -> None:
    end = needle_end(Needle())
    np.testing.assert_allclose(end[:3, 3], [0.0085, 0.0, 0.0])
    np.testing.assert_allclose(end[:3, 2], [0.0, -1.0, 0.0], atol=1e-12)


def test_the_stiffness_of_a_chain_is_that_of_its_material() -> None:
    spec = Thread(length=0.1, diameter=0.001, elements=10, youngs_modulus=1e9, poisson_ratio=0.25)
    joint = next(i for i in suture_chain(spec, np.eye(4)).items if i.kind == "joint")
    second = np.pi * 0.001**4 / 64
    assert joint.values["stiffness.angular.x"] == pytest.approx(1e9 * second / 0.01)
    assert joint.values["stiffness.angular.z"] == pytest.approx(1e9 / 2.5 * 2 * second / 0.01)


@pytest.mark.parametrize("chain", [False, True])
def test_needle_thread_and_hole_simulate_and_stay_finite(tmp_path: Path, chain: bool) -> None:
    T = pose_matrix((0.0, 0.0, 0.05), (0.0, 0.0, 0.0))
    T_end = T @ needle_end(Needle())
    thread = Thread(length=0.05, elements=20)
    parts = needle(Needle(), T_world=T) + suture_hole(
        "Entry1", pose_matrix((0.1, 0, 0.01), (0, 0, 0)), Anchor("BODY ground", GROUND_POSE)
    )
    parts += (
        suture_chain(thread, T_end, anchor=Anchor("BODY Needle", T, needle_frame(parts)))
        if chain
        else suture(thread, needle_end(Needle()), parent="BODY Needle")
    )
    scene = ligature.load(saved(parts, tmp_path))
    assert not [d for d in scene.diagnostics if d.severity >= 3]
    sim = ligature.Simulation(scene, dt=1e-3)
    start = sim.bodies["/ambf/env/Needle"].pose.copy()
    sim.step(300)
    end = sim.bodies["/ambf/env/Needle"].pose
    assert np.isfinite(end).all() and end[2] < start[2] - 0.01
    assert sim.bodies["/ambf/env/Entry1"].pose[2] == pytest.approx(0.01, abs=1e-3)


GROUND_POSE = pose_matrix((0.0, 0.0, -0.05), (0.0, 0.0, 0.0))


def test_a_grasp_set_refers_to_the_bodies_it_was_given() -> None:
    items = jaw_grasp_set("psm1/left", "psm1/right", "psm1/yaw").items
    assert [(i.kind, i.values["parent"]) for i in items] == [
        ("ghost object", "psm1/left"), ("ghost object", "psm1/right"), ("actuator", "psm1/yaw"),
    ]  # fmt: skip


def needle_frame(parts: Parts) -> np.ndarray:
    return pose_matrix(*parts.items[0].values["inertial offset"])


def test_a_chain_starts_where_the_needle_ends_also_when_its_principal_axes_are_turned() -> None:
    inertial = needle_frame(needle(Needle()))
    assert np.abs(inertial[:3, :3] - np.eye(3)).max() > 0.01
    items = suture_chain(Thread(), needle_end(Needle()), anchor=Anchor("BODY Needle", np.eye(4), inertial)).items
    joint, first = items[-1].values, items[0].values
    names = ("parent pivot", "child pivot", "parent axis", "child axis", "offset", "joint offset")
    keys = JointKeys(*(joint[name] for name in names))
    np.testing.assert_allclose(child_pose(keys, inertial), pose_matrix(*first["location"]), atol=1e-9)


def test_an_endoscope_has_two_parallel_eyes() -> None:
    left, right = stereo_endoscope("BODY CameraFrame", separation=0.006).items
    assert right.values["location"][0] - left.values["location"][0] == pytest.approx(0.006)
    assert left.values["look at"][0] == left.values["location"][0]
    assert left.values["parent"] == "BODY CameraFrame"
