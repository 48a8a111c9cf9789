"""URDF and SDF inside Blender, by the converters of ``ligature convert``: a robot opens as a model, a model is written.

What a format cannot express is listed in a text in Blender.
"""

import tempfile
from pathlib import Path

import bpy

from . import making
from .dialogs import Asks
from .file_operators import REPLACE, chosen_collection
from .folders import own_files, remember_written
from .ligature.adf import AdfError, Resolver, read_any
from .ligature.authoring.robot import exported, read_sdf, read_urdf, sdf_text, to_adf, urdf_text
from .ligature.authoring.xml_files import XmlError
from .read_file import adding
from .saving import Export, write
from .steps import InSteps, all_or_nothing, part
from .write_file import ExportError, exporting

READERS = {".urdf": read_urdf, ".sdf": read_sdf, ".world": read_sdf}
WRITERS = {".urdf": urdf_text, ".sdf": sdf_text}
CONVERTED = 0.5
"""Share of an import after the robot is converted, of an export before."""

REPORT = "Converted Robot"


def _listed(operator, notes):
    """Report what the format cannot hold: the first note as a warning, all of them in a text."""
    if notes:
        text = bpy.data.texts.get(REPORT) or bpy.data.texts.new(REPORT)
        text.from_string("\n".join(notes))
        operator.report({"WARNING"}, f"{len(notes)} notes, in the text '{REPORT}'; the first: {notes[0]}")


class ADF_OT_import_robot(InSteps, bpy.types.Operator):
    """Open a robot of a URDF or SDF file as a model, with its meshes"""

    bl_idname = "adf.import_robot"
    bl_label = "Import URDF or SDF"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.urdf;*.sdf;*.world", options={"HIDDEN"})
    namespace: bpy.props.StringProperty(name="Namespace", default="/ambf/env/")

    def invoke(self, context, event):
        self.asking = True
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def steps(self, context):
        path = Path(bpy.path.abspath(self.filepath))
        yield f"Opening {path.name}", 0.0
        reader = READERS.get(path.suffix.lower())
        if reader is None:
            self.report({"ERROR"}, f"'{path.name}' is neither .urdf nor .sdf; xacro files become URDF by 'xacro FILE'")
            return {"CANCELLED"}
        try:
            robot = reader(path)
            done = to_adf(robot, path.resolve().parent)
        except (ValueError, OSError, AdfError) as error:
            words = str(error) if isinstance(error, (XmlError, OSError)) else f"{path.name}: {error}"
            self.report({"ERROR"}, words)
            return {"CANCELLED"}
        with all_or_nothing():
            collection = making.unplaced_file(robot.name, "MODEL", making.closed(self.namespace))
            made = yield from part(adding(collection, done.parts), CONVERTED, 1.0)
        context.scene.collection.children.link(collection)
        entry = context.scene.adf.models.add()
        entry.collection, entry.path = collection, f"{collection.name}.yaml"
        _listed(self, done.notes)
        kinds = [obj.adf.role for obj in made]
        self.report({"INFO"}, f"{path.name}: {kinds.count('BODY')} bodies, {kinds.count('JOINT')} joints")
        return {"FINISHED"}


class ADF_OT_export_robot(Asks, bpy.types.Operator):
    """Write the active model as URDF or SDF, by the ending of the name, with its meshes beside it"""

    bl_idname = "adf.export_robot"
    bl_label = "Export URDF or SDF"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.urdf;*.sdf", options={"HIDDEN"})
    collection: bpy.props.StringProperty(name="Collection", description="Model to write; the active one when empty")
    replace: REPLACE

    @classmethod
    def poll(cls, context):
        if not any(c.adf.kind == "MODEL" for c in bpy.data.collections):
            cls.poll_message_set("The scene has no model")
            return False
        return True

    def invoke(self, context, event):
        self.asking = True
        if self.answered:
            return self.execute(context)
        collection = chosen_collection(context, self.collection)
        self.filepath = f"{collection.name if collection is not None else 'robot'}.urdf"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def steps(self, context):
        collection = chosen_collection(context, self.collection)
        path = Path(bpy.path.abspath(self.filepath))
        if collection is None or collection.adf.kind != "MODEL":
            self.report({"ERROR"}, f"'{self.collection}' is no model" if self.collection else "Make a model active")
            return {"CANCELLED"}
        if path.suffix.lower() not in WRITERS:
            self.report({"ERROR"}, f"'{path.name}' ends in neither .urdf nor .sdf; the ending chooses the format")
            return {"CANCELLED"}
        if self.previewed(context):
            return {"CANCELLED"}
        try:
            done, links = yield from preparing_robot(collection, path)
            if self.ask_replace("export_robot", done, filepath=str(path), collection=collection.name):
                return {"CANCELLED"}
            write(done, self.replace)
        except (ExportError, AdfError) as error:
            self.report({"ERROR"}, f"{collection.name}: {error}")
            return {"CANCELLED"}
        remember_written(collection.adf, done.files)
        _listed(self, done.problems)
        self.report({"INFO"}, f"{path.name}: {links} links, {len(done.written)} files written")
        return {"FINISHED"}


def preparing_robot(collection, path):
    """The steps to a model as the robot file ``path`` with its meshes, not yet written, and its number of links.

    The model is converted as its own file would be, so that both state the same. They raise `ExportError`.
    """
    with tempfile.TemporaryDirectory(prefix="adf-robot-") as folder:
        file = Path(folder).resolve() / "model.yaml"
        yield from part(exporting(collection, file, remember=False), 0.0, CONVERTED)
        resolver = Resolver.for_file(file)
        done = exported(read_any(file, resolver), resolver, path.stem)
    text, notes = WRITERS[path.suffix.lower()](done.robot)
    files = {**{path.parent / name: data for name, data in done.files.items()}, path: text.encode("utf-8")}
    own = own_files(collection.adf)
    problems = [*done.notes, *notes]
    return Export(files, (path.parent,), problems=problems, own=own), len(done.robot.links)


def _import_entry(self, context):
    self.layout.operator(ADF_OT_import_robot.bl_idname, text="URDF or SDF Robot as AMBF Model (.urdf, .sdf)")


def _export_entry(self, context):
    self.layout.operator(ADF_OT_export_robot.bl_idname, text="AMBF Model as URDF or SDF (.urdf, .sdf)")


CLASSES = (ADF_OT_import_robot, ADF_OT_export_robot)


def attach() -> None:
    """Entries of the menus File > Import and File > Export."""
    bpy.types.TOPBAR_MT_file_import.append(_import_entry)
    bpy.types.TOPBAR_MT_file_export.append(_export_entry)


def detach() -> None:
    """Take them away."""
    bpy.types.TOPBAR_MT_file_import.remove(_import_entry)
    bpy.types.TOPBAR_MT_file_export.remove(_export_entry)
