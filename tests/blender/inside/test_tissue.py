"""Soft tissue: what panel and tools state is what Ligature simulates, and the grid that is drawn is its grid."""

import json
import os
import subprocess

import bmesh
import bpy
import numpy as np
import pytest
from adf_studio.ligature.adf import Resolver, read_any
from adf_studio.overlay import lines_of
from adf_studio.tissue_grid import FACES, fault_of, grid_lines, grid_of, held_faces

from .scene import body, model, select

ORACLE = """
import json, sys, ligature, numpy as np
body = ligature.load(sys.argv[1]).bodies[0]
form = body.tissue
grid = form.grid
print(json.dumps({"cells": grid.cell_site.tolist(), "axes": [a.tolist() for a in grid.axes], "layers": grid.layer.tolist(),
                  "fixed": np.unique(np.round(grid.nodes[form.fixed], 9), axis=0).tolist(), "nodes": len(grid.nodes)}))
"""


def simulated(file):
    """The tissue of a file's first body, by Ligature's own Python."""
    python = os.environ.get("LIGATURE_PYTHON")
    if python is None:
        pytest.skip("set LIGATURE_PYTHON to a Python that has ligature")
    environment = {**os.environ, "PYTHONPATH": os.path.join(os.environ["LIGATURE_ROOT"], "simulator")}
    done = subprocess.run(
        [python, "-c", ORACLE, str(file)], capture_output=True, text=True, env=environment, check=False
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def pad(rng):
    """A block of tissue of a size and place at random, bevelled, so that corner cells may be empty."""
    collection = model()
    obj = body("pad", location=rng.uniform(-0.2, 0.2, 3))
    obj.scale = rng.uniform(0.02, 0.06, 3)
    if rng.uniform() < 0.5:
        obj.modifiers.new("bevel", "BEVEL").width = 0.2
    obj.rotation_euler = rng.uniform(-1.0, 1.0, 3)
    bpy.context.view_layer.update()
    select(obj)
    return collection, obj


@pytest.mark.parametrize("seed", range(6))
def test_the_grid_that_is_drawn_is_the_one_that_is_simulated(tmp_path, seed):
    rng = np.random.default_rng(seed)
    collection, obj = pad(rng)
    assert bpy.ops.adf.make_tissue(material="liver", cell_size=0.006 if seed % 2 else 0.0) == {"FINISHED"}
    for face in rng.choice(FACES[:4], 2, replace=False):
        bpy.ops.adf.hold_face(face=str(face))
    if seed % 3:
        bpy.ops.adf.add_layer(material="skin", thickness=0.004)
        bpy.ops.adf.add_layer(material="fat")
    if seed % 2:
        bpy.context.scene.cursor.location = obj.location
        bpy.ops.adf.add_slit(along="X", length=0.012, depth=0.007, width=0.004 if seed == 3 else 0.0)
    bpy.ops.adf.export_file(filepath=str(tmp_path / "pad.yaml"), collection=collection.name)
    theirs = simulated(tmp_path / "pad.yaml")
    axes, filled, _, heights = grid_of(obj)
    for mine, other in zip(axes, theirs["axes"], strict=True):
        np.testing.assert_allclose(mine, other, atol=1e-6)
    assert sorted(map(tuple, np.argwhere(filled).tolist())) == sorted(map(tuple, theirs["cells"]))
    assert len(heights) + 1 == len(set(theirs["layers"]))
    lines = grid_lines(obj)
    held = np.unique(np.round(lines["held"].reshape(-1, 3), 6), axis=0)
    fixed = np.array(theirs["fixed"])
    assert all(np.abs(fixed - place).max(axis=1).min() < 2e-6 for place in held)
    assert ("slit" in lines) == (seed in (1, 5)) and ("layer" in lines) == bool(seed % 3)
    np.testing.assert_allclose(np.ptp(lines["tissue"].reshape(-1, 3), axis=0), [np.ptp(a) for a in axes], atol=1e-6)


def test_the_overlay_draws_the_grid_where_the_body_stands_and_can_be_hidden():
    rng = np.random.default_rng(7)
    _, obj = pad(rng)
    bpy.ops.adf.make_tissue(material="skin")
    drawn = np.concatenate(lines_of(bpy.context.scene)["tissue"])
    corners = np.array([obj.matrix_world @ v.co for v in obj.data.vertices])
    assert (drawn >= corners.min(axis=0) - 1e-5).all() and (drawn <= corners.max(axis=0) + 1e-5).all()
    bpy.context.scene.adf.show_tissue = False
    assert lines_of(bpy.context.scene)["tissue"] == []


def test_what_the_tools_state_is_what_the_file_holds(tmp_path):
    collection = model()
    obj = body("pad", size=0.04)
    bpy.ops.adf.make_tissue(material="silicone pad", cell_size=0.005)
    assert held_faces(obj) == ("-z",)
    for face in ("-z", "+x"):
        bpy.ops.adf.hold_face(face=face)
    bpy.ops.adf.add_slit(along="Y", length=0.02, depth=0.01)
    bpy.ops.adf.add_layer(material="skin", thickness=0.002)
    target = {"filepath": str(tmp_path / "pad.yaml"), "collection": collection.name}
    bpy.ops.adf.export_file(**target)
    read = read_any(tmp_path / "pad.yaml", Resolver([tmp_path])).elements("bodies")[0]
    assert read.text("ligature tissue.material") == "silicone pad" and read.texts("ligature tissue.fixed") == ("+x",)
    (slit,), (layer,) = read.children("ligature tissue.slits"), read.children("ligature tissue.layers")
    assert slit.vector("from") == (0.0, -0.01, 0.01) and slit.vector("to") == (0.0, 0.01, 0.02)
    assert layer.number("thickness") == 0.002 and layer.text("material") == "skin"
    bpy.ops.adf.make_rigid()
    bpy.ops.adf.export_file(**target)
    assert "ligature tissue" not in (tmp_path / "pad.yaml").read_text()


def test_in_edit_mode_slit_and_layer_go_to_the_selected_vertices():
    model()
    obj = body("pad", size=0.04)
    bpy.ops.adf.make_tissue(material="fat")
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.mesh.subdivide(number_cuts=3)
    work = bmesh.from_edit_mesh(obj.data)
    for vertex in work.verts:
        vertex.select_set(
            abs(vertex.co.y - 0.01) < 1e-6 and abs(vertex.co.z - 0.02) < 1e-6 and abs(vertex.co.x) < 0.011
        )
    bmesh.update_edit_mesh(obj.data)
    assert bpy.ops.adf.add_slit(depth=0.005) == {"FINISHED"}
    item = obj.adf.body.ligature_tissue_slits[0]
    np.testing.assert_allclose([getattr(item, "from"), item.to], [(-0.01, 0.01, 0.015), (0.01, 0.01, 0.02)], atol=1e-6)
    for vertex in work.verts:
        vertex.select_set(abs(vertex.co.z - 0.01) < 1e-6)
    bmesh.update_edit_mesh(obj.data)
    assert bpy.ops.adf.add_layer(material="skin") == {"FINISHED"}
    assert obj.adf.body.ligature_tissue_layers[0].thickness == pytest.approx(0.01, abs=1e-6)
    with pytest.raises(RuntimeError, match="are in an existing layer"):
        bpy.ops.adf.add_layer(material="skin")
    bpy.ops.object.mode_set(mode="OBJECT")


def test_what_cannot_be_tissue_is_reported():
    model()
    empty = bpy.data.objects.new("empty", None)
    bpy.context.scene.collection.objects.link(empty)
    bpy.context.view_layer.update()
    select(empty)
    bpy.ops.adf.make(role="BODY")
    with pytest.raises(RuntimeError, match="'empty': tissue needs a closed mesh, or one primitive"):
        bpy.ops.adf.make_tissue(material="skin")
    obj = body("open", size=0.04)
    work = bmesh.new()
    work.from_mesh(obj.data)
    bmesh.ops.delete(work, geom=[list(work.faces)[0]], context="FACES_ONLY")
    work.to_mesh(obj.data)
    work.free()
    bpy.ops.adf.make_tissue(material="skin")
    assert "open edges" in fault_of(obj) and grid_lines(obj) == {}
    bpy.context.scene.cursor.location = (1.0, 0.0, 0.0)
    with pytest.raises(RuntimeError, match="The slit would lie outside 'open'"):
        bpy.ops.adf.add_slit()
