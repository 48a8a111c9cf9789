"""One session of Blender with a window: every panel is drawn, every operator is undone, pictures are taken.

Started with the folder for pictures after ``--``; prints one line ``RESULT {…}`` and quits.
"""

import json
import os
import sys
import time
import traceback
from pathlib import Path

import addon_utils
import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "inside"))
OUT = Path(sys.argv[sys.argv.index("--") + 1])
RESULT = {"undone": {}, "drawn": [], "pictures": [], "errors": []}
STEPS = []
START = time.monotonic()


def step(function):
    """Enter a function that runs with a window, one after the other."""
    STEPS.append(function)
    return function


def window():
    return bpy.context.window_manager.windows[0]


def view():
    area = next(a for a in window().screen.areas if a.type == "VIEW_3D")
    return {
        "window": window(),
        "area": area,
        "region": next(r for r in area.regions if r.type == "WINDOW"),
        "space_data": area.spaces[0],
    }


def redraw():
    bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)


def picture(name):
    for _ in range(3):  # panels slide into place
        redraw()
    bpy.ops.screen.screenshot(filepath=str(OUT / f"{name}.png"))
    RESULT["pictures"].append(name)


def plain(value):
    """A stored value as text that is the same whenever the value is: names for objects, never addresses."""
    if hasattr(value, "to_dict"):
        return plain(value.to_dict())
    if isinstance(value, dict):
        return {key: plain(item) for key, item in sorted(value.items())}
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    return repr(value)


def scene_print():
    """Everything of the scene that a user could miss after an undo."""
    told = []
    bpy.context.view_layer.update()
    for obj in sorted(bpy.data.objects, key=lambda o: o.name):
        told.append([obj.name, [[round(v, 6) for v in row] for row in obj.matrix_world], plain(obj.get("adf"))])
        told.append([obj.parent.name if obj.parent else "", obj.data.name if obj.data else "", list(obj.color)])
        told.append([len(obj.modifiers), obj.hide_render, obj.display_type, obj.select_get(), obj.empty_display_type])
        if obj.type == "MESH":
            told.append([len(obj.data.vertices), [slot.name for slot in obj.material_slots]])
    for collection in sorted(bpy.data.collections, key=lambda c: c.name):
        told.append([collection.name, sorted(o.name for o in collection.objects), plain(collection.get("adf"))])
    scene = bpy.context.scene
    told.append([plain(scene.get("adf")), plain(scene.get("adf_rest")), scene.frame_end, len(bpy.data.actions)])
    told.append(getattr(bpy.context.view_layer.objects.active, "name", ""))
    return json.dumps(told)


def select(*objects):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj in objects)
    bpy.context.view_layer.objects.active = objects[-1]


def find(role, name=""):
    return next(o for o in bpy.data.objects if o.adf.role == role and name in o.name)


@step
def enable():
    assert addon_utils.enable("adf_studio", default_set=True) is not None
    bpy.context.preferences.view.show_splash = False
    bpy.context.preferences.view.ui_scale = 1.0
    bpy.context.preferences.system.viewport_aa = "OFF"  # a software renderer draws these windows
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)


@step
def author():
    from test_from_empty import author as make

    make(OUT)
    bpy.ops.ed.undo_push(message="authored")


@step
def look():
    area = view()["area"]
    space = area.spaces[0]
    space.show_region_ui = True
    space.shading.type, space.shading.color_type, space.shading.show_xray = "SOLID", "OBJECT", False
    space.overlay.show_floor = False
    space.clip_start = 0.001
    from mathutils import Euler, Vector

    space.region_3d.view_location = Vector((0.12, 0.0, 0.2))
    space.region_3d.view_rotation = Euler((1.15, 0.0, 0.5)).to_quaternion()
    space.region_3d.view_distance = 1.1
    properties = next(a for a in window().screen.areas if a.type == "PROPERTIES")
    properties.spaces[0].context = "PHYSICS" if bpy.context.object else "SCENE"


def simulate(kind, value):
    """An event of the mouse over the sidebar's ADF tab."""
    area = view()["area"]
    window().event_simulate(type=kind, value=value, x=area.x + area.width - 14, y=area.y + area.height - 212)


@step
def point_at_the_tab():
    redraw()
    simulate("MOUSEMOVE", "NOTHING")


@step
def press_the_tab():
    simulate("LEFTMOUSE", "PRESS")


@step
def release_the_tab():
    simulate("LEFTMOUSE", "RELEASE")


@step
def draw_every_role():
    properties = next(a for a in window().screen.areas if a.type == "PROPERTIES")
    roles = sorted({o.adf.role for o in bpy.data.objects if o.adf.role != "NONE"})
    for role in roles:
        select(find(role))
        properties.spaces[0].context = "PHYSICS"
        redraw()
        RESULT["drawn"].append(role)


@step
def pictures():
    select(find("JOINT", "link1"))
    picture("blender_joint")
    select(find("BODY", "link1"))
    bpy.ops.adf.check()
    picture("blender_body")
    select(find("BODY", "Needle"))
    area = view()["area"]
    from mathutils import Vector

    area.spaces[0].region_3d.view_location = Vector((0.0, 0.0, 0.05))
    area.spaces[0].region_3d.view_distance = 0.14
    picture("blender_needle")


def on(role, name="", *more):
    """Selects an object, and others named after it, before an operator runs."""
    return lambda: select(*(find(role, word) for word in (name, *more)))


def nothing():
    """The operator needs no selection."""


def add_sensor():
    bpy.ops.adf.add(role="SENSOR")
    select(find("SENSOR"))


def has_variant():
    activate("scene")
    bpy.ops.adf.add_variant(filepath="other.yaml")
    bpy.ops.adf.export_file(filepath=str(OUT / "scene.yaml"), collection="scene")


def activate(name):
    layers = bpy.context.view_layer
    layers.active_layer_collection = layers.layer_collection.children[name]


def out_of_launch():
    activate("scene")
    bpy.ops.adf.remove_from_launch(index=0)


def has_finding():
    find("BODY", "phantom").adf.body.property_unset("mass")
    bpy.ops.adf.check()


def is_moved():
    select(find("JOINT", "link1"))
    bpy.ops.adf.move_joint(part=0.9)


def is_moving():
    bpy.ops.adf.simulate(seconds=0.1)


def roles(*left_out):
    return [role for role in FILE_ROLES if role not in left_out]


def files():
    """Files to open: an export of what was authored."""
    if not (OUT / "files" / "launch.yaml").exists():
        bpy.ops.adf.export_scene(filepath=str(OUT / "files" / "launch.yaml"))


FILE_ROLES = ("BODY", "JOINT", "GHOST_OBJECT", "SENSOR", "ACTUATOR", "CAMERA", "LIGHT", "SOFT_BODY", "VEHICLE", "VOLUME",
              "SUTURE", "INPUT_DEVICE")  # fmt: skip
ENDS = on("BODY", "phantom", "base")
JOINT_TYPES = ("revolute", "prismatic", "linear spring", "torsion spring", "p2p", "fixed", "cone twist", "six dof",
               "six dof spring")  # fmt: skip
RECIPES = {
    "unset_key": [({"name": "mass"}, on("BODY", "link1"))],
    "edit_list": [({"name": "array", "index": -1}, add_sensor), ({"name": "array", "index": 0}, add_sensor)],
    "import_file": [({"filepath": str(OUT / "files" / "scene.yaml")}, files)],
    "export_file": [({"filepath": str(OUT / "one.yaml"), "collection": "scene"}, nothing)],
    "import_launch": [({"filepath": str(OUT / "files" / "launch.yaml")}, files)],
    "export_scene": [({"filepath": str(OUT / "all" / "launch.yaml")}, nothing)],
    "add_variant": [({}, lambda: activate("scene"))],
    "export_variants": [({}, has_variant)],
    "add_to_launch": [({"path": "other.yaml"}, lambda: activate("world")), ({"path": "again.yaml"}, out_of_launch)],
    "remove_from_launch": [({"index": 0}, nothing)],
    "new_file": [({"kind": kind, "name": "other"}, nothing) for kind in ("MODEL", "WORLD")],
    "make": [({"role": role}, on("BODY", "phantom")) for role in roles("BODY")],
    "clear_role": [({}, on("BODY", "phantom"))],
    "add": [({"role": role}, on("BODY", "phantom")) for role in roles()],
    "connect": [({"type": kind}, ENDS) for kind in JOINT_TYPES],
    "add_shape": [({"kind": kind}, on("BODY", "phantom")) for kind in ("BOX", "SPHERE", "CAPSULE", "PLANE")],
    "redraw_shape": [({}, on("SHAPE"))],
    "fit_shape": [({"kind": kind}, on("BODY", "link1")) for kind in ("BOX", "SPHERE", "CYLINDER", "CAPSULE", "CONE")],
    "add_hull": [({}, on("BODY", "link1"))],
    "set_inertia": [
        ({"source": "SHAPES"}, on("BODY", "link1")),
        ({"source": "MESH", "given": "DENSITY"}, on("BODY", "link1")),
    ],
    "add_needle": [({}, nothing)],
    "add_suture": [({"form": form, "elements": 5}, on("BODY", "phantom")) for form in ("CHAIN", "PHYSICAL")],
    "add_hole": [({}, on("BODY", "phantom"))],
    "add_grasp": [({}, nothing)],
    "add_endoscope": [({}, nothing)],
    "check": [({}, nothing)],
    "fix": [({"everything": True}, has_finding)],
    "select_finding": [({"index": 0}, has_finding)],
    "copy_findings": [({}, has_finding)],
    "decompose": [({"threshold": 0.5, "max_hulls": 2}, on("BODY", "link1"))],
    "move_joint": [({"part": 0.9}, on("JOINT", "link1"))],
    "rest_pose": [({}, is_moved)],
    "simulate": [({"seconds": 0.1}, nothing)],
    "clear_motion": [({}, is_moving)],
}
"""Each operator with arguments and what is done before it, so that there is something to undo."""


def undone(name, arguments, prepare):
    """Runs an operator on the authored scene, takes it back, and tells how the scene compares."""
    prepare()
    bpy.ops.ed.undo_push(message="before")
    before = scene_print()
    operator = getattr(bpy.ops.adf, name)
    if not operator.poll():
        return "poll"
    try:
        done = operator("EXEC_DEFAULT", True, **arguments)
    except RuntimeError as error:
        return str(error)
    if done != {"FINISHED"}:
        return str(done)
    if scene_print() == before:
        return "same"
    bpy.ops.ed.undo()
    after = scene_print()
    if after == before:
        return "undone"
    at = next(i for i, (a, b) in enumerate(zip(before, after, strict=False)) if a != b)
    return f"was {before[max(at - 200, 0) : at + 100]} is {after[max(at - 200, 0) : at + 100]}"


def try_operator(name):
    """A step that tries every recipe of an operator, and goes back to the authored scene after each."""

    def run_it():
        for arguments, prepare in RECIPES[name]:
            label = " ".join([name, *(str(v) for v in arguments.values() if isinstance(v, str) and "/" not in v)])
            RESULT["undone"][label] = undone(name, arguments, prepare)
            steps = 0
            while scene_print() != STATE["authored"]:  # what the preparation did goes too
                bpy.ops.ed.undo()
                steps += 1
                if steps > 8:
                    raise RuntimeError(f"after '{label}' the authored scene does not come back")

    run_it.__name__ = f"undo {name}"
    return run_it


STATE = {}


@step
def undo_every_operator():
    from adf_studio import registration

    view()["space_data"].shading.type = "WIREFRAME"
    bpy.context.preferences.addons["adf_studio"].preferences.simulator = os.environ["LIGATURE_COMMAND"]
    bpy.context.preferences.edit.undo_steps = 256
    classes = [cls for module in registration.MODULES for cls in module.CLASSES]
    RESULT["operators"] = sorted(c.bl_idname for c in classes if issubclass(c, bpy.types.Operator))
    bpy.ops.ed.undo_push(message="authored")
    STATE["authored"] = scene_print()
    STEPS[:0] = [try_operator(name) for name in RECIPES]


@step
def disable():
    addon_utils.disable("adf_studio", default_set=True)
    redraw()
    RESULT["left"] = [n for n in dir(bpy.types) if "ADF_" in n]


def run():
    """The next step; a failure ends the session with its traceback told."""
    if not STEPS:
        finish()
        return None
    function = STEPS.pop(0)
    sys.stderr.write(f"{time.monotonic() - START:.1f} s: {function.__name__}\n")
    sys.stderr.flush()
    try:
        with bpy.context.temp_override(**view()):
            function()
    except Exception:
        RESULT["errors"].append(f"{function.__name__}: {traceback.format_exc()}")
        finish()
        return None
    return 0.3


def finish():
    sys.stdout.write(f"RESULT {json.dumps(RESULT)}\n")
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(0)


bpy.app.timers.register(run, first_interval=1.0, persistent=True)
