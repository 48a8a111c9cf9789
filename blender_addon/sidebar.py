"""The sidebar: files, launch, creation, collision, findings, preview; drawn from stored values only."""

import bpy

from . import making
from .decompose_operators import packages
from .file_operators import chosen_collection
from .pose_operators import model_of
from .preview_operators import is_previewing
from .properties import KIND_OF_ROLE, ROLES

ICON_OF_ROLE = {item[0]: item[3] for item in ROLES}


class Sidebar:
    """Where the scene's panels are."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "ADF"


def _above(layout, group, name):
    """Draw a property below its label, since a narrow sidebar would cut the label off; a checkbox beside its label."""
    shown = group.bl_rna.properties[name]
    if shown.type == "BOOLEAN":
        layout.prop(group, name)
        return
    column = layout.column(align=True)
    column.label(text=shown.name)
    column.prop(group, name, text="")


class ADF_UL_objects(bpy.types.UIList):
    """Objects of the file, with a search."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        row = layout.row(align=True)
        row.label(text=item.name, icon=ICON_OF_ROLE.get(item.adf.role, "BLANK1"))
        if item.adf.role == "BODY":
            row.label(text=f"{item.adf.body.mass:.3g} kg")

    def filter_items(self, context, data, name):
        text = self.filter_name.lower()
        shown = [
            self.bitflag_filter_item if o.adf.role in KIND_OF_ROLE and text in o.name.lower() else 0
            for o in getattr(data, name)
        ]
        return shown, []


class ADF_UL_findings(bpy.types.UIList):
    """Findings of Check Scene."""

    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index):
        row = layout.row(align=True)
        row.alert = item.severity == "ERROR"
        row.label(text=item.message, icon={"ERROR": "ERROR", "WARNING": "INFO"}.get(item.severity, "DOT"))
        select = row.operator("adf.select_finding", text="", icon="RESTRICT_SELECT_OFF", emboss=False)
        select.index = index


class ADF_PT_file(Sidebar, bpy.types.Panel):
    """Files of the scene."""

    bl_label = "File"

    def draw(self, context):
        layout = self.layout
        row = layout.row(align=True)
        row.operator("adf.import_file", text="Import", icon="IMPORT")
        row.operator("adf.export_file", text="Export", icon="EXPORT")
        row = layout.row(align=True)
        row.operator("adf.import_launch", text="Import Launch")
        row.operator("adf.export_scene", text="Export Scene")
        layout.operator_menu_enum("adf.new_file", "kind", text="New File", icon="ADD")
        row = layout.row(align=True)
        row.operator("adf.import_robot", text="Import URDF")
        row.operator("adf.export_robot", text="Export URDF")
        layout.operator("adf.adopt", icon="IMPORT")
        collection = making.file_of(context.object) or chosen_collection(context)
        if collection is None:
            return
        box = layout.box()
        box.label(text=collection.name, icon="OUTLINER_COLLECTION")
        _above(box, collection.adf, "filepath")
        group = getattr(collection.adf, collection.adf.kind.lower(), None)
        for name in (
            "namespace",
            "high_resolution_path",
            "low_resolution_path",
            "ignore_inter_collision",
            "gravity",
            "environment",
        ):
            if group is not None and hasattr(group, name):
                row = box.column()
                row.active = group.is_property_set(name)  # what the file does not give is dim
                _above(row, group, name)
        for index, variant in enumerate(collection.adf.variants):
            row = layout.row(align=True)
            row.prop(variant, "filepath", text=str(index))
            row.prop(variant, "namespace", text="")
        if collection.adf.kind == "MODEL":
            row = layout.row(align=True)
            row.operator("adf.add_variant", icon="ADD")
            row.operator("adf.export_variants")
        layout.template_list(
            "ADF_UL_objects", "", collection, "all_objects", context.scene.adf, "active_object", rows=4
        )


class ADF_PT_launch(Sidebar, bpy.types.Panel):
    """The launch file's models and world."""

    bl_label = "Launch"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout, stored = self.layout, context.scene.adf
        for name in ("filepath", "world", "world_path", "environment"):
            _above(layout, stored, name)
        for index, entry in enumerate(stored.models):
            row = layout.row(align=True)
            row.label(text=str(index))
            row.prop(entry, "collection", text="")
            row.prop(entry, "path", text="")
            row.operator("adf.remove_from_launch", text="", icon="REMOVE").index = index
        layout.operator("adf.add_to_launch", icon="ADD")


class ADF_PT_create(Sidebar, bpy.types.Panel):
    """Making objects part of the file, and adding new ones."""

    bl_label = "Create"

    def draw(self, context):
        layout = self.layout
        layout.operator_menu_enum("adf.make", "role", text="Make Selected", icon="CHECKMARK")
        layout.operator_menu_enum("adf.add", "role", text="Add Object", icon="ADD")
        layout.operator_menu_enum("adf.connect", "type", text="Connect by Joint", icon="CONSTRAINT")
        layout.operator("adf.duplicate", icon="DUPLICATE")
        layout.operator("adf.mirror", icon="MOD_MIRROR")
        column = layout.column(align=True)
        column.operator("adf.add_needle", icon="CURVE_NCIRCLE")
        column.operator("adf.add_suture", icon="CURVE_DATA")
        column.operator("adf.add_hole", icon="MESH_TORUS")
        column.operator("adf.add_grasp", icon="SNAP_ON")
        column.operator("adf.add_endoscope", icon="CAMERA_STEREO")
        column.operator_menu_enum("adf.add_sensor", "which", text="Add Sensor", icon="OUTLINER_OB_FORCE_FIELD")


class ADF_PT_batch(Sidebar, bpy.types.Panel):
    """Editing a selection."""

    bl_label = "Selection"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        column = self.layout.column(align=True)
        column.operator_menu_enum("adf.copy_keys", "panel", text="Copy Keys to Selected", icon="COPYDOWN")
        column.operator("adf.copy_shapes", icon="MOD_PHYSICS")
        column.operator("adf.edit_selected", icon="DRIVER_TRANSFORM")
        column.operator_menu_enum("adf.set_gains", "output", text="Set Controller Gains", icon="FORCE_HARMONIC")


class ADF_PT_collision(Sidebar, bpy.types.Panel):
    """Collision shapes and inertia of the active body."""

    bl_label = "Collision and Inertia"

    def draw(self, context):
        layout = self.layout
        layout.operator_menu_enum("adf.add_shape", "kind", text="Add Primitive", icon="MESH_CUBE")
        layout.operator_menu_enum("adf.fit_shape", "kind", text="Fit Primitive", icon="MOD_SHRINKWRAP")
        layout.operator_menu_enum("adf.add_hull", "around", text="Add Convex Hull", icon="MESH_ICOSPHERE")
        layout.operator("adf.add_ring", icon="MESH_CIRCLE")
        layout.operator("adf.low_resolution", icon="MOD_DECIM")
        if packages():
            layout.operator("adf.decompose", icon="MOD_EXPLODE")
        else:
            column = layout.column(align=True)
            for words in (
                "Convex pieces need CoACD, which",
                "this Blender lacks: about 5 MB from",
                "the package index pypi.org.",
            ):
                column.label(text=words)
            column.operator("adf.fetch_coacd", icon="IMPORT")
        row = layout.row(align=True)
        row.operator("adf.measure_collision", icon="DRIVER_DISTANCE")
        row.prop(context.scene.adf, "show_quality", text="", icon="OVERLAY")
        layout.operator_menu_enum("adf.set_inertia", "source", text="Set Inertia From", icon="PHYSICS")


class ADF_PT_check(Sidebar, bpy.types.Panel):
    """Findings."""

    bl_label = "Check"

    def draw(self, context):
        layout, stored = self.layout, context.scene.adf
        layout.operator("adf.check", icon="VIEWZOOM")
        collection = chosen_collection(context)
        if collection is not None and collection.adf.filepath:
            layout.label(text=f"Export writes {bpy.path.basename(collection.adf.filepath)}", icon="FILE")
        if not len(stored.findings):
            return
        layout.template_list("ADF_UL_findings", "", stored, "findings", stored, "active_finding", rows=5)
        if stored.active_finding < len(stored.findings):
            layout.label(text=stored.findings[stored.active_finding].hint)
        row = layout.row(align=True)
        row.operator("adf.fix", text="Fix").everything = False
        row.operator("adf.fix", text="Fix All").everything = True
        row.operator("adf.copy_findings", text="Copy")


class ADF_PT_preview(Sidebar, bpy.types.Panel):
    """Joint preview and simulation."""

    bl_label = "Preview"

    def draw(self, context):
        layout = self.layout
        layout.prop(context.scene.adf, "show_overlay")
        layout.operator("adf.move_joint", icon="CON_ROTLIKE")
        row = layout.row()
        row.alert = is_previewing(context.scene)
        row.operator("adf.rest_pose", icon="LOOP_BACK")
        layout.operator("adf.store_pose", icon="BOOKMARKS")
        file = model_of(context)
        for pose in file.adf.poses if file is not None else ():
            row = layout.row(align=True)
            row.operator("adf.show_pose", text=pose.name, icon="ARMATURE_DATA").name = pose.name
            row.operator("adf.remove_pose", text="", icon="REMOVE").name = pose.name
        layout.operator("adf.simulate", icon="PLAY")
        layout.operator("adf.clear_motion", icon="X")


CLASSES = (
    ADF_UL_objects,
    ADF_UL_findings,
    ADF_PT_file,
    ADF_PT_launch,
    ADF_PT_create,
    ADF_PT_batch,
    ADF_PT_collision,
    ADF_PT_check,
    ADF_PT_preview,
)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
