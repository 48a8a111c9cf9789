"""Small scenes that tests start from, and what they compare afterwards."""

import hashlib
import json
import os
import random
import subprocess

import bpy
import pytest


def select(*objects):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1]


def cube(name="part", size=1.0, location=(0, 0, 0)):
    bpy.ops.mesh.primitive_cube_add(size=size, location=location)
    bpy.context.object.name = name
    return bpy.context.object


def body(name="part", **kwargs):
    obj = cube(name, **kwargs)
    select(obj)
    bpy.ops.adf.make(role="BODY")
    return obj


def model():
    bpy.ops.adf.new_file(kind="MODEL", name="model")
    return bpy.context.scene.adf.models[0].collection


def scene_print():
    """Everything that the user could miss: transforms, data, roles, selection."""
    report = []
    for obj in sorted(bpy.data.objects, key=lambda o: o.name):
        report.append(
            [
                obj.name,
                [list(row) for row in obj.matrix_basis],
                obj.data.name if obj.data else "",
                obj.adf.role,
                obj.adf.key,
                obj.parent.name if obj.parent else "",
                obj.hide_get() if obj.name in bpy.context.view_layer.objects else None,
                obj.select_get() if obj.name in bpy.context.view_layer.objects else None,
                len(obj.modifiers),
            ]
        )
    report.append(sorted((c.name, len(c.objects)) for c in bpy.data.collections))
    report.append([len(bpy.data.meshes), len(bpy.data.materials), len(bpy.data.scenes)])
    return hashlib.sha256(json.dumps(report).encode()).hexdigest()


def in_simulator(script, *paths):
    """What a script prints as JSON of exported files, by Ligature's own Python; the test is skipped without one."""
    python = os.environ.get("LIGATURE_PYTHON")
    if python is None:
        pytest.skip("set LIGATURE_PYTHON to a Python that has ligature")
    environment = {**os.environ, "PYTHONPATH": os.path.join(os.environ["LIGATURE_ROOT"], "simulator")}
    command = [python, "-c", script, *map(str, paths)]
    done = subprocess.run(command, capture_output=True, text=True, env=environment, timeout=270, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    return json.loads(done.stdout.splitlines()[-1])


def corpus_files(corpus):
    """Every real file that opens by itself; a launch file opens with all that it names."""
    found = [f for f in sorted(corpus.rglob("*.yaml")) if f.name != "compound_example.yaml"]  # which is no YAML
    return [f for f in found if "multibody configs" not in f.read_text(errors="replace")]


def corpus_sample(corpus, count=9):
    """A few of the real files, drawn once for all; all of them with LIGATURE_WHOLE_CORPUS."""
    found = corpus_files(corpus)
    if os.environ.get("LIGATURE_WHOLE_CORPUS"):
        return found
    wanted = [f for f in found if f.name in ("blender-psm.yaml", "psm1.yaml", "ghosts.yaml", "parallel_structure.yaml")]
    return [*wanted, *random.Random(19).sample([f for f in found if f not in wanted], count - len(wanted))]
