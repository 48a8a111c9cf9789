"""Panels, lists, menus and preferences; drawn from stored values only, nothing is computed or changed here."""

import bpy

from . import making
from .file_operators import chosen_collection
from .ligature.adf.schema import SCHEMA, Type
from .object_operators import OBJECT_ROLES
from .preview_operators import is_previewing
from .properties import KIND_OF_ROLE, ROLES
from .schema_properties import identifier, keys_of, unset

ICON_OF_ROLE = {item[0]: item[3] for item in ROLES}
CATEGORIES = {
    "Identity": ("name", "namespace", "passive", "publish frequency"),
    "Type and Limits": (
        "type",
        "joint limits",
        "max motor impulse",
        "enable feedback",
        "ignore inter-collision",
        "joint erp",
        "joint cfm",
    ),
    "Springs": ("stiffness", "damping", "equilibrium point"),
    "Mass": ("mass", "inertia", "inertial offset", "gravity"),
    "Surface": ("friction", "restitution"),
    "Collision": ("collision mesh", "collision mesh type", "collision margin", "collision groups", "scale"),
    "Looks": ("mesh", "mesh remove duplicates", "color rgba", "color components", "use material", "visible", "shaders"),
    "Controller": ("controller", "controller output type"),
    "Publishing": (
        "publish children names",
        "publish joint names",
        "publish joint positions",
        "publish image",
        "publish depth",
    ),
}
OTHER = "Other Keys"


def category_of(kind, key):
    """The sub-panel that shows a key."""
    top = key.path.split(".")[0]
    if kind == "body" and top == "damping":
        return "Surface"
    for category, names in CATEGORIES.items():
        if top in names or (category == "Publishing" and top.startswith("publish ") and top != "publish frequency"):
            return category
    return OTHER


SHOWN = {
    kind: {
        category: [key for key in keys_of(kind) if category_of(kind, key) == category]
        for category in (*CATEGORIES, OTHER)
    }
    for kind in SCHEMA
}
"""Keys by kind and sub-panel, worked out once."""


def draw_keys(layout, group, kind, keys):
    """Rows of properties; those that the file does not give are dim, those that it gives can be taken out."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    block = ""
    for key in keys:
        name = identifier(key.path)
        if key.block != block:
            block = key.block
            if block:
                layout.label(text=block.replace(".", " · ").title())
        if key.type is Type.MAPS:
            _draw_list(layout, group, kind, name, key)
            continue
        names = [f"{name}_position", f"{name}_orientation"] if key.type is Type.POSE else [name]
        for shown in names:
            row = layout.row(align=True)
            given = group.is_property_set(shown)
            body = row.row()
            body.active = given or key.required
            body.prop(group, shown)
            if given and not key.required:
                operator = row.operator("adf.unset_key", text="", icon="X", emboss=False)
                operator.name = shown


def _draw_list(layout, group, kind, name, key):
    box = layout.box()
    head = box.row()
    head.label(text=key.name.title())
    add = head.operator("adf.edit_list", text="", icon="ADD", emboss=False)
    add.name, add.index = name, -1
    for index, item in enumerate(getattr(group, name)):
        row = box.row()
        column = row.column()
        for field in item.bl_rna.properties:
            if field.identifier not in ("rna_type", "name") or field.identifier in type(item).__annotations__:
                column.prop(item, field.identifier)
        remove = row.operator("adf.edit_list", text="", icon="REMOVE", emboss=False)
        remove.name, remove.index = name, index


class ADF_OT_unset_key(bpy.types.Operator):
    """Take the key out of the file, so that its default counts"""

    bl_idname = "adf.unset_key"
    bl_label = "Take Key Out"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    name: bpy.props.StringProperty()

    @classmethod
    def poll(cls, context):
        if not making.is_file_object(context.object):
            cls.poll_message_set("Make an object of a file active")
            return False
        return True

    def execute(self, context):
        unset(group_of(context.object), self.name)
        return {"FINISHED"}


class ADF_OT_edit_list(bpy.types.Operator):
    """Add an item to the list, or remove one"""

    bl_idname = "adf.edit_list"
    bl_label = "Edit List"
    bl_options = {"REGISTER", "UNDO", "INTERNAL"}

    name: bpy.props.StringProperty()
    index: bpy.props.IntProperty(default=-1)

    @classmethod
    def poll(cls, context):
        if not making.is_file_object(context.object):
            cls.poll_message_set("Make an object of a file active")
            return False
        return True

    def execute(self, context):
        items = getattr(group_of(context.object), self.name, None)
        if items is None:
            self.report({"ERROR"}, f"there is no list '{self.name}'")
            return {"CANCELLED"}
        if self.index < 0:
            items.add()
        else:
            items.remove(self.index)
        return {"FINISHED"}


def group_of(obj):
    """The keys of an object."""
    return getattr(obj.adf, identifier(KIND_OF_ROLE[obj.adf.role]))


class Physics:
    """Where an object's panels are."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "physics"


class ADF_PT_object(Physics, bpy.types.Panel):
    """Role and identifier of the active object."""

    bl_label = "ADF"

    @classmethod
    def poll(cls, context):
        return context.object is not None

    def draw(self, context):
        layout, obj = self.layout, context.object
        layout.use_property_split = True
        layout.prop(obj.adf, "role")
        if making.is_file_object(obj):
            layout.prop(obj.adf, "key")
            layout.prop(obj.adf, "export")
            self._ends(layout, obj)
        elif obj.adf.role == "SHAPE":
            self._shape(layout, obj.adf.shape)

    def _ends(self, layout, obj):
        if obj.adf.role == "JOINT":
            layout.prop(obj.adf, "parent_object")
            layout.prop(obj.adf, "child_object")
            if obj.adf.parent_object is None:
                layout.prop(obj.adf, "parent_text")
            if obj.adf.child_object is None:
                layout.prop(obj.adf, "child_text")
        elif obj.adf.role in making.HANGING:
            if obj.parent is None:
                layout.prop(obj.adf, "parent_text")
            else:
                layout.prop(obj, "parent")

    def _shape(self, layout, shape):
        layout.prop(shape, "kind")
        layout.prop(shape, "use")
        names = {"BOX": ("size",), "SPHERE": ("radius",), "PLANE": ("normal", "offset")}
        for name in names.get(shape.kind, ("radius", "height", "axis")):
            layout.prop(shape, name)
        layout.operator("adf.redraw_shape")


def _sub_panel(category):
    def poll(cls, context):
        obj = context.object
        return making.is_file_object(obj) and bool(SHOWN[KIND_OF_ROLE[obj.adf.role]][category])

    def draw(self, context):
        kind = KIND_OF_ROLE[context.object.adf.role]
        if category == "Mass" and kind == "body":
            row = self.layout.row()
            row.operator("adf.set_inertia", icon="PHYSICS")
            self.layout.prop(context.object.adf, "inertia_factor")
        draw_keys(self.layout, group_of(context.object), kind, SHOWN[kind][category])

    name = "ADF_PT_keys_" + identifier(category)
    options = set() if category in ("Type and Limits", "Mass") else {"DEFAULT_CLOSED"}
    return type(
        name, (Physics, bpy.types.Panel),
        {"bl_label": category, "bl_idname": name, "bl_parent_id": "ADF_PT_object", "bl_options": options,
         "poll": classmethod(poll), "draw": draw, "__doc__": f"{category} of the active object."},
    )  # fmt: skip


SUB_PANELS = tuple(_sub_panel(category) for category in (*CATEGORIES, OTHER))


class Sidebar:
    """Where the scene's panels are."""

    bl_space_type = "VIEW_3D"
    bl_region_type = "UI"
    bl_category = "ADF"


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
        collection = making.file_of(context.object) or chosen_collection(context)
        if collection is None:
            return
        box = layout.box()
        box.use_property_split = True
        box.label(text=collection.name, icon="OUTLINER_COLLECTION")
        box.prop(collection.adf, "filepath")
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
                row.prop(group, name)
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
        layout.use_property_split = True
        layout.prop(stored, "filepath")
        layout.prop(stored, "world")
        layout.prop(stored, "world_path")
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
        column = layout.column(align=True)
        column.operator("adf.add_needle", icon="CURVE_NCIRCLE")
        column.operator("adf.add_suture", icon="CURVE_DATA")
        column.operator("adf.add_hole", icon="MESH_TORUS")
        column.operator("adf.add_grasp", icon="SNAP_ON")
        column.operator("adf.add_endoscope", icon="CAMERA_STEREO")


class ADF_PT_collision(Sidebar, bpy.types.Panel):
    """Collision shapes and inertia of the active body."""

    bl_label = "Collision and Inertia"

    def draw(self, context):
        layout = self.layout
        layout.operator_menu_enum("adf.add_shape", "kind", text="Add Primitive", icon="MESH_CUBE")
        layout.operator_menu_enum("adf.fit_shape", "kind", text="Fit Primitive", icon="MOD_SHRINKWRAP")
        layout.operator("adf.add_hull", icon="MESH_ICOSPHERE")
        layout.operator("adf.decompose", icon="MOD_EXPLODE")
        layout.operator_menu_enum("adf.set_inertia", "source", text="Set Inertia From", icon="PHYSICS")


class ADF_PT_check(Sidebar, bpy.types.Panel):
    """Findings."""

    bl_label = "Check"

    def draw(self, context):
        layout, stored = self.layout, context.scene.adf
        layout.operator("adf.check", icon="VIEWZOOM")
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
        layout.operator("adf.simulate", icon="PLAY")
        layout.operator("adf.clear_motion", icon="X")


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
        layout.operator("adf.clear_role")
        layout.operator_menu_enum("adf.fit_shape", "kind", text="Fit Primitive")
        layout.operator("adf.decompose")
        layout.operator_menu_enum("adf.set_inertia", "source", text="Set Inertia From")


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


def _add_entry(self, context):
    self.layout.menu("ADF_MT_add", icon="RIGID_BODY")


def _object_entry(self, context):
    self.layout.menu("ADF_MT_object", icon="RIGID_BODY")


CLASSES = (
    ADF_OT_unset_key,
    ADF_OT_edit_list,
    ADF_UL_objects,
    ADF_UL_findings,
    ADF_PT_object,
    *SUB_PANELS,
    ADF_PT_file,
    ADF_PT_launch,
    ADF_PT_create,
    ADF_PT_collision,
    ADF_PT_check,
    ADF_PT_preview,
    ADF_MT_add,
    ADF_MT_object,
    ADF_MT_pie,
    ADF_Preferences,
)
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
