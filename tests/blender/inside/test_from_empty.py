"""A whole scene is made in an empty Blender by operators alone; it is written, read back and simulated."""

import math
import os

import bpy
import numpy as np
import pytest
from adf_studio.ligature.adf import Resolver, Severity, read_any

from .scene import in_simulator

SIMULATE = """
import json, sys, ligature
scene = ligature.load(sys.argv[1])
sim = ligature.Simulation(scene, dt=1e-3)
before = {k: list(b.pose) for k, b in sim.bodies.items()}
sim.step(200)
print(json.dumps({
    "bodies": {k: [before[k], list(b.pose)] for k, b in sim.bodies.items()},
    "ghosts": len(scene.ghosts), "cameras": len(scene.cameras), "lights": len(scene.lights),
    "errors": [str(d) for d in scene.diagnostics if d.severity >= 3],
}))
"""


def select(*objects, active=None):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = active or objects[-1]


def mesh_body(name, location, size, **body):
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=location)
    obj = bpy.context.object
    obj.name, obj.scale = name, size
    select(obj)
    bpy.ops.adf.make(role="BODY")
    for key, value in body.items():
        setattr(obj.adf.body, key, value)
    return obj


def author(folder):
    bpy.ops.adf.new_file(kind="MODEL", name="scene", namespace="/ambf/env/")
    ground = mesh_body("ground", (0, 0, -0.01), (0.6, 0.6, 0.02), mass=0.0)
    textured(ground, folder)
    bpy.ops.adf.fit_shape(kind="BOX")
    base = mesh_body("base", (0.2, 0, 0.1), (0.04, 0.04, 0.2), mass=0.0)
    bpy.ops.adf.fit_shape(kind="BOX")
    link1 = mesh_body("link1", (0.2, 0, 0.28), (0.03, 0.03, 0.16), mass=0.3)
    bpy.ops.adf.fit_shape(kind="CAPSULE")
    link2 = mesh_body("link2", (0.2, 0, 0.42), (0.02, 0.02, 0.1), mass=0.2)
    bpy.ops.adf.fit_shape(kind="CYLINDER")
    select(link1, link2)
    bpy.ops.adf.set_inertia(source="MESH", given="MASS")
    bpy.context.scene.cursor.location = (0.2, 0, 0.2)
    select(link1, base)
    bpy.ops.adf.connect(type="revolute", pivot="CURSOR", axis="Y")
    bpy.context.scene.cursor.location = (0.2, 0, 0.36)
    select(link2, link1)
    bpy.ops.adf.connect(type="prismatic", pivot="CURSOR", axis="Z")
    phantom = mesh_body("phantom", (0, 0, 0.02), (0.08, 0.06, 0.02), mass=0.2)
    bpy.ops.adf.add_shape(kind="BOX", size=(0.08, 0.03, 0.02), position=(0, 0.015, 0))
    bpy.ops.adf.add_shape(kind="BOX", size=(0.08, 0.03, 0.02), position=(0, -0.015, 0))
    select(phantom, ground)
    bpy.ops.adf.connect(type="six dof spring", pivot="CHILD")
    bpy.context.scene.cursor.location = (0.0, 0.0, 0.06)
    bpy.ops.adf.add_needle(with_thread="PHYSICAL", length=0.06, elements=20)
    select(phantom)
    bpy.context.scene.cursor.location = (0.0, 0.0, 0.035)
    bpy.ops.adf.add_hole(name="Entry")
    select(phantom)
    bpy.ops.adf.add(role="GHOST_OBJECT", name="zone")
    bpy.ops.adf.new_file(kind="WORLD", name="world", namespace="/ambf/env/")
    bpy.context.scene.adf.world.adf.world.gravity = (0.0, 0.0, -9.81)
    bpy.context.scene.cursor.location = (0.0, -0.3, 0.3)
    bpy.context.scene.cursor.rotation_euler = (math.radians(45), 0, 0)
    bpy.ops.adf.add(role="CAMERA", name="overview", hang=False)
    bpy.ops.adf.add(role="LIGHT", name="lamp", hang=False)
    bpy.ops.adf.add_endoscope(separation=0.005)


def textured(obj, folder):
    image = bpy.data.images.new("grid", 8, 8)
    image.filepath_raw, image.file_format = str(folder / "grid.png"), "PNG"
    image.save()
    material = bpy.data.materials.new("ground")
    material.use_nodes = True
    shader = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    node = material.node_tree.nodes.new("ShaderNodeTexImage")
    node.image = image
    material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    obj.data.materials.append(material)


def test_a_scene_from_nothing_is_written_read_back_and_simulated(tmp_path):
    author(tmp_path)
    target = tmp_path / "out" / "launch.yaml"
    assert bpy.ops.adf.export_scene(filepath=str(target)) == {"FINISHED"}
    resolver = Resolver([tmp_path])
    for name in ("launch.yaml", "scene.yaml", "world.yaml"):
        found = read_any(target.parent / name, resolver).diagnostics
        assert not [str(d) for d in found if d.severity >= Severity.WARNING]
    model = read_any(target.parent / "scene.yaml", resolver)
    assert {k: len(v) for k, v in model.lists.items() if v} == {
        "bodies": 7, "ghost objects": 2, "joints": 4, "sutures": 1,
    }  # fmt: skip
    assert (target.parent / "high_res" / "grid.png").read_bytes() == (tmp_path / "grid.png").read_bytes()
    listed = {p.name for p in (target.parent / "high_res").iterdir()} | {
        p.name for p in (target.parent / "low_res").iterdir()
    }
    named = {b.text(k) for b in model.elements("bodies") for k in ("mesh", "collision mesh") if b.text(k)}
    assert {name for name in listed if name.lower().endswith(".obj")} == named
    check_simulation(target)


def check_simulation(target):
    report = in_simulator(SIMULATE, target)
    assert report["errors"] == [] and report["ghosts"] == 2 and report["cameras"] == 3 and report["lights"] == 1
    for name, (_, end) in report["bodies"].items():
        assert np.isfinite(end).all(), name
    needle = next(v for k, v in report["bodies"].items() if k.endswith("Needle"))
    assert needle[1][2] < needle[0][2] - 0.005
    for name, height in (("ground", -0.01), ("link1", 0.28), ("link2", 0.42), ("phantom", 0.02)):
        start, end = next(v for k, v in report["bodies"].items() if k.endswith(name))
        assert start[2] == pytest.approx(height, abs=1e-6)
        assert abs(end[2] - height) < 0.06


def test_writing_again_changes_nothing(tmp_path):
    author(tmp_path)
    target = tmp_path / "out" / "launch.yaml"
    bpy.ops.adf.export_scene(filepath=str(target))
    before = {p: p.read_bytes() for p in target.parent.rglob("*") if p.is_file()}
    bpy.ops.adf.export_scene(filepath=str(target))
    assert {p: p.read_bytes() for p in target.parent.rglob("*") if p.is_file()} == before
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.adf.import_launch(filepath=str(target))
    bpy.ops.adf.export_scene(filepath=str(target))
    assert {p: p.read_bytes() for p in target.parent.rglob("*") if p.is_file()} == before


def test_simulate_here_plays_the_motion_on_copies(tmp_path, monkeypatch):
    python = os.environ.get("LIGATURE_PYTHON")
    if python is None:
        pytest.skip("set LIGATURE_PYTHON to a Python that has ligature")
    monkeypatch.setenv("PYTHONPATH", os.path.join(os.environ["LIGATURE_ROOT"], "simulator"))
    bpy.context.preferences.addons["adf_studio"].preferences.simulator = os.path.join(
        os.path.dirname(python), "ligature"
    )
    bpy.ops.adf.new_file(kind="MODEL", name="scene", namespace="/ambf/env/")
    ball = mesh_body("ball", (0, 0, 1.0), (0.1, 0.1, 0.1), mass=1.0)
    bpy.ops.adf.fit_shape(kind="SPHERE")
    bpy.ops.adf.new_file(kind="WORLD", name="world", namespace="/ambf/env/")
    before = [list(row) for row in ball.matrix_basis]
    assert bpy.ops.adf.simulate(seconds=0.25) == {"FINISHED"}
    assert [list(row) for row in ball.matrix_basis] == before
    copy = bpy.data.collections["ADF Motion"].objects[0]
    bpy.context.scene.frame_set(bpy.context.scene.frame_start + 6)
    assert copy.matrix_world.translation.z == pytest.approx(1.0 - 0.5 * 9.8 * 0.25**2, abs=0.02)
    bpy.ops.adf.clear_motion()
    assert "ADF Motion" not in bpy.data.collections and ball.name in bpy.data.objects
