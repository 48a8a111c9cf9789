"""Adopt AMBF Scene: makes a model of what the original add-on, or Blender's own rigid bodies, hold."""

import bpy

from .adopting import adopt

REPORT = "Adopted AMBF Scene"


class ADF_OT_adopt(bpy.types.Operator):
    """Make a model of objects of the original AMBF add-on, or of Blender's rigid bodies; a text holds the report"""

    bl_idname = "adf.adopt"
    bl_label = "Adopt AMBF Scene"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        try:
            lines = adopt(context.scene).lines()
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        text = bpy.data.texts.get(REPORT) or bpy.data.texts.new(REPORT)
        text.from_string("\n".join(lines))
        for line in lines[:1]:
            self.report({"INFO"}, f"{line}; the text '{REPORT}' has the whole report")
        return {"FINISHED"}


CLASSES = (ADF_OT_adopt,)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
