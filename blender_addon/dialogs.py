"""Dialogs that ask before an operator reads outside the scene's folder, or replaces files of others."""

import json

import bpy

from .folders import allow_folders
from .ligature.adf import AdfError
from .preview_operators import is_previewing
from .read_file import outside_folders
from .steps import InSteps


class Asks(InSteps):
    """An operator that asks before it reads outside, or replaces files of others, when a user started it.

    The dialog starts it again, ``answered``.
    """

    answered: bpy.props.BoolProperty(options={"HIDDEN", "SKIP_SAVE"})

    def by_user(self):
        """Whether a user is there to be asked."""
        return self.started() and not self.answered

    def ask_folders(self, operator, paths, roots, **arguments):
        """The steps that ask for the folders outside the scene's own that hold meshes; return whether they asked."""
        found = []
        for path in paths if self.by_user() else ():
            try:
                found += yield from outside_folders(path, roots)
            except (AdfError, OSError):
                continue  # opening it reports that
        if not found:
            return False
        words = {"operator": operator, "arguments": json.dumps(arguments), "folders": json.dumps(found)}
        bpy.ops.adf.allow_folders("INVOKE_DEFAULT", **words)
        return True

    def ask_replace(self, operator, done, **arguments):
        """Ask before anything surprising is written; returns whether there was something to ask."""
        if self.replace or not (done.foreign or done.notes) or not self.by_user():
            return False
        lists = {"files": json.dumps([str(file) for file in done.foreign]), "notes": json.dumps(done.notes)}
        words = json.dumps({**arguments, "replace": bool(done.foreign)})
        bpy.ops.adf.confirm_export("INVOKE_DEFAULT", operator=operator, arguments=words, **lists)
        return True

    def previewed(self, context):
        """Whether a joint is previewed, which is reported: what would be written are not the poses at rest."""
        if is_previewing(context.scene):
            self.report({"ERROR"}, "A joint is previewed; bring everything back to rest first")
            return True
        return False


class Continues:
    """A dialog after which an operator goes on: ``operator`` by name, with ``arguments`` as JSON."""

    bl_options = {"REGISTER", "UNDO", "INTERNAL"}
    width = 600

    operator: bpy.props.StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    arguments: bpy.props.StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=self.width)

    def go_on(self, **further):
        """Call the operator, and return what it does: one that goes on by itself makes a step to undo of its own."""
        context = "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT"
        words = {**json.loads(self.arguments or "{}"), **further}
        done = getattr(bpy.ops.adf, self.operator)(context, answered=True, **words)
        return {"CANCELLED"} if done == {"RUNNING_MODAL"} else done


class ADF_OT_allow_folders(Continues, bpy.types.Operator):
    """Read meshes from folders outside the scene's own, and remember them in the blend file"""

    bl_idname = "adf.allow_folders"
    bl_label = "Read Meshes From There"

    folders: bpy.props.StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    allow: bpy.props.BoolProperty(name="Read from there", default=True, options={"SKIP_SAVE"})

    def draw(self, context):
        self.layout.label(text="Meshes lie outside this scene's folder, in:", icon="FILE_FOLDER")
        for folder in json.loads(self.folders or "[]"):
            self.layout.label(text=folder)
        self.layout.prop(self, "allow")

    def execute(self, context):
        folders = self.folders if self.allow else "[]"
        if self.operator:
            return self.go_on(folders=folders)
        allow_folders(context.scene, json.loads(folders or "[]"))
        return {"FINISHED"}


class ADF_OT_confirm_export(Continues, bpy.types.Operator):
    """Write after the user has seen which files are replaced and what surprises"""

    bl_idname = "adf.confirm_export"
    bl_label = "Write Anyway"
    width = 700

    files: bpy.props.StringProperty(options={"HIDDEN", "SKIP_SAVE"})
    notes: bpy.props.StringProperty(options={"HIDDEN", "SKIP_SAVE"})

    def draw(self, context):
        files, notes = json.loads(self.files or "[]"), json.loads(self.notes or "[]")
        if files:
            self.layout.label(text="These files are not this scene's own and would be replaced:", icon="ERROR")
            _listed(self.layout, files)
        if notes:
            self.layout.label(text="What is written may surprise:", icon="INFO")
            _listed(self.layout, notes)

    def execute(self, context):
        return self.go_on()


def _listed(layout, lines, most=20):
    for line in lines[:most]:
        layout.label(text=line)
    if len(lines) > most:
        layout.label(text=f"and {len(lines) - most} more")


CLASSES = (ADF_OT_allow_folders, ADF_OT_confirm_export)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
