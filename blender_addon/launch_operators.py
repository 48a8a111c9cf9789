"""Which models a launch file lists: adding the active file, taking an entry out."""

import os
from pathlib import Path

import bpy

from .file_operators import chosen_collection


class ADF_OT_add_to_launch(bpy.types.Operator):
    """List the active file in the launch file: a model at the end, a world or the input devices in their place"""

    bl_idname = "adf.add_to_launch"
    bl_label = "Add to Launch"
    bl_options = {"REGISTER", "UNDO"}

    path: bpy.props.StringProperty(
        name="Path", description="Path from the launch file's folder; the file's own when empty"
    )

    environment: bpy.props.BoolProperty(
        name="As Environment", description="Make the model the surroundings that the world file names"
    )

    @classmethod
    def poll(cls, context):
        collection = chosen_collection(context)
        if collection is None or collection.adf.kind == "NONE":
            cls.poll_message_set("Make the collection of a file active")
            return False
        return True

    def execute(self, context):
        stored, collection = context.scene.adf, chosen_collection(context)
        path = self.path or _relative(collection, stored)
        name = {"WORLD": "world", "INPUT_DEVICES": "devices", "OTHER": "colours"}.get(collection.adf.kind)
        if name is not None:
            setattr(stored, name, collection)
            setattr(stored, f"{name}_path", path)
            return {"FINISHED"}
        if self.environment:
            return self._surround(stored, collection, path)
        if any(entry.collection is collection for entry in stored.models):
            self.report({"ERROR"}, f"'{collection.name}' is listed already")
            return {"CANCELLED"}
        entry = stored.models.add()
        entry.collection, entry.path = collection, path
        return {"FINISHED"}

    def _surround(self, stored, collection, path):
        if stored.world is None or collection.adf.kind != "MODEL":
            self.report({"ERROR"}, f"'{collection.name}': surroundings are a model, and need a world; make one first")
            return {"CANCELLED"}
        stored.environment = collection
        stored.world.adf.world.environment = path
        return {"FINISHED"}


class ADF_OT_remove_from_launch(bpy.types.Operator):
    """Take a model out of the launch file; its collection stays"""

    bl_idname = "adf.remove_from_launch"
    bl_label = "Take Out of Launch"
    bl_options = {"REGISTER", "UNDO"}

    index: bpy.props.IntProperty(name="Index", description="Place in the list, from 0", min=0)

    @classmethod
    def poll(cls, context):
        if not len(context.scene.adf.models):
            cls.poll_message_set("The launch file lists no model")
            return False
        return True

    def execute(self, context):
        models = context.scene.adf.models
        if self.index >= len(models):
            self.report({"ERROR"}, f"the launch file lists {len(models)} models; index {self.index} is out of range")
            return {"CANCELLED"}
        models.remove(self.index)
        return {"FINISHED"}


def _relative(collection, stored):
    """The file's path from the folder of the launch file, or its name where one of both is not saved yet."""
    if not collection.adf.filepath or not stored.filepath:
        return Path(collection.adf.filepath).name or f"{collection.name}.yaml"
    folder = Path(bpy.path.abspath(stored.filepath)).parent
    return Path(os.path.relpath(bpy.path.abspath(collection.adf.filepath), folder)).as_posix()


CLASSES = (ADF_OT_add_to_launch, ADF_OT_remove_from_launch)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
