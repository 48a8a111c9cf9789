"""Random scenes: what is written is what Blender shows, what was written is opened again, and it is simulated so."""

import bpy
import numpy as np
import pytest
from adf_studio.ligature.adf import Resolver, Severity, read_any
from adf_studio.ligature.authoring.placement import matrix_of
from adf_studio.ligature.mesh import load_mesh
from adf_studio.write_file import export_file, prepared

from .chains import KINDS
from .scene import in_simulator, select
from .trees import as_seen, files_below, hidden, made_bodies, random_mesh, random_tree, turned

SEEDS = range(16)


def apart(a, b):
    """The farthest that a point of one set (n, 3) is from the other set, along an axis."""
    if not len(a) or not len(b):
        return float(len(a) != len(b))
    far = np.abs(a[:, None] - b[None]).max(axis=2)
    return float(max(far.min(axis=0).max(), far.min(axis=1).max()))


@pytest.mark.parametrize("seed", SEEDS)
def test_bodies_are_written_as_blender_shows_them(tmp_path, seed):
    objects = random_tree(seed)
    seen = as_seen(objects)
    collection = made_bodies(objects)
    hidden(objects, np.random.default_rng(seed))
    names = {obj.adf.key: obj.name for obj in objects}
    export_file(collection, tmp_path / "m.yaml")
    resolver = Resolver([tmp_path])
    document = read_any(tmp_path / "m.yaml", resolver)
    assert not [str(d) for d in document.diagnostics if d.severity >= Severity.WARNING]
    assert {element.key for element in document.elements("bodies")} == set(names)
    for element in document.elements("bodies"):
        T_seen, points = seen[names[element.key]]
        T = matrix_of(element.pose("location"))
        np.testing.assert_allclose(T[:3, 3], T_seen[:3, 3], atol=2e-6, err_msg=element.key)
        if points is not None:
            mesh = load_mesh(tmp_path / "high_res" / element.text("mesh"), resolver)
            assert apart(mesh.vertices @ T[:3, :3].T + T[:3, 3], points) < 5e-6, element.key


def bone(rng):
    bpy.ops.object.armature_add(location=rng.uniform(-1.0, 1.0, 3))
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.context.object.data.edit_bones[0].tail = rng.uniform(0.5, 1.0, 3)
    bpy.ops.object.mode_set(mode="OBJECT")
    return {"parent_type": "BONE", "parent_bone": "Bone"}


def vertex(rng):
    bpy.ops.mesh.primitive_cube_add(size=0.3, location=rng.uniform(-1.0, 1.0, 3))
    return {"parent_type": "VERTEX", "parent_vertices": rng.integers(0, 8, 3).tolist()}


def path(rng):
    bpy.ops.curve.primitive_nurbs_path_add(location=rng.uniform(-1.0, 1.0, 3))
    bpy.context.object.data.use_path_follow = bool(rng.random() < 0.5)
    bpy.context.object.data.eval_time = float(rng.uniform(0.0, 100.0))
    return {}


@pytest.mark.parametrize("make", [bone, vertex, path])
@pytest.mark.parametrize("seed", SEEDS[:4])
def test_what_something_else_than_an_object_carries_is_written_where_it_is_seen(tmp_path, seed, make):
    rng = np.random.default_rng(seed)
    how = make(rng)
    carrier = bpy.context.object
    obj = bpy.data.objects.new("carried", random_mesh(rng))
    bpy.context.scene.collection.objects.link(obj)
    obj.location, obj.parent = rng.uniform(-1.0, 1.0, 3), carrier
    turned(obj, rng)
    for name, value in how.items():
        setattr(obj, name, value)
    T_seen, _ = as_seen([obj])["carried"]
    export_file(made_bodies([obj]), tmp_path / "m.yaml")
    (element,) = read_any(tmp_path / "m.yaml", Resolver([tmp_path])).elements("bodies")
    np.testing.assert_allclose(matrix_of(element.pose("location"))[:3, 3], T_seen[:3, 3], atol=2e-6)


SIMULATE = """
import json, sys
import numpy as np
import ligature
from ligature.model.load import load
found = []
for path in sys.argv[1:]:
    simulation = ligature.Simulation(load(path))
    poses = simulation.state[0]["body_pose"].copy()
    simulation.step(20)
    assert np.isfinite(simulation.state[0]["body_pose"]).all()
    found.append({
        body.identity.key: [body.mass, *poses[body.index, :3].tolist()] for body in simulation.scene.bodies
    })
    simulation.close()
print(json.dumps(found))
"""


def jointed(seed):
    """A random tree whose bodies have masses and primitives, and joints to their parents of all types."""
    rng = np.random.default_rng(seed)
    objects = random_tree(seed, modifiers=False)
    made_bodies(objects)
    for number, obj in enumerate(objects):
        obj.adf.body.mass = float(rng.choice([0.0, rng.uniform(0.01, 5.0)], p=[0.2, 0.8]))
        select(obj)
        bpy.ops.adf.add_shape(kind=str(rng.choice(["BOX", "SPHERE", "CAPSULE"])), size=rng.uniform(0.01, 0.1, 3),
                              radius=0.02, height=0.1)  # fmt: skip
        if number and rng.random() < 0.7:
            select(obj, objects[rng.integers(number)])
            bpy.ops.adf.connect(type=str(rng.choice([*KINDS, "p2p", "cone twist"])))
    return objects


def test_random_scenes_are_opened_written_and_simulated_as_they_were_made(tmp_path):
    expected, paths = [], []
    for seed in SEEDS:
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        objects = jointed(seed)
        expected.append({obj.adf.key: [obj.adf.body.mass, *seen[0][:3, 3]] for obj, seen in
                         zip(objects, as_seen(objects).values(), strict=True)})  # fmt: skip
        first, again = (tmp_path / f"{seed} {name}" / "mein modell (ü)" for name in ("first", "again"))
        assert bpy.ops.adf.export_scene(filepath=str(first / "launch.yaml")) == {"FINISHED"}
        bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
        bpy.ops.adf.import_launch(filepath=str(first / "launch.yaml"))
        bpy.ops.adf.export_scene(filepath=str(again / "launch.yaml"))
        assert files_below(first) == files_below(again)
        paths.append(first / "launch.yaml")
    for seed, wanted, found in zip(SEEDS, expected, in_simulator(SIMULATE, *paths), strict=True):
        assert set(found) == set(wanted)
        for key, numbers in wanted.items():
            np.testing.assert_allclose(found[key], numbers, atol=2e-6, err_msg=f"{seed}: {key}")


@pytest.mark.parametrize("seed", SEEDS)
def test_a_mesh_file_with_collapsed_triangles_is_opened_without_them(tmp_path, seed):
    """Triangles of which corners are one vertex, or vertices at one place, as CAD programs write them."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(3, 12))
    vertices = rng.choice([-0.1, 0.0, 0.1], size=(count, 3))
    triangles = rng.integers(0, count, size=(40, 3))
    lines = [f"v {x} {y} {z}" for x, y, z in vertices] + [f"vn {x} {y} {z}" for x, y, z in rng.normal(size=(count, 3))]
    lines += [f"vt {u} {v}" for u, v in rng.random((count, 2))]
    lines += ["f " + " ".join(f"{n + 1}/{n + 1}/{n + 1}" for n in corners) for corners in triangles]
    (tmp_path / "part.OBJ").write_text("\n".join(lines) + "\n")
    (tmp_path / "m.yaml").write_text(
        "bodies: [BODY part]\nBODY part: {name: part, mesh: part.OBJ, collision mesh: part.OBJ, mass: 1.0}\n"
    )
    before = files_below(tmp_path)
    assert bpy.ops.adf.import_file(filepath=str(tmp_path / "m.yaml")) == {"FINISHED"}
    places = [tuple(vertex) for vertex in vertices]
    proper = [corners for corners in triangles if len({places[n] for n in corners}) == 3]
    for obj in (o for o in bpy.data.objects if o.type == "MESH"):
        assert all(len(set(polygon.vertices)) == 3 for polygon in obj.data.polygons)
        assert len(obj.data.polygons) == len(proper), obj.name
    bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"))
    assert files_below(tmp_path) == before


MATERIALS = (
    "Mat",
    "Mat.001",
    "rot grün",
    "a b",
    "#x",
    "usemtl y",
    "日本",
    "tail ",
    "t\tb",
    "None",
    "x" * 60,
    "Mat.png",
)
IMAGES = ("tex.png",) * 5 + ("Tex.PNG", "tex", "tex.001.png", "tex_001.png", "bild ä.png", "a b.png", "a_b.png")


def random_pictures(folder, rng, count=6):
    """Image files of a few pixels, many with one name in folders of their own, some packed or renamed."""
    for number in range(count):
        (folder / str(number)).mkdir(parents=True)
        path = folder / str(number) / str(rng.choice(IMAGES))
        new = bpy.data.images.new("new", 4, 4)
        new.pixels = rng.random(64).tolist()
        new.filepath_raw, new.file_format = str(path), "PNG"
        new.save()
        bpy.data.images.remove(new)
        image = bpy.data.images.load(str(path))
        if rng.random() < 0.3:
            image.pack()
        if rng.random() < 0.2:
            image.name = str(rng.choice(IMAGES))
        yield image, path


def random_materials(folder, rng, count=6):
    """By material: its colour, and the file of its picture or None."""
    pictures, found = list(random_pictures(folder, rng)), {}
    for _ in range(count):
        material = bpy.data.materials.new(str(rng.choice(MATERIALS)))
        colour, path = rng.uniform(0.0, 1.0, 3), None
        if rng.random() < 0.8:
            if material.node_tree is None:
                material.use_nodes = True
            nodes = material.node_tree.nodes
            shader = next(n for n in nodes if n.type == "BSDF_PRINCIPLED")
            shader.inputs["Base Color"].default_value = (*colour, 1.0)
            if rng.random() < 0.8:
                image, path = pictures[rng.integers(len(pictures))]
                node = nodes.new("ShaderNodeTexImage")
                node.image = image
                material.node_tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
        else:
            if material.node_tree is not None:
                material.node_tree.nodes.clear()
            material.diffuse_color = (*colour, 1.0)
        found[material] = colour, path
    return found


def painted(rng, materials, number):
    """An object whose faces have materials at random, one of them perhaps the object's instead of the mesh's."""
    obj = bpy.data.objects.new(f"o{number}", random_mesh(rng, str(rng.choice(["cube", "ball", "prism"]))))
    bpy.context.scene.collection.objects.link(obj)
    obj.data.uv_layers.new()
    chosen = [list(materials)[rng.integers(len(materials))] for _ in range(rng.integers(1, 5))]
    for material in chosen:
        obj.data.materials.append(material)
    for polygon in obj.data.polygons:
        polygon.material_index = int(rng.integers(len(chosen)))
    if rng.random() < 0.3:
        obj.material_slots[0].link = "OBJECT"
        obj.material_slots[0].material = list(materials)[rng.integers(len(materials))]
    return obj


def check_looks(folder, objects, materials):
    """Every face has the colour and picture of its material in the files."""
    resolver = Resolver([folder])
    stated = {e.text("name"): e for e in read_any(folder / "m.yaml", resolver).elements("bodies")}
    for obj in objects:
        mesh = load_mesh(folder / "high_res" / stated[obj.name].text("mesh"), resolver)
        middles = [(part.vertices[face].mean(axis=0), part.material) for part in mesh.parts for face in part.faces]
        obj.data.calc_loop_triangles()
        for triangle in obj.data.loop_triangles:
            middle = np.mean([obj.data.vertices[n].co for n in triangle.vertices], axis=0)
            near, look = min(middles, key=lambda item: np.abs(item[0] - middle).max())
            assert np.abs(near - middle).max() < 1e-4
            colour, path = materials[obj.material_slots[triangle.material_index].material]
            np.testing.assert_allclose(look.diffuse, colour, atol=2e-3)
            assert (look.texture is None) == (path is None)
            assert path is None or look.texture.read_bytes() == path.read_bytes()


@pytest.mark.parametrize("seed", SEEDS)
def test_every_face_keeps_its_colour_and_picture_whatever_they_are_called(tmp_path, seed):
    rng = np.random.default_rng(seed)
    materials = random_materials(tmp_path / "pictures", rng)
    objects = [painted(rng, materials, number) for number in range(4)]
    collection = made_bodies(objects)
    folder = tmp_path / "out"
    bpy.ops.adf.export_file(filepath=str(folder / "m.yaml"))
    check_looks(folder, objects, materials)
    images = [image for image in bpy.data.images if image.packed_file is None and image.users]
    for image in images[::2]:  # painted over and saved: the meshes are as they were
        image.pixels = rng.random(64).tolist()
        image.save()
    objects.append(painted(rng, materials, 4))
    select(objects[-1])
    bpy.ops.adf.make(role="BODY")
    meshes = {path: data for path, data in files_below(folder).items() if path.suffix in (".OBJ", ".mtl")}
    bpy.ops.adf.export_file(filepath=str(folder / "m.yaml"), collection=collection.name)
    check_looks(folder, objects, materials)
    now = files_below(folder)
    assert {path: now[path] for path in meshes} == meshes


@pytest.mark.parametrize("seed", SEEDS)
def test_a_camera_of_a_file_sees_as_high_as_blender_s_picture(tmp_path, seed):
    """Whatever its sensor is fitted to, and however wide the picture is; Blender draws the same frame around it."""
    rng = np.random.default_rng(seed)
    scene = bpy.context.scene
    render = scene.render
    render.resolution_x, render.resolution_y = (int(n) for n in rng.integers(100, 2000, 2))
    render.pixel_aspect_x, render.pixel_aspect_y = rng.uniform(1.0, 2.0, 2)
    bpy.ops.object.camera_add(location=rng.uniform(-1.0, 1.0, 3), rotation=rng.uniform(-3.0, 3.0, 3))
    camera = bpy.context.object
    camera.data.lens, camera.data.sensor_width, camera.data.sensor_height = rng.uniform(10.0, 80.0, 3)
    camera.data.sensor_fit = str(rng.choice(["AUTO", "HORIZONTAL", "VERTICAL"]))
    bpy.ops.adf.new_file(kind="WORLD", name="world")
    select(camera)
    bpy.ops.adf.make(role="CAMERA")
    export_file(scene.adf.world, tmp_path / "w.yaml")
    stated = read_any(tmp_path / "w.yaml", Resolver([tmp_path])).elements("cameras")[0]
    corner = camera.data.view_frame(scene=scene)[0]
    assert stated.number("field view angle") == pytest.approx(2.0 * np.arctan2(abs(corner.y), abs(corner.z)), rel=1e-5)


def panorama():
    bpy.ops.object.camera_add()
    bpy.context.object.data.type = "PANO"
    return "CAMERA"


def parallel():
    bpy.ops.object.camera_add()
    bpy.context.object.data.type = "ORTHO"
    return "CAMERA"


def shifted():
    bpy.ops.object.camera_add()
    bpy.context.object.data.shift_x = 0.1
    return "CAMERA"


def sun():
    bpy.ops.object.light_add(type="SUN")
    return "LIGHT"


def instances_on_faces():
    bpy.ops.mesh.primitive_cube_add(size=0.1)
    one = bpy.context.object
    bpy.ops.mesh.primitive_cube_add()
    one.parent = bpy.context.object
    bpy.context.object.instance_type = "FACES"
    return "BODY"


def particles():
    bpy.ops.mesh.primitive_cube_add(size=0.1)
    one = bpy.context.object
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.modifiers.new("particles", "PARTICLE_SYSTEM")
    settings = bpy.context.object.particle_systems[0].settings
    settings.render_type, settings.instance_object = "OBJECT", one
    return "BODY"


def millimetres():
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.scene.unit_settings.scale_length = 0.001
    return "BODY"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (panorama, "is panoramic"), (parallel, "is orthographic"), (shifted, "is shifted"), (sun, "is a sun"),
        (instances_on_faces, "shows instances"), (particles, "shows instances"), (millimetres, "unit scale is 0.001"),
    ],
)  # fmt: skip
def test_what_is_not_written_as_it_is_seen_is_reported_before_and_by_check_scene(tmp_path, make, words):
    role = make()
    obj = bpy.context.object
    kind = "MODEL" if role == "BODY" else "WORLD"
    bpy.ops.adf.new_file(kind=kind, name="file")
    collection = bpy.data.collections["file"]
    select(obj)
    bpy.ops.adf.make(role=role)
    assert any(words in note for note in prepared(collection, tmp_path / "m.yaml").notes)
    bpy.ops.adf.check()
    listed = [item for item in bpy.context.scene.adf.findings if words in item.message]
    assert len(listed) == 1 and listed[0].hint and not listed[0].fixable
    bpy.ops.adf.export_file(filepath=str(tmp_path / "m.yaml"))
    assert not prepared(collection, tmp_path / "m.yaml").notes  # it is known now
