"""Check Scene: the findings of all files, with the object of each, and fixes where there are some."""

from pathlib import Path

import bpy

from . import making
from .export_checks import TRIANGLES, deleted_end, deleted_owner, notes_of, unit_notes
from .ligature.adf import AdfError, Resolver
from .ligature.adf.diagnostics import Severity
from .ligature.adf.reader import read_text
from .ligature.adf.schema import BY_PATH
from .ligature.authoring.lint import Finding, lint_by_rule
from .placing import place
from .poses import SHAPED, rest_pose
from .properties import KIND_OF_ROLE
from .schema_properties import identifier, store, unset
from .steps import InSteps, finished, part
from .write_file import NO_MESH, ExportError, current_text, has_mesh, members

OWN = {"identifier": "its own"}
"""The fix of a copy that has the identifier of its original."""

DELETE, UNHANG = {"object": "deleted"}, {"parent": "none"}
"""The fixes of a joint, and of what hung on a body, whose body was deleted."""

READ = 0.4
"""Share of a check after the file's text is there."""

ICONS = {"ERROR": "ERROR", "WARNING": "INFO", "INFO": "DOT"}


def check_file(collection):
    """Findings of one file as it would be written now, each with its object."""
    return finished(checking(collection))


def checking(collection):
    """The steps to the findings of one file."""
    copies = list(_copies(collection))
    if copies:
        return copies
    objects = {obj.adf.key: obj for obj in members(collection)}
    broken = [finding for obj in objects.values() for finding in _unplaced(obj)]
    for obj in objects.values():
        broken += _references_to_deleted(collection, list(objects.values()), obj)
    if broken:
        return [(finding, objects.get(finding.key)) for finding in broken]
    try:
        text = yield from part(current_text(collection), 0.0, READ)
    except ExportError as error:
        return [(Finding("export", Severity.ERROR, error.obj.adf.key if error.obj else "", str(error)), error.obj)]
    except ValueError as error:
        return [(Finding("export", Severity.ERROR, "", str(error)), None)]
    path = Path(bpy.path.abspath(collection.adf.filepath) or "new.yaml").resolve()
    kind = {"MODEL": "model", "WORLD": "world", "INPUT_DEVICES": "input devices"}[collection.adf.kind]
    words = f"Checking {collection.name}"
    yield words, READ
    try:
        document = read_text(text, path, kind)
    except AdfError as error:
        return [(Finding("reader", Severity.ERROR, "", str(error)), None)]
    shaped = [obj for obj in objects.values() if obj.adf.role in SHAPED and not obj.adf.mesh_print]
    groups = [getattr(obj.adf, obj.adf.role.lower()) for obj in shaped]
    unsaved = {name for group in groups for name in (group.mesh, group.collision_mesh)}  # the next export writes them
    unsaved |= {f"{obj.name}.OBJ" for obj in objects.values() if has_mesh(obj)}
    inflated = {obj.adf.key for obj in objects.values() if obj.adf.inertia_factor != 1.0}
    found = []
    for listed in lint_by_rule(document, Resolver.for_file(path), frozenset(unsaved), frozenset(inflated)):
        found += listed
        yield words, READ + (1.0 - READ) * 0.5
    found = [*found, *(finding for obj in objects.values() for finding in _unwritten(obj))]
    return [(finding, objects.get(finding.key)) for finding in found]


def _copies(collection):
    """Objects under an identifier that another has, as copies made in Blender are."""
    first = {}
    for obj in members(collection):
        original = first.setdefault(obj.adf.key, obj)
        if obj.adf.key and original is not obj:
            message = f"it has the identifier '{obj.adf.key}' of '{original.name}'"
            yield Finding("identifier-twice", Severity.ERROR, obj.adf.key, message, "give it one of its own", OWN), obj


def _unwritten(obj):
    if obj.adf.role in SHAPED and obj.type not in ("MESH", "EMPTY"):
        message, _, hint = NO_MESH.format(obj.type.lower()).partition("; ")
        yield Finding("not-a-mesh", Severity.WARNING, obj.adf.key, message, hint)
    elif not obj.adf.was:  # its mesh file, which tells the rules of files, is not written yet
        for note in notes_of(obj):
            message, _, hint = f"it {note}".partition("; ")
            concave = note == TRIANGLES
            rule, fix = ("concave-moving", {"collision mesh type": "CONVEX_HULL"}) if concave else ("not-as-seen", None)
            yield Finding(rule, Severity.WARNING, obj.adf.key, message, hint, fix)


def _references_to_deleted(collection, objects, obj):
    """References to deleted bodies."""
    if obj.adf.role == "JOINT":
        for end in ("parent", "child"):
            gone = deleted_end(collection, objects, obj, end)
            if gone:
                hint = f"choose another {end} body, or delete the joint"
                message = f"it joins '{gone}', which was deleted"
                yield Finding("deleted-body", Severity.ERROR, obj.adf.key, message, hint, DELETE)
                return
        return
    gone = deleted_owner(collection, objects, obj)
    if gone:
        message = f"its parent '{gone}' was deleted"
        yield Finding(
            "deleted-body", Severity.ERROR, obj.adf.key, message, "parent it to another, or delete it", UNHANG
        )


def _units(scene):
    """A finding for a unit scale other than 1, since lengths are written in metres."""
    for note in unit_notes(scene):
        message, _, hint = note.partition("; ")
        yield Finding("unit-scale", Severity.WARNING, "", message, hint)


def _unplaced(obj):
    try:
        rest_pose(obj)
    except ValueError as error:
        yield Finding("transform", Severity.ERROR, obj.adf.key, str(error), "clear its transform")


class ADF_OT_check(InSteps, bpy.types.Operator):
    """Check all files of the scene; findings are listed below"""

    bl_idname = "adf.check"
    bl_label = "Check Scene"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if not any(c.adf.kind not in ("NONE", "OTHER") for c in bpy.data.collections):
            cls.poll_message_set("No collection is an ADF file")
            return False
        return True

    def steps(self, context):
        found = yield from checking_scene(context.scene)
        errors = list_findings(context.scene, found)
        self.report({"WARNING"} if errors else {"INFO"}, f"{len(found)} findings, {errors} errors")
        return {"FINISHED"}


def checking_scene(scene):
    """The steps to the findings of all files, each with its object and the name of what it is about."""
    found = [(finding, None, scene.name) for finding in _units(scene)]
    files = [collection for collection in bpy.data.collections if collection.adf.kind not in ("NONE", "OTHER")]
    for number, collection in enumerate(files):
        listed = yield from part(checking(collection), number / len(files), (number + 1) / len(files))
        found += [(finding, obj, collection.name) for finding, obj in listed]
    return found


def list_findings(scene, found):
    """List findings in the sidebar; returns how many are errors."""
    listed, errors = scene.adf.findings, 0
    listed.clear()
    for finding, obj, where in found:
        item = listed.add()
        item.severity, item.rule = finding.severity.name, finding.rule
        item.message = f"{obj.name if obj else finding.key or where}: {finding.message}"
        item.hint, item.object, item.fixable = finding.hint, obj, bool(finding.fix and obj)
        errors += finding.severity >= Severity.ERROR
    return errors


class ADF_OT_fix(InSteps, bpy.types.Operator):
    """Mend the active finding, or all that can be mended"""

    bl_idname = "adf.fix"
    bl_label = "Fix"
    bl_options = {"REGISTER", "UNDO"}

    everything: bpy.props.BoolProperty(name="All", description="Fix everything that can be fixed automatically")

    @classmethod
    def poll(cls, context):
        if not any(item.fixable for item in context.scene.adf.findings):
            cls.poll_message_set("No finding can be fixed automatically")
            return False
        return True

    def steps(self, context):
        scene = context.scene.adf
        chosen = scene.findings[scene.active_finding] if len(scene.findings) > scene.active_finding else None
        wanted = [(i.rule, i.object) for i in scene.findings if i.fixable and (self.everything or i == chosen)]
        found = yield from part(checking_scene(context.scene), 0.0, 0.5)
        todo = [(obj, finding.fix) for finding, obj, _ in found if finding.fix and (finding.rule, obj) in wanted]
        self.can_end = False
        for obj, fix in todo:
            mend(obj, fix)
        for obj in [o for o in bpy.data.objects if o.adf.role == "JOINT" and not o.adf.key and making.file_of(o)]:
            bpy.data.objects.remove(obj)
        left = yield from part(checking_scene(context.scene), 0.5, 1.0)
        list_findings(context.scene, left)
        self.report({"INFO"}, f"{len(todo)} findings mended")
        return {"FINISHED"} if todo else {"CANCELLED"}


def mend(obj, fix):
    """Give an object the values of a fix."""
    if fix is OWN:
        making.make_own(obj)
        return
    if fix is DELETE:
        obj.adf.key = ""  # it is removed when all findings have been gone through
        return
    if fix is UNHANG:
        T = rest_pose(obj)
        obj.parent, obj.adf.parent_text, obj.adf.hung = None, "", False
        place(obj, T)
        return
    kind = KIND_OF_ROLE[obj.adf.role]
    group = getattr(obj.adf, identifier(kind))
    store(group, kind, {path: value for path, value in fix.items() if value is not None})
    for path, value in fix.items():
        if value is None and path in BY_PATH[kind] and hasattr(group, identifier(path)):
            unset(group, identifier(path))


class ADF_OT_select_finding(bpy.types.Operator):
    """Make the finding's object active and select it"""

    bl_idname = "adf.select_finding"
    bl_label = "Select"
    bl_options = {"REGISTER", "UNDO"}

    index: bpy.props.IntProperty()

    def execute(self, context):
        scene = context.scene.adf
        obj = scene.findings[self.index].object if self.index < len(scene.findings) else None
        if obj is None or obj.name not in context.view_layer.objects:
            self.report({"WARNING"}, "The finding has no object in this view layer")
            return {"CANCELLED"}
        for other in context.selected_objects:
            other.select_set(False)
        obj.select_set(True)
        context.view_layer.objects.active = obj
        scene.active_finding = self.index
        return {"FINISHED"}


class ADF_OT_copy_findings(bpy.types.Operator):
    """Copy the findings as text"""

    bl_idname = "adf.copy_findings"
    bl_label = "Copy Report"

    def execute(self, context):
        lines = [f"{i.severity.lower()}: {i.message}; {i.hint}" for i in context.scene.adf.findings]
        context.window_manager.clipboard = "\n".join(lines)
        return {"FINISHED"}


CLASSES = (ADF_OT_check, ADF_OT_fix, ADF_OT_select_finding, ADF_OT_copy_findings)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
