"""Import and export of model, world and launch files, with entries in the File menu."""

import re
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from .compat import HAS_FILE_HANDLER
from .dialogs import Asks
from .folders import allow_folders, forget_session
from .launch_file import export_scene, import_launch, prepared_scene
from .ligature.adf import AdfError
from .read_file import import_file, worded
from .write_file import ExportError, after_export, export_file, export_variants, prepared, prepared_variants

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

    def invoke(self, context, event):
        self.asking = True
        if self.filepath or self.files:
            return self.execute(context)
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        paths = [Path(self.directory, item.name) for item in self.files if item.name] or [Path(self.filepath)]
        paths = [Path(bpy.path.abspath(str(path))) for path in paths]
        files = [{"name": item.name} for item in self.files]
        asked = self.ask_folders(
            "import_file", paths, filepath=self.filepath, directory=self.directory, files=files, root=self.root
        )
        if asked is not None:
            return asked
        opened = 0
        roots = _further(context.scene, self.root)
        for path in paths:
            try:
                launch = _is_launch(path)
                done = (
                    import_launch(path, context.scene, roots=roots)
                    if launch
                    else [import_file(path, context.scene, roots)]
                )
            except (AdfError, OSError) as error:
                self.report({"ERROR"}, worded(error))
                continue
            opened += 1
            for problem in [problem for one in done for problem in one.problems][:20]:
                self.report({"WARNING"}, problem)
            self.report({"INFO"}, f"{path.name}: {sum(len(one.collection.all_objects) for one in done)} objects")
        return {"FINISHED"} if opened else {"CANCELLED"}


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
        collection = chosen_collection(context, self.collection)
        if collection is not None:
            self.filepath = collection.adf.filepath or f"{collection.name}.yaml"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        collection = chosen_collection(context, self.collection)
        if collection is None:
            self.report({"ERROR"}, "No collection is an ADF file; make the one to be written active")
            return {"CANCELLED"}
        if self.previewed(context):
            return {"CANCELLED"}
        path = Path(bpy.path.abspath(self.filepath or collection.adf.filepath))
        try:
            if self.by_user():
                words = {"filepath": str(path), "collection": collection.name}
                asked = self.ask_replace("export_file", prepared(collection, path), **words)
                if asked is not None:
                    return asked
            done = export_file(collection, path, self.replace)
        except ExportError as error:
            self.report({"ERROR"}, f"{collection.name}: {error}")
            return {"CANCELLED"}
        after_export(collection, path, done.text)
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

    def invoke(self, context, event):
        self.asking = True
        return self.execute(context)

    def execute(self, context):
        if self.previewed(context):
            return {"CANCELLED"}
        try:
            if self.by_user():
                asked = self.ask_replace("export_variants", prepared_variants(chosen_collection(context)))
                if asked is not None:
                    return asked
            written = export_variants(chosen_collection(context), self.replace)
        except ExportError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{len(written)} variants written")
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

    def invoke(self, context, event):
        self.asking = True
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        try:
            chosen = tuple(int(word) for word in self.indices.replace(",", " ").split()) or None
            path = Path(bpy.path.abspath(self.filepath))
            words = {"filepath": str(path), "indices": self.indices, "root": self.root}
            asked = self.ask_folders("import_launch", [path], **words)
            if asked is not None:
                return asked
            done = import_launch(path, context.scene, chosen, _further(context.scene, self.root))
        except ValueError:
            self.report({"ERROR"}, f"'{self.indices}' are not indices; write them as 10,11,6")
            return {"CANCELLED"}
        except (AdfError, OSError) as error:
            self.report({"ERROR"}, worded(error))
            return {"CANCELLED"}
        for problem in [problem for one in done for problem in one.problems][:20]:
            self.report({"WARNING"}, problem)
        self.report({"INFO"}, f"{len(done)} files opened")
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
        self.filepath = context.scene.adf.filepath or "launch.yaml"
        context.window_manager.fileselect_add(self)
        return {"RUNNING_MODAL"}

    def execute(self, context):
        if self.previewed(context):
            return {"CANCELLED"}
        try:
            path = Path(bpy.path.abspath(self.filepath or context.scene.adf.filepath))
            if self.by_user():
                asked = self.ask_replace("export_scene", prepared_scene(context.scene, path)[0], filepath=str(path))
                if asked is not None:
                    return asked
            written = export_scene(context.scene, path, replace=self.replace)
        except ExportError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"{len(written)} files written")
        return {"FINISHED"}


def _further(scene, folder):
    """The folder that the user allows, remembered with the scene."""
    if not folder:
        return ()
    allow_folders(scene, [bpy.path.abspath(folder)])
    return (Path(bpy.path.abspath(folder)),)


def _is_launch(path):
    """Whether a file is a launch file, by the keys of one."""
    try:
        return re.search(rb"^(multibody configs|world config)\s*:", path.read_bytes(), re.MULTILINE) is not None
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
