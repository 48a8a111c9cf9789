"""Authors the scene `blender_suturing` through the Blender extension: two flaps, suture holes, a needle and its thread.

The two arms are those of `suturing_small`. With the extension enabled (docs/blender.md) run

    blender -b --factory-startup --python scenes/author_blender_suturing.py -- scenes/blender_suturing

to write the files again; the results are committed and a test compares. Everything is done by operators, in the
order of the tutorial: each step is a function, and its first line states what it does. Metres and radians.
"""

from __future__ import annotations

import sys
from math import cos, pi, sin
from pathlib import Path

import bpy

SCENES = Path(__file__).resolve().parent
MIDDLE = (0.03, 0.2, 0.695)
"""Between the two flaps, on their upper side: where both arms reach."""

HOLE_ASIDE, HOLE_TILT = 0.006, pi / 4
"""The holes lie this far from the middle, and tilted so that a needle of 8.5 mm radius passes both."""


def at(x: float = 0.0, y: float = 0.0, z: float = 0.0) -> tuple[float, float, float]:
    """A place seen from the middle."""
    return (MIDDLE[0] + x, MIDDLE[1] + y, MIDDLE[2] + z)


def select(*objects: bpy.types.Object) -> None:
    """Select objects; the last one becomes active."""
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1]


def cursor(place: tuple[float, float, float], turn: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> None:
    """Put the 3D cursor at a place and an Euler rotation."""
    bpy.context.scene.cursor.location, bpy.context.scene.cursor.rotation_euler = place, turn


def box(name: str, place: tuple[float, float, float], size: tuple[float, float, float]) -> bpy.types.Object:
    """An ordinary mesh object: a box with its size in its vertices."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=place)
    obj = bpy.context.object
    obj.name, obj.scale = name, size
    bpy.ops.object.transform_apply(location=False, rotation=False, scale=True)
    return obj


def paint(obj: bpy.types.Object, name: str, colour: tuple[float, float, float], roughness: float) -> bpy.types.Node:
    """Give an object a Principled material, and return its shader."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    shader = next(node for node in material.node_tree.nodes if node.type == "BSDF_PRINCIPLED")
    shader.inputs["Base Color"].default_value = (*colour, 1.0)
    shader.inputs["Roughness"].default_value = roughness
    material.diffuse_color = (*colour, 1.0)  # what the viewport shows
    obj.data.materials.append(material)
    return shader


def woven(folder: Path) -> bpy.types.Image:
    """A small picture of woven cloth, as a file."""
    image = bpy.data.images.new("drape", 256, 256)
    pixels = []
    for row in range(256):
        for column in range(256):
            light = 0.75 + 0.25 * ((row // 4 + column // 4) % 2)
            pixels += [0.10 * light, 0.30 * light, 0.33 * light, 1.0]
    image.pixels = pixels
    image.filepath_raw, image.file_format = str(folder / "drape.png"), "PNG"
    image.save()
    return image


def drape(folder: Path) -> None:
    """A new model, and in it a drape that stands still: a textured box as body, with a box to touch."""
    bpy.ops.adf.new_file(kind="MODEL", name="pad", namespace="/ambf/env/phantom/")
    obj = box("Drape", at(z=-0.012), (0.16, 0.14, 0.004))
    shader = paint(obj, "drape", (1.0, 1.0, 1.0), 0.8)
    tree = obj.active_material.node_tree
    node = tree.nodes.new("ShaderNodeTexImage")
    node.image = woven(folder)
    tree.links.new(node.outputs["Color"], shader.inputs["Base Color"])
    select(obj)
    bpy.ops.adf.make(role="BODY")
    obj.adf.body.mass = 0.0
    bpy.ops.adf.fit_shape(kind="BOX")


def flaps(folder: Path) -> None:
    """Two flaps of tissue: one half with rounded edges, mirrored by a modifier; a box to touch on each side."""
    obj = box("Pad", at(z=-0.005), (0.02, 0.05, 0.01))
    for vertex in obj.data.vertices:
        vertex.co.x += 0.0175
    mirror = obj.modifiers.new("Mirror", "MIRROR")
    mirror.use_axis = (True, False, False)
    bevel = obj.modifiers.new("Bevel", "BEVEL")
    bevel.width, bevel.segments = 0.0015, 3
    paint(obj, "tissue", (0.72, 0.33, 0.27), 0.45)
    select(obj)
    bpy.ops.adf.make(role="BODY")
    obj.adf.body.mass = 0.0
    for side in (-0.0175, 0.0175):
        bpy.ops.adf.add_shape(kind="BOX", size=(0.02, 0.05, 0.01), position=(side, 0.0, 0.0))


def holes(folder: Path) -> None:
    """Suture holes at the flaps' edges: a ring on a spring and a ghost that feels the needle, three pairs."""
    for number, along in enumerate((-0.012, 0.0, 0.012), start=1):
        for name, aside, turn in (("Entry", -HOLE_ASIDE, pi / 2 + HOLE_TILT), ("Exit", HOLE_ASIDE, pi / 2 - HOLE_TILT)):
            select(bpy.data.objects["Pad"])
            cursor(at(aside, along), (0.0, turn, 0.0))
            bpy.ops.adf.add_hole(name=f"{name}{number}")


def needle(folder: Path) -> None:
    """A needle of 17 mm with nine convex pieces above the wound, and a thread by physical data at its end."""
    cursor(at(0.002, -0.03, 0.004))
    thread = {"length": 0.09, "diameter": 0.0003, "elements": 36, "youngs_modulus": 4e7}
    bpy.ops.adf.add_needle(radius=0.0085, thickness=0.0008, **thread)


def view(folder: Path) -> None:
    """A frame that carries the endoscope, a world with its two cameras, and a lamp beside them."""
    bpy.ops.object.empty_add(location=(0.0307, 0.25102, 0.81025), rotation=(0.69813, 0.0, -3.14158))
    frame = bpy.context.object
    frame.name, frame.empty_display_size = "CameraFrame", 0.02
    bpy.ops.adf.make(role="BODY")
    frame.adf.body.mass = 0.0
    bpy.ops.adf.new_file(kind="WORLD", name="world", namespace="/ambf/env/")
    bpy.context.scene.adf.world.adf.world.gravity = (0.0, 0.0, -9.81)
    bpy.ops.adf.add_endoscope(parent="BODY CameraFrame", separation=0.004, field_of_view=1.2)
    tilt = 0.35
    cursor(at(0.05, 0.1 * sin(tilt), 0.12 * cos(tilt)), (-tilt, tilt, 0.0))
    bpy.ops.adf.add(role="LIGHT", name="lamp", hang=False)


def arms(folder: Path) -> None:
    """The room, and the two arms with what lets them grasp: files that are there, listed in the launch file."""
    for name in ("environment", "psm1", "ghosts_actuators_psm1", "psm2", "ghosts_actuators_psm2"):
        bpy.ops.adf.import_file(filepath=str(SCENES / "suturing_small" / f"{name}.yaml"))
        layers = bpy.context.view_layer
        layers.active_layer_collection = layers.layer_collection.children[name]
        bpy.ops.adf.add_to_launch(path=f"../suturing_small/{name}.yaml", environment=name == "environment")


STEPS = (drape, flaps, holes, needle, view, arms)


def write(folder: Path) -> None:
    """Check the scene, and write the launch file with all that it names."""
    bpy.ops.adf.check()
    errors = [item.message for item in bpy.context.scene.adf.findings if item.severity == "ERROR"]
    if errors:
        raise SystemExit("\n".join(errors))
    bpy.ops.adf.export_scene(filepath=str(folder / "launch.yaml"))


def main(folder: Path) -> None:
    """Make everything in an empty Blender."""
    import tempfile

    import addon_utils

    bpy.ops.wm.read_factory_settings(use_empty=True)
    if addon_utils.enable("adf_studio", default_set=True) is None:
        raise SystemExit("the extension is not installed: see docs/blender.md")
    with tempfile.TemporaryDirectory() as textures:
        for step in STEPS:
            step(Path(textures))
        write(folder)


if __name__ == "__main__":
    main(Path(sys.argv[sys.argv.index("--") + 1]).resolve())
