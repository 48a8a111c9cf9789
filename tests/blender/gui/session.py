"""One session of Blender with a window: every panel is drawn, every operator is undone, pictures are taken.

Started with the folder for pictures after ``--``; prints one line ``RESULT {…}`` and quits.
"""

import hashlib
import json
import os
import sys
import traceback
from pathlib import Path

import addon_utils
import bpy

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "inside"))
OUT = Path(sys.argv[sys.argv.index("--") + 1])
RESULT = {"undone": {}, "drawn": [], "pictures": [], "errors": []}
STEPS = []


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
    """A stored value without the address that its own text would show."""
    if hasattr(value, "to_dict"):
        return value.to_dict()
    if isinstance(value, list):
        return [plain(item) for item in value]
    return str(value)


def scene_print():
    told = []
    for obj in sorted(bpy.data.objects, key=lambda o: o.name):
        group = getattr(obj.adf, obj.adf.role.lower(), None)
        keys = sorted((k, plain(v)) for k, v in group.items()) if group is not None and hasattr(group, "items") else []
        told.append(
            [
                obj.name,
                [[round(v, 6) for v in row] for row in obj.matrix_basis],
                obj.adf.role,
                obj.adf.key,
                keys,
                obj.parent.name if obj.parent else "",
            ]
        )
    told.append(sorted((c.name, sorted(o.name for o in c.objects), c.adf.kind) for c in bpy.data.collections))
    return hashlib.sha256(json.dumps(told, default=str).encode()).hexdigest()


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


def add_sensor():
    bpy.ops.adf.add(role="SENSOR")
    select(find("SENSOR"))


OPERATORS = [
    ("new_file", {"kind": "MODEL", "name": "other"}, lambda: None),
    ("make", {"role": "GHOST_OBJECT"}, lambda: select(find("BODY", "phantom"))),
    ("clear_role", {}, lambda: select(find("BODY", "phantom"))),
    ("add", {"role": "SENSOR"}, lambda: select(find("BODY", "phantom"))),
    ("add", {"role": "ACTUATOR"}, lambda: select(find("BODY", "phantom"))),
    ("add", {"role": "SOFT_BODY"}, lambda: None),
    ("add", {"role": "VOLUME"}, lambda: None),
    ("connect", {"type": "cone twist"}, lambda: select(find("BODY", "phantom"), find("BODY", "base"))),
    ("add_shape", {"kind": "CAPSULE"}, lambda: select(find("BODY", "phantom"))),
    ("redraw_shape", {}, lambda: select(find("SHAPE"))),
    ("fit_shape", {"kind": "SPHERE"}, lambda: select(find("BODY", "link1"))),
    ("add_hull", {}, lambda: select(find("BODY", "link1"))),
    ("set_inertia", {"source": "SHAPES"}, lambda: select(find("BODY", "link1"))),
    ("unset_key", {"name": "mass"}, lambda: select(find("BODY", "link1"))),
    ("add_needle", {}, lambda: None),
    ("add_suture", {"form": "CHAIN", "elements": 5}, lambda: select(find("BODY", "phantom"))),
    ("add_hole", {}, lambda: select(find("BODY", "phantom"))),
    ("add_grasp", {}, lambda: None),
    ("add_endoscope", {}, lambda: None),
    ("check", {}, lambda: None),
    ("fix", {"everything": True}, lambda: None),
    ("move_joint", {"part": 0.9}, lambda: select(find("JOINT", "link1"))),
    ("clear_motion", {}, lambda: None),
    ("edit_list", {"name": "array", "index": -1}, add_sensor),
]


@step
def undo_every_operator():
    view()["space_data"].shading.type = "WIREFRAME"
    for name, arguments, prepare in OPERATORS:
        prepare()
        bpy.ops.ed.undo_push(message="before")
        before = scene_print()
        operator = getattr(bpy.ops.adf, name)
        label = f"{name} {arguments}" if name == "add" else name
        if not operator.poll():
            RESULT["undone"][label] = "poll"
            continue
        try:
            done = operator("EXEC_DEFAULT", True, **arguments)
        except RuntimeError as error:
            RESULT["undone"][label] = str(error)
            continue
        changed = scene_print() != before
        if done == {"FINISHED"}:
            bpy.ops.ed.undo()
        RESULT["undone"][label] = "same" if scene_print() == before else "different"
        if changed and scene_print() == before:
            RESULT["undone"][label] = "undone"
        redraw()


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
    sys.stderr.write(f"{function.__name__}\n")
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
