"""Menus, the pie menu on Ctrl Alt A, and the preferences."""

from pathlib import Path

import bpy

from .object_operators import OBJECT_ROLES


class ADF_MT_add(bpy.types.Menu):
    """Everything that can be added to a file."""

    bl_label = "ADF"

    def draw(self, context):
        layout = self.layout
        for role, name, _, icon, _ in OBJECT_ROLES:
            if role not in ("BODY", "JOINT", "INPUT_DEVICE"):
                layout.operator("adf.add", text=name, icon=icon).role = role
        layout.separator()
        for name in ("adf.add_needle", "adf.add_suture", "adf.add_hole", "adf.add_grasp", "adf.add_endoscope"):
            layout.operator(name)


class ADF_MT_object(bpy.types.Menu):
    """What can be done with the selected objects."""

    bl_label = "ADF"

    def draw(self, context):
        layout = self.layout
        layout.operator_menu_enum("adf.make", "role", text="Make")
        layout.operator_menu_enum("adf.connect", "type", text="Connect")
        layout.operator("adf.duplicate")
        layout.operator("adf.mirror")
        layout.operator("adf.clear_role")
        layout.operator_menu_enum("adf.fit_shape", "kind", text="Fit Primitive")
        layout.operator("adf.low_resolution")
        layout.operator("adf.decompose")
        layout.operator_menu_enum("adf.set_inertia", "source", text="Set Inertia From")
        layout.separator()
        layout.operator_menu_enum("adf.copy_keys", "panel", text="Copy Keys to Selected")
        layout.operator("adf.copy_shapes")
        layout.operator("adf.edit_selected")
        layout.operator("adf.set_gains")


class ADF_MT_pie(bpy.types.Menu):
    """The most used operators around the pointer."""

    bl_label = "ADF"

    def draw(self, context):
        pie = self.layout.menu_pie()
        pie.operator_menu_enum("adf.make", "role", text="Make")
        pie.operator_menu_enum("adf.connect", "type", text="Connect")
        pie.operator_menu_enum("adf.fit_shape", "kind", text="Fit Primitive")
        pie.operator("adf.set_inertia")
        pie.operator("adf.move_joint")
        pie.operator("adf.check")
        pie.operator("adf.simulate")
        pie.operator("adf.export_file")


class ADF_Preferences(bpy.types.AddonPreferences):
    """What belongs to the user rather than to a scene."""

    bl_idname = __package__

    simulator: bpy.props.StringProperty(
        name="Simulator", description="Command that starts Ligature; the one on the path when empty", default=""
    )

    def draw(self, context):
        self.layout.prop(self, "simulator")
        guide = Path(__file__).with_name("blender.md")
        if guide.is_file():
            self.layout.operator("wm.url_open", text="Documentation", icon="HELP").url = guide.as_uri()


def _add_entry(self, context):
    self.layout.menu("ADF_MT_add", icon="RIGID_BODY")


def _object_entry(self, context):
    self.layout.menu("ADF_MT_object", icon="RIGID_BODY")


CLASSES = (ADF_MT_add, ADF_MT_object, ADF_MT_pie, ADF_Preferences)
_KEYS = []


def attach() -> None:
    """Menu entries, and the pie menu on Ctrl Alt A."""
    bpy.types.VIEW3D_MT_add.append(_add_entry)
    bpy.types.VIEW3D_MT_object_context_menu.append(_object_entry)
    configuration = bpy.context.window_manager.keyconfigs.addon
    if configuration is not None:  # there is none in the background
        keymap = configuration.keymaps.new(name="3D View", space_type="VIEW_3D")
        item = keymap.keymap_items.new("wm.call_menu_pie", "A", "PRESS", ctrl=True, alt=True)
        item.properties.name = "ADF_MT_pie"
        _KEYS.append((keymap, item))


def detach() -> None:
    """Take them away."""
    for keymap, item in _KEYS:
        keymap.keymap_items.remove(item)
    _KEYS.clear()
    bpy.types.VIEW3D_MT_object_context_menu.remove(_object_entry)
    bpy.types.VIEW3D_MT_add.remove(_add_entry)
