"""A session of Blender with a window: every panel is drawn, every operator is undone, pictures are taken."""

import json
import os
import sys
from pathlib import Path

import addon_utils
import bmesh
import bpy
import window
from bpy_extras.view3d_utils import location_3d_to_region_2d
from window import OUT, RESULT, STEPS, find, picture, redraw, select, step, view

sys.path.insert(0, str(Path(__file__).resolve().parent.parent / "inside"))
step(window.enable)


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
    report = []
    bpy.context.view_layer.update()
    for obj in sorted(bpy.data.objects, key=lambda o: o.name):
        report.append([obj.name, [[round(v, 6) for v in row] for row in obj.matrix_world], plain(obj.get("adf"))])
        report.append([obj.parent.name if obj.parent else "", obj.data.name if obj.data else "", list(obj.color)])
        report.append([len(obj.modifiers), obj.hide_render, obj.display_type, obj.select_get(), obj.empty_display_type])
        if obj.type == "MESH":
            report.append([len(obj.data.vertices), len(obj.data.polygons), [slot.name for slot in obj.material_slots]])
    for collection in sorted(bpy.data.collections, key=lambda c: c.name):
        report.append([collection.name, sorted(o.name for o in collection.objects), plain(collection.get("adf"))])
    scene = bpy.context.scene
    report.append([plain(scene.get("adf")), plain(scene.get("adf_rest")), scene.frame_end, len(bpy.data.actions)])
    report.append(getattr(bpy.context.view_layer.objects.active, "name", ""))
    return json.dumps(report)


@step
def author():
    from test_from_empty import author as make

    make(OUT)
    bpy.ops.ed.undo_push(message="authored")


@step
def look():
    window.look((0.12, 0.0, 0.2), (1.15, 0.0, 0.5), 1.1)


for function in window.OPEN_TAB:
    step(function)


@step
def draw_every_role():
    properties = next(a for a in window.main().screen.areas if a.type == "PROPERTIES")
    roles = sorted({o.adf.role for o in bpy.data.objects if o.adf.role != "NONE"})
    for role in roles:
        select(find(role))
        properties.spaces[0].context = "PHYSICS"
        redraw()
        RESULT["drawn"].append(role)


@step
def select_a_joint():
    select(find("JOINT", "link1"))  # its panels unfold until the next step


@step
def pictures():
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


def has_opening():
    data = find("BODY", "base").data
    work = bmesh.new()
    work.from_mesh(data)
    bmesh.ops.delete(work, geom=[list(work.faces)[0]], context="FACES_ONLY")
    work.to_mesh(data)
    work.free()
    data.update()
    select(find("BODY", "base"))


def has_rigid_body():
    bpy.ops.mesh.primitive_cube_add(location=(2.0, 2.0, 2.0))
    bpy.ops.rigidbody.object_add()


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


def is_tissue():
    select(find("BODY", "base"))
    bpy.context.scene.cursor.location = find("BODY", "base").matrix_world.translation
    bpy.ops.adf.make_tissue(material="liver")


def has_pose():
    is_moved()
    bpy.ops.adf.store_pose(name="work")
    bpy.ops.adf.rest_pose()


def robot():
    """A robot to open."""
    box = '<visual><geometry><box size="0.1 0.1 0.1"/></geometry></visual>'
    (OUT / "robot.urdf").write_text(f'<robot name="robot"><link name="only">{box}</link></robot>')


def without_coacd():
    """CoACD is found nowhere at first, and after a command that ends well it is there."""
    from adf_studio import compat, decompose_operators

    real = decompose_operators.importlib.util.find_spec

    def missing(name):
        decompose_operators.importlib.util.find_spec = real

    decompose_operators.importlib.util.find_spec = missing
    compat.python = lambda: "/bin/true"
    decompose_operators.packages.cache_clear()


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
    "adopt": [({}, has_rigid_body)],
    "allow_folders": [({"folders": '["/somewhere"]'}, nothing)],
    "confirm_export": [
        (
            {
                "operator": "export_file",
                "arguments": json.dumps({"filepath": str(OUT / "asked.yaml"), "collection": "scene"}),
            },
            nothing,
        )
    ],
    "duplicate": [({}, on("BODY", "link1"))],
    "import_launch": [({"filepath": str(OUT / "files" / "launch.yaml")}, files)],
    "export_scene": [({"filepath": str(OUT / "all" / "launch.yaml")}, nothing)],
    "add_variant": [({}, lambda: activate("scene"))],
    "export_variants": [({}, has_variant)],
    "add_to_launch": [
        ({"path": "other.yaml"}, lambda: activate("world")),
        ({"path": "again.yaml"}, out_of_launch),
        ({"path": "room.yaml", "environment": True}, nothing),
    ],
    "remove_from_launch": [({"index": 0}, nothing)],
    "new_file": [({"kind": kind, "name": "other"}, nothing) for kind in ("MODEL", "WORLD")],
    "make": [({"role": role}, on("BODY", "phantom")) for role in roles("BODY")],
    "clear_role": [({}, on("BODY", "phantom"))],
    "add": [({"role": role}, on("BODY", "phantom")) for role in roles()],
    "connect": [({"type": kind}, ENDS) for kind in JOINT_TYPES],
    "add_shape": [({"kind": kind}, on("BODY", "phantom")) for kind in ("BOX", "SPHERE", "CAPSULE", "PLANE")],
    "redraw_shape": [({}, on("SHAPE"))],
    "fit_shape": [({"kind": kind}, on("BODY", "link1")) for kind in ("BOX", "SPHERE", "CYLINDER", "CAPSULE", "CONE")],
    "add_hull": [({}, on("BODY", "link1")), ({"around": "MATERIAL"}, on("BODY", "ground"))],
    "add_ring": [({"radius": 0.002}, has_opening)],
    "set_inertia": [
        ({"source": "SHAPES"}, on("BODY", "link1")),
        ({"source": "MESH", "given": "DENSITY"}, on("BODY", "link1")),
    ],
    "add_needle": [({}, nothing)],
    "add_suture": [({"form": form, "elements": 5}, on("BODY", "phantom")) for form in ("CHAIN", "PHYSICAL")],
    "add_hole": [({}, on("BODY", "phantom"))],
    "add_grasp": [({}, nothing)],
    "add_endoscope": [({}, nothing)],
    "check": [({}, lambda: bpy.context.scene.adf.findings.clear())],
    "fix": [({"everything": True}, has_finding)],
    "select_finding": [({"index": 0}, has_finding)],
    "copy_findings": [({}, has_finding)],
    "decompose": [({"threshold": 0.5, "max_hulls": 2}, on("BODY", "link1"))],
    "fetch_coacd": [({}, without_coacd)],
    "low_resolution": [({"vertices": 5, "collides": "CONVEX_HULL"}, on("BODY", "link1"))],
    "measure_collision": [({}, on("BODY", "link1"))],
    "copy_keys": [({"panel": "MASS"}, on("BODY", "link1", "base"))],
    "edit_selected": [({"key": "mass", "how": "MULTIPLY", "value": 2.0}, on("BODY", "link1"))],
    "copy_shapes": [({}, on("BODY", "link1", "base"))],
    "set_gains": [({"output": output}, on("JOINT", "link1")) for output in ("FORCE", "VELOCITY")],
    "mirror": [({"across": "Y"}, on("BODY", "link1"))],
    "add_sensor": [({"which": which}, on("BODY", "link1")) for which in ("BEAM", "FAN", "RING", "PAD", "CONTACT")],
    "make_tissue": [({"material": "skin"}, on("BODY", "base"))],
    "make_rigid": [({}, is_tissue)],
    "hold_face": [({"face": "+x"}, is_tissue)],
    "add_slit": [({"depth": 0.0}, is_tissue)],
    "add_layer": [({"material": "fat"}, is_tissue)],
    "import_robot": [({"filepath": str(OUT / "robot.urdf")}, robot)],
    "export_robot": [({"filepath": str(OUT / "model.urdf"), "collection": "scene"}, nothing)],
    "store_pose": [({"name": "work"}, is_moved)],
    "show_pose": [({"name": "work"}, has_pose)],
    "remove_pose": [({"name": "work"}, has_pose)],
    "move_joint": [({"part": 0.9}, on("JOINT", "link1"))],
    "rest_pose": [({}, is_moved)],
    "simulate": [({"seconds": 0.1}, nothing)],
    "clear_motion": [({}, is_moving)],
}
"""Each operator with arguments and what is done before it, so that there is something to undo."""


def undone(name, arguments, prepare):
    """Runs an operator on the authored scene, takes it back, and reports how the scene compares."""
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
LAUNCH = str(OUT / "files" / "launch.yaml")


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


def drag(name, limit, pixels):
    """Steps that drag the handle of a limit of a joint over the screen, and take it back."""

    def handle():
        from adf_studio import gizmos

        obj = find("JOINT", name)
        place = gizmos.place_of(obj, next(each for each in gizmos.limits_of(obj) if each.name == limit))
        region = view()["region"]
        x, y = location_3d_to_region_2d(region, view()["space_data"].region_3d, place)
        return int(region.x + x), int(region.y + y)

    def event(kind, value, along=0.0):
        x, y = STATE["handle"]
        window.main().event_simulate(type=kind, value=value, x=int(x + along * pixels[0]), y=int(y + along * pixels[1]))

    def begin():
        select(find("JOINT", name))
        bpy.ops.ed.undo_push(message="selected")
        STATE["limit"] = getattr(bpy.context.object.adf.joint, limit)
        redraw()

    def point():
        STATE["handle"] = handle()
        event("MOUSEMOVE", "NOTHING")

    def end():
        found = {"before": STATE["limit"], "after": getattr(bpy.context.object.adf.joint, limit)}
        if limit == "joint_limits_linear_high_x":
            picture("blender_six_dof")
        bpy.ops.ed.undo()
        found["undone"] = getattr(find("JOINT", name).adf.joint, limit)
        RESULT.setdefault("dragged", {})[f"{name} {limit}"] = found

    moves = [lambda part=part: event("MOUSEMOVE", "NOTHING", part) for part in (0.1, 0.5, 1.0)]
    press, release = (lambda: event("LEFTMOUSE", "PRESS")), (lambda: event("LEFTMOUSE", "RELEASE", 1.0))
    return [begin, point, point, press, *moves, release, end]


@step
def drag_limits():
    window.look((0.2, 0.0, 0.2), (0.6, 0.0, 0.3), 0.25)
    STEPS[:0] = drag("link1", "joint_limits_high", (-40, 30)) + [over_the_phantom]


def over_the_phantom():
    joint = find("JOINT", "phantom").adf.joint
    for axis in "xyz":
        setattr(joint, f"joint_limits_linear_low_{axis}", -0.01)
        setattr(joint, f"joint_limits_linear_high_{axis}", 0.01)
        setattr(joint, f"joint_limits_angular_low_{axis}", -0.6)
        setattr(joint, f"joint_limits_angular_high_{axis}", 0.6)
    window.look((0.0, 0.0, 0.02), (0.9, 0.0, 0.5), 0.2)
    STEPS[:0] = drag("phantom", "joint_limits_linear_high_x", (60, 20)) + drag(
        "phantom", "joint_limits_angular_low_z", (30, -10)
    )


@step
def quality():
    """Five convex pieces are few for a ring: numbers and colours show it."""
    bpy.ops.mesh.primitive_torus_add(major_radius=0.05, minor_radius=0.015, location=(1.0, 1.0, 0.1))
    bpy.context.object.name = "Ring"
    select(bpy.context.object)
    bpy.ops.adf.make(role="BODY")
    assert bpy.ops.adf.decompose(threshold=0.3, max_hulls=5) == {"FINISHED"}
    view()["space_data"].overlay.show_extras = False
    window.look((1.0, 1.0, 0.1), (0.8, 0.0, 0.5), 0.22)
    window.scroll_sidebar(8)


@step
def quality_is_drawn():
    picture("blender_quality")
    find("HULL", "Ring").location.x += 0.01  # drawn once more, as figures of something else
    redraw()


@step
def tissue():
    """A pad with two layers and a wound, under its panel."""
    bpy.ops.mesh.primitive_cube_add(size=0.04, location=(3.0, 3.0, 0.1))
    pad = bpy.context.object
    pad.name, pad.scale = "Pad", (1.5, 1.0, 0.4)
    select(pad)
    bpy.ops.adf.make(role="BODY")
    bpy.ops.adf.make_tissue(material="silicone pad", cell_size=0.004)
    for face in ("-x", "+x"):
        bpy.ops.adf.hold_face(face=face)
    bpy.ops.adf.add_layer(material="skin", thickness=0.003)
    bpy.ops.adf.add_layer(material="fat")
    bpy.context.scene.cursor.location = (3.0, 3.0, 0.1)
    bpy.ops.adf.add_slit(along="X", length=0.03, depth=0.006)
    window.look((3.0, 3.0, 0.1), (0.8, 0.0, 0.5), 0.11)
    view()["space_data"].shading.show_xray = True
    window.scroll_physics(14)


@step
def tissue_is_drawn():
    picture("blender_tissue")
    view()["space_data"].shading.show_xray = False


def pieces():
    return [o for o in find("BODY", "Ring").children if o.adf.role == "HULL"]


def workers():
    """Processes that this Blender has started and that still run."""
    children = Path(f"/proc/{os.getpid()}/task/{os.getpid()}/children").read_text().split()
    return [child for child in children if "decompose_worker" in Path(f"/proc/{child}/cmdline").read_text()]


@step
def decompose_in_the_background():
    select(find("BODY", "Ring"))
    for old in pieces():
        bpy.data.objects.remove(old)
    begun = bpy.ops.adf.decompose("INVOKE_DEFAULT", threshold=0.35, max_hulls=4, seed=1)
    RESULT["background"] = {"begun": sorted(begun), "waited": 0, "most": 0}
    STEPS.insert(0, wait_for_pieces)


def wait_for_pieces():
    report = RESULT["background"]
    report["waited"] += 1
    report["most"] = max(report["most"], len(workers()))
    report["pieces"] = len(pieces())
    if not report["pieces"] and report["waited"] < 600:
        STEPS.insert(0, wait_for_pieces)


@step
def end_a_decomposition():
    bpy.ops.adf.decompose("INVOKE_DEFAULT", threshold=0.01, seed=2)
    RESULT["ended"] = {"pieces": len(pieces())}


@step
def press_escape():
    RESULT["ended"]["before"] = len(workers())
    escape()


@step
def nothing_goes_on():
    RESULT["ended"] |= {"after": len(workers()), "left": len(pieces())}


def escape():
    area = view()["area"]
    for value in ("PRESS", "RELEASE"):
        window.main().event_simulate(type="ESC", value=value, x=area.x + 200, y=area.y + 200)


@step
def import_in_slices():
    """One step of work at a time, so that there is time for a key."""
    from adf_studio import steps

    steps.FIRST = steps.SLICE = 0.0
    files()
    bpy.ops.ed.undo_push(message="before an import")
    STATE["before"], STATE["files"] = scene_print(), len(bpy.context.scene.collection.children)
    RESULT["import"] = {"begun": sorted(bpy.ops.adf.import_file("INVOKE_DEFAULT", filepath=LAUNCH))}


@step
def press_escape_while_it_imports():
    RESULT["import"]["going on"] = len(bpy.data.collections)
    escape()


@step
def nothing_was_imported():
    from adf_studio import steps

    RESULT["import"] |= {"ended": len(bpy.data.collections), "as before": scene_print() == STATE["before"]}
    steps.SLICE = 0.05
    bpy.ops.adf.import_file("INVOKE_DEFAULT")
    STEPS[:0] = [redraw, choose_the_file, wait_for_the_import, undo_the_import]


def choose_the_file():
    """As a user does in the file browser."""
    browser = next(w for w in bpy.context.window_manager.windows if "FILE_BROWSER" in [a.type for a in w.screen.areas])
    area = next(a for a in browser.screen.areas if a.type == "FILE_BROWSER")
    area.spaces[0].params.directory = str(Path(LAUNCH).parent).encode()
    area.spaces[0].params.filename = Path(LAUNCH).name
    with bpy.context.temp_override(window=browser, area=area, region=area.regions[-1]):
        bpy.ops.file.execute()
    RESULT["import"]["waited"] = 0


def wait_for_the_import():
    RESULT["import"]["waited"] += 1
    if len(bpy.data.scenes[0].collection.children) <= STATE["files"] and RESULT["import"]["waited"] < 600:
        STEPS.insert(0, wait_for_the_import)


def undo_the_import():
    RESULT["import"]["done"] = len(bpy.data.collections)
    bpy.ops.ed.undo()
    RESULT["import"]["undone"] = scene_print() == STATE["before"]


@step
def ask_before_an_export_replaces_files():
    """As after the file browser: the operator was invoked by a user, and finds a file of somebody else."""
    (OUT / "asked").mkdir()
    (OUT / "asked" / "scene.yaml").write_text("of somebody else")
    words = {"filepath": str(OUT / "asked" / "scene.yaml"), "collection": "scene"}
    notes = ["'part' moves and collides as a triangle mesh; decompose it into convex pieces, or fit primitives"]
    files = json.dumps([words["filepath"]])
    area = view()["area"]
    window.main().event_simulate(type="MOUSEMOVE", value="NOTHING", x=area.x + 300, y=area.y + 400)
    bpy.ops.adf.confirm_export(
        "INVOKE_DEFAULT", operator="export_file", arguments=json.dumps(words), files=files, notes=json.dumps(notes)
    )
    STEPS[:0] = [redraw, lambda: picture("blender_replace"), escape, redraw, ask_for_folders]


def ask_for_folders():
    assert (OUT / "asked" / "scene.yaml").read_text() == "of somebody else"
    bpy.ops.adf.allow_folders("INVOKE_DEFAULT", folders=json.dumps(["/models/meshes/tools", "/models/meshes/grippers"]))
    STEPS[:0] = [redraw, lambda: picture("blender_folders"), escape, redraw, nothing_was_allowed]


def nothing_was_allowed():
    assert bpy.context.scene.adf.folders == ""


@step
def disable():
    addon_utils.disable("adf_studio", default_set=True)
    redraw()
    RESULT["left"] = [n for n in dir(bpy.types) if "ADF_" in n]


window.start()
