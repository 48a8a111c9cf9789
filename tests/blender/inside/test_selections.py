"""Random selections: keys, numbers and shapes go to those that are selected, and to nobody else."""

import bpy
import numpy as np
import pytest
from adf_studio.decimation import decimated
from adf_studio.key_panels import CATEGORIES, OTHER, SHOWN, group_of
from adf_studio.ligature.adf import Resolver
from adf_studio.ligature.mesh import load_mesh
from adf_studio.ligature.mesh.surface import open_edges, weld
from adf_studio.mesh_reading import points_of
from adf_studio.poses import relative_pose, shape_of
from adf_studio.schema_properties import fetch, identifier
from adf_studio.solids import own_solid

from .scene import body, model, select

SEEDS = range(8)


def random_bodies(rng, count=7):
    """Bodies with numbers at random, some keys of which their file would not give."""
    model()
    made = [body(f"part{n}", size=float(rng.uniform(0.05, 0.2)), location=rng.uniform(-1, 1, 3)) for n in range(count)]
    for obj in made:
        group = obj.adf.body
        group.mass = float(rng.uniform(0.1, 5.0))
        for name in ("friction_static", "restitution", "damping_linear"):
            if rng.uniform() < 0.5:
                setattr(group, name, float(rng.uniform(0.0, 1.0)))
        if rng.uniform() < 0.5:
            group.collision_groups = "1, 2"
    return made


@pytest.mark.parametrize("seed", SEEDS)
def test_keys_of_a_panel_go_to_the_selected_and_only_these(seed):
    rng = np.random.default_rng(seed)
    made = random_bodies(rng)
    chosen = [made[i] for i in rng.choice(len(made), rng.integers(2, len(made)), replace=False)]
    active, panel, exact = chosen[-1], str(rng.choice([*CATEGORIES, OTHER])), bool(rng.integers(0, 2))
    before = {obj: fetch(group_of(obj), "body") for obj in made}
    paths = {key.path for key in SHOWN["body"][panel]} - {"name", "namespace"}
    select(*chosen)
    assert bpy.ops.adf.copy_keys(panel=identifier(panel).upper(), exact=exact) == {"FINISHED"}
    for obj in made:
        now = fetch(group_of(obj), "body")
        if obj not in chosen or obj is active:
            assert now == before[obj]
            continue
        given = {path: value for path, value in before[active].items() if path in paths}
        kept = {p: v for p, v in before[obj].items() if p not in paths or not exact or p == "mass"}
        assert now == {**kept, **given}


@pytest.mark.parametrize("seed", SEEDS)
def test_one_number_of_a_selection_is_set_multiplied_or_shifted(seed):
    rng = np.random.default_rng(seed)
    made = random_bodies(rng)
    chosen = [made[i] for i in rng.choice(len(made), 4, replace=False)]
    key, value = str(rng.choice(["mass", "friction_static", "restitution"])), float(rng.uniform(0.1, 2.0))
    for how, now in (("SET", lambda v: value), ("MULTIPLY", lambda v: v * value), ("ADD", lambda v: v + value)):
        before = {obj: getattr(obj.adf.body, key) for obj in made}
        select(*chosen)
        assert bpy.ops.adf.edit_selected(key=key, how=how, value=value) == {"FINISHED"}
        for obj in made:
            expected = now(before[obj]) if obj in chosen else before[obj]
            assert getattr(obj.adf.body, key) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("fit", [True, False])
@pytest.mark.parametrize("seed", SEEDS[:4])
def test_shapes_go_to_selected_bodies_stretched_to_their_boxes(seed, fit):
    """A box that fits the active body fits each of the others when it is stretched, and stays itself when it is not."""
    rng = np.random.default_rng(seed)
    made = random_bodies(rng, 4)
    for obj in made:
        obj.scale = rng.uniform(0.3, 3.0, 3)
        obj.data.vertices[0].co.x -= float(rng.uniform(0.0, 0.1))
    active, others = made[0], made[1:3]
    bpy.context.view_layer.update()
    select(active)
    bpy.ops.adf.fit_shape(kind="BOX")
    active.adf.body.collision_margin = 0.003
    before = shape_of(active.children[0]), relative_pose(active, active.children[0])
    select(*others, active)
    assert bpy.ops.adf.copy_shapes(fit=fit) == {"FINISHED"}
    for obj in others:
        (part,) = obj.children
        points = points_of(own_solid(obj))[0]
        size, middle = np.ptp(points, axis=0), (points.min(axis=0) + points.max(axis=0)) / 2
        expected = (size, middle) if fit else (before[0].size, before[1][:3, 3])
        np.testing.assert_allclose(shape_of(part).size, expected[0], rtol=1e-4)
        np.testing.assert_allclose(relative_pose(obj, part)[:3, 3], expected[1], atol=1e-5)
        assert obj.adf.body.collision_margin == pytest.approx(0.003)
    assert not made[3].children


def lumpy(rng, subdivisions=4):
    """A closed mesh of a few thousand vertices without any symmetry."""
    bpy.ops.mesh.primitive_ico_sphere_add(subdivisions=subdivisions, radius=0.05)
    obj = bpy.context.object
    waves = rng.normal(size=(4, 3)) * 40.0
    for vertex in obj.data.vertices:
        co = np.array(vertex.co)
        vertex.co = co * (1.0 + 0.15 * np.sin(waves @ co).sum())
    obj.scale = rng.uniform(0.5, 2.0, 3)
    select(obj)
    bpy.ops.adf.make(role="BODY")
    return obj


@pytest.mark.parametrize("seed", SEEDS[:5])
def test_a_low_resolution_mesh_has_at_most_as_many_vertices_and_stays_closed_and_near(tmp_path, seed):
    rng = np.random.default_rng(seed)
    collection = model()
    obj, most = lumpy(rng), int(rng.integers(12, 400))
    before = points_of(own_solid(obj))[0]
    select(obj)
    assert bpy.ops.adf.low_resolution(vertices=most, collides="CONCAVE_MESH") == {"FINISHED"}
    np.testing.assert_array_equal(points_of(own_solid(obj))[0], before)  # what is seen stays
    bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"), collection=collection.name)
    low = load_mesh(next((tmp_path / "low_res").glob("*.OBJ")), Resolver([tmp_path]))
    vertices, faces = weld(low.vertices, np.vstack([part.faces for part in low.parts]))
    assert 4 <= len(vertices) <= most and open_edges(faces) == 0
    extent = np.ptp(before, axis=0)
    assert (np.abs(np.ptp(vertices, axis=0) - extent) < 0.35 * extent).all()
    kept = obj.adf.quality
    assert kept.pieces == 1 and 0.0 <= kept.distance < 0.35 * float(extent.max())


def test_a_finer_low_resolution_mesh_is_nearer():
    model()
    obj = lumpy(np.random.default_rng(3))
    found = []
    for most in (20, 80, 320):
        select(obj)
        bpy.ops.adf.low_resolution(vertices=most, collides="CONCAVE_MESH")
        assert len([c for c in obj.children if c.adf.role == "HULL"]) == 1
        found.append(obj.adf.quality.distance)
    assert found[0] > found[1] > found[2]


def test_a_mesh_that_is_small_enough_stays_itself_and_one_without_faces_is_reported():
    model()
    part = body("cube")
    vertices, faces = points_of(own_solid(part))
    points, polygons = decimated(vertices, faces, 150)
    assert len(points) == 8 and len(polygons) == 12
    hollow = bpy.data.objects.new("hollow", bpy.data.meshes.new("hollow"))
    bpy.context.scene.collection.objects.link(hollow)
    bpy.context.view_layer.update()
    select(hollow)
    bpy.ops.adf.make(role="BODY")
    with pytest.raises(RuntimeError, match="'hollow': its mesh has no face"):
        bpy.ops.adf.low_resolution()
