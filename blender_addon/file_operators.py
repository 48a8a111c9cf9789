"""Import and export of model, world and launch files, with entries in the File menu."""

import json
import re
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from .compat import HAS_FILE_HANDLER
from .dialogs import Asks
from .folders import allow_folders, forget_session, remember_written
from .launch_file import importing_launch, keeping_scene, preparing_scene
from .ligature.adf import AdfError
from .read_file import Import, importing, worded
from .steps import all_or_nothing, part
from .write_file import PREPARED, ExportError, keeping, preparing, preparing_variants, write

ASKED = 0.2
"""Share of an import after it has looked for meshes outside."""

_LAUNCH_KEY = re.compile(rb"(?:\A|[\r\n])['\"]?(?:multibody configs|world config)['\"]?\s*:")

FURTHER = bpy.props.StringProperty(
    name="Further Folder",
    description="Folder outside the scene's own from which meshes may be read; it is remembered in the blend file",
    subtype="DIR_PATH",
)
REPLACE = bpy.props.BoolProperty(
    name="Replace Files",
    description="Replace existing files that this scene neither was opened from nor wrote; else a dialog lists them",
    options={"SKIP_SAVE"},
)


class ADF_OT_import(Asks, bpy.types.Operator):
    """Open model, world, input-devices or launch files; each becomes a collection, a launch file with all it names"""

    bl_idname = "adf.import_file"
    bl_label = "Import ADF"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    directory: bpy.props.StringProperty(subtype="DIR_PATH", options={"SKIP_SAVE", "HIDDEN"})
    files: bpy.props.CollectionProperty(type=bpy.types.OperatorFileListElement, options={"SKIP_SAVE", "HIDDEN"})
    filter_glob: bpy.props.StringProperty(default="*.yaml;*.yml;*.ambf", options={"HIDDEN"})
    root: FURTHER
    folders: bpy.props.StringProperty(options={"SKIP_SAVE", "HIDDEN"})

    def invoke(self, context, event):
        self.asking = True
        if self.filepath or self.files:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def steps(self, context):
        paths = [Path(self.directory, item.name) for item in self.files if item.name] or [Path(self.filepath)]
        paths = [Path(bpy.path.abspath(str(path))) for path in paths]
        files = [{"name": item.name} for item in self.files]
        roots = _further(self)
        words = {"filepath": self.filepath, "directory": self.directory, "files": files, "root": self.root}
        asked = yield from part(self.ask_folders("import_file", paths, roots, **words), 0.0, ASKED)
        if asked:
            return {"CANCELLED"}
        opened = []
        with all_or_nothing():
            for number, path in enumerate(paths):
                steps = importing_launch(path, None, roots) if _is_launch(path) else importing(path, roots)
                shares = (ASKED + (1.0 - ASKED) * n / len(paths) for n in (number, number + 1))
                try:
                    done = yield from part(steps, *shares)
                except (AdfError, OSError) as error:
                    self.report({"ERROR"}, worded(error))
                    continue
                opened.append((path, done))
        for path, done in opened:
            if isinstance(done, Import):
                context.scene.collection.children.link(done.collection)
            else:
                done.add_to(context.scene)
            self._report(path, [done] if isinstance(done, Import) else done.done)
        if opened and roots:
            allow_folders(context.scene, [str(root) for root in roots])
        return {"FINISHED"} if opened else {"CANCELLED"}

    def _report(self, path, done):
        for problem in [problem for one in done for problem in one.problems][:20]:
            self.report({"WARNING"}, problem)
        count = sum(len(one.collection.all_objects) for one in done if one.collection is not None)
        self.report({"INFO"}, f"{path.name}: {count} objects")


class ADF_OT_export(Asks, bpy.types.Operator):
    """Write the collection to its file: only what changed changes in the text"""

    bl_idname = "adf.export_file"
    bl_label = "Export ADF"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.yaml", options={"HIDDEN"})
    collection: bpy.props.StringProperty(
        name="Collection", description="Collection to write; the active one when empty"
    )
    replace: REPLACE

    @classmethod
    def poll(cls, context):
        if any(c.adf.kind != "NONE" for c in bpy.data.collections):
            return True
        cls.poll_message_set("No collection is an ADF file; import one or make one in the sidebar")
        return False

    def invoke(self, context, event):
        self.asking = True
        if self.answered:
            return self.execute(context)
        collection = chosen_collection(context, self.collection)
        if collection is not None:
            self.filepath = collection.adf.filepath or f"{collection.name}.yaml"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def steps(self, context):
        collection = chosen_collection(context, self.collection)
        if collection is None:
            self.report({"ERROR"}, "No collection is an ADF file; make the one to be written active")
            return {"CANCELLED"}
        if self.previewed(context):
            return {"CANCELLED"}
        path = Path(bpy.path.abspath(self.filepath or collection.adf.filepath))
        try:
            done = yield from part(preparing(collection, path), 0.0, PREPARED)
            if self.ask_replace("export_file", done, filepath=str(path), collection=collection.name):
                return {"CANCELLED"}
            self.can_end = False
            write(done, self.replace)
        except ExportError as error:
            self.report({"ERROR"}, f"{collection.name}: {error}")
            return {"CANCELLED"}
        remember_written(collection.adf, done.files)
        yield from part(keeping(collection, path, done.text), PREPARED, 1.0)
        for problem in (*done.notes, *done.problems):
            self.report({"WARNING"}, problem)
        self.report({"INFO"}, f"{path.name}: {len(done.written)} files written")
        return {"FINISHED"}


class ADF_OT_add_variant(bpy.types.Operator):
    """Add a variant: the same model in another file, under another namespace, moved as a whole"""

    bl_idname = "adf.add_variant"
    bl_label = "Add Variant"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(
        name="File", description="Name of the file, beside the model's own", default="variant.yaml"
    )
    namespace: bpy.props.StringProperty(name="Namespace", default="/ambf/env/variant/")
    location: bpy.props.FloatVectorProperty(name="Moved By", size=3, subtype="TRANSLATION")
    rotation: bpy.props.FloatVectorProperty(name="Turned By", size=3, subtype="EULER")

    @classmethod
    def poll(cls, context):
        collection = chosen_collection(context)
        if collection is None or collection.adf.kind != "MODEL":
            cls.poll_message_set("Make the collection of a model active")
            return False
        return True

    def execute(self, context):
        variant = chosen_collection(context).adf.variants.add()
        variant.filepath, variant.namespace = self.filepath, self.namespace
        variant.location, variant.rotation = self.location, self.rotation
        return {"FINISHED"}


class ADF_OT_export_variants(Asks, bpy.types.Operator):
    """Write all variants of the active model beside it; they share its meshes"""

    bl_idname = "adf.export_variants"
    bl_label = "Export Variants"
    bl_options = {"REGISTER", "UNDO"}

    replace: REPLACE

    @classmethod
    def poll(cls, context):
        collection = chosen_collection(context)
        if collection is None or not len(collection.adf.variants) or not collection.adf.filepath:
            cls.poll_message_set("Export a model first, and add a variant to it")
            return False
        return True

    def steps(self, context):
        if self.previewed(context):
            return {"CANCELLED"}
        collection = chosen_collection(context)
        try:
            done = yield from preparing_variants(collection)
            if self.ask_replace("export_variants", done):
                return {"CANCELLED"}
            write(done, self.replace)
        except ExportError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        remember_written(collection.adf, done.files)
        self.report({"INFO"}, f"{len(done.written)} variants written")
        return {"FINISHED"}


class ADF_OT_import_launch(Asks, bpy.types.Operator):
    """Open a launch file with its world and all its models"""

    bl_idname = "adf.import_launch"
    bl_label = "Import ADF Launch File"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.yaml", options={"HIDDEN"})
    indices: bpy.props.StringProperty(
        name="Models", description="Indices of the models to open, such as 10,11,6; all when empty"
    )
    root: FURTHER
    folders: bpy.props.StringProperty(options={"SKIP_SAVE", "HIDDEN"})

    def invoke(self, context, event):
        self.asking = True
        if self.answered:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def steps(self, context):
        path, roots = Path(bpy.path.abspath(self.filepath)), _further(self)
        try:
            chosen = tuple(int(word) for word in self.indices.replace(",", " ").split()) or None
        except ValueError:
            self.report({"ERROR"}, f"'{self.indices}' are not indices; write them as 10,11,6")
            return {"CANCELLED"}
        words = {"filepath": str(path), "indices": self.indices, "root": self.root}
        asked = yield from part(self.ask_folders("import_launch", [path], roots, **words), 0.0, ASKED)
        if asked:
            return {"CANCELLED"}
        try:
            opened = yield from part(importing_launch(path, chosen, roots), ASKED, 1.0)
        except (AdfError, OSError) as error:
            self.report({"ERROR"}, worded(error))
            return {"CANCELLED"}
        opened.add_to(context.scene)
        if roots:
            allow_folders(context.scene, [str(root) for root in roots])
        for problem in [problem for one in opened.done for problem in one.problems][:20]:
            self.report({"WARNING"}, problem)
        self.report({"INFO"}, f"{sum(one.collection is not None for one in opened.done)} files opened")
        return {"FINISHED"}


class ADF_OT_export_scene(Asks, bpy.types.Operator):
    """Write the launch file with its world and models"""

    bl_idname = "adf.export_scene"
    bl_label = "Export ADF Scene"
    bl_options = {"REGISTER", "UNDO"}

    filepath: bpy.props.StringProperty(subtype="FILE_PATH", options={"SKIP_SAVE"})
    filter_glob: bpy.props.StringProperty(default="*.yaml", options={"HIDDEN"})
    replace: REPLACE

    @classmethod
    def poll(cls, context):
        if not len(context.scene.adf.models):
            cls.poll_message_set("The scene has no model; open a launch file or make a model")
            return False
        return True

    def invoke(self, context, event):
        self.asking = True
        if self.answered:
            return self.execute(context)
        self.filepath = context.scene.adf.filepath or "launch.yaml"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def steps(self, context):
        if self.previewed(context):
            return {"CANCELLED"}
        path = Path(bpy.path.abspath(self.filepath or context.scene.adf.filepath))
        try:
            whole = yield from part(preparing_scene(context.scene, path), 0.0, PREPARED)
            if self.ask_replace("export_scene", whole.export, filepath=str(path)):
                return {"CANCELLED"}
            self.can_end = False
            write(whole.export, self.replace)
        except ExportError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        yield from part(keeping_scene(context.scene, path, whole), PREPARED, 1.0)
        self.report({"INFO"}, f"{len(whole.export.written)} files written")
        return {"FINISHED"}


def _further(operator):
    """The folders outside the scene's own that the user allows."""
    folders = [operator.root] if operator.root else []
    return tuple(Path(bpy.path.abspath(folder)) for folder in [*folders, *json.loads(operator.folders or "[]")])


def _is_launch(path):
    """Whether a file is a launch file, by the keys of one."""
    try:
        return _LAUNCH_KEY.search(path.read_bytes()) is not None
    except OSError:
        return False  # the reader reports it better


def chosen_collection(context, name=""):
    """The collection of that name, else the active one or the one around the active object that is a file."""
    if name:
        found = bpy.data.collections.get(name)
        return found if found is not None and found.adf.kind != "NONE" else None
    files = [c for c in bpy.data.collections if c.adf.kind != "NONE"]
    active = context.view_layer.active_layer_collection.collection if context.view_layer else None
    if active in files:
        return active
    obj = context.object
    holding = [c for c in files if obj is not None and obj.name in c.all_objects]
    return holding[0] if holding else files[0] if len(files) == 1 else None


def _import_entry(self, context):
    self.layout.operator(ADF_OT_import.bl_idname, text="AMBF Description Format (.yaml)")
    self.layout.operator(ADF_OT_import_launch.bl_idname, text="AMBF Launch File (.yaml)")


def _export_entry(self, context):
    self.layout.operator(ADF_OT_export.bl_idname, text="AMBF Description Format (.yaml)")
    self.layout.operator(ADF_OT_export_scene.bl_idname, text="AMBF Launch File with All Models (.yaml)")


def _file_handlers():
    """Drag and drop of scene files onto the 3D view, where Blender has it (from 4.1)."""
    if not HAS_FILE_HANDLER:
        return ()

    class ADF_FH_import(bpy.types.FileHandler):
        """Opens dropped scene files."""

        bl_idname = "ADF_FH_import"
        bl_label = "AMBF Description Format"
        bl_import_operator = "adf.import_file"
        bl_file_extensions = ".yaml;.yml;.ambf"

        @classmethod
        def poll_drop(cls, context):
            return context.area is not None and context.area.type == "VIEW_3D"

    return (ADF_FH_import,)


CLASSES = (
    ADF_OT_import,
    ADF_OT_export,
    ADF_OT_import_launch,
    ADF_OT_export_scene,
    ADF_OT_add_variant,
    ADF_OT_export_variants,
    *_file_handlers(),
)


@persistent
def _loaded(*_):
    forget_session()


def attach() -> None:
    bpy.app.handlers.load_post.append(_loaded)
    bpy.types.TOPBAR_MT_file_import.append(_import_entry)
    bpy.types.TOPBAR_MT_file_export.append(_export_entry)


def detach() -> None:
    bpy.app.handlers.load_post.remove(_loaded)
    bpy.types.TOPBAR_MT_file_import.remove(_import_entry)
    bpy.types.TOPBAR_MT_file_export.remove(_export_entry)
