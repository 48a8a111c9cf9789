"""The panels of an object's keys, in Properties > Physics: drawn from stored values only, nothing is computed here."""

import bpy

from . import making
from .held_keys import keys_of
from .ligature.adf.schema import SCHEMA, Type
from .properties import KIND_OF_ROLE
from .schema_properties import SHOWN_UNITS, identifier, unset

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
    "Soft Tissue": ("ligature tissue",),
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


SLIDING = ("prismatic", "linear spring")
SPRINGS = ("linear spring", "torsion spring")
MOTORS = ("controller", "controller output type", "max motor impulse")
OF_TYPE = {
    "joint limits": lambda kind, path: (
        kind.startswith("six dof") if path.count(".") > 1
        else kind == "cone twist" if path[-2:] in (".x", ".y", ".z")
        else kind in ("revolute", "prismatic", *SPRINGS)
    ),
    "stiffness": lambda kind, path: kind == "six dof spring" if "." in path else kind in SPRINGS,
    **{name: lambda kind, path: kind in ("revolute", "prismatic", *SPRINGS) for name in MOTORS},
}  # fmt: skip
OF_TYPE["damping"] = OF_TYPE["equilibrium point"] = OF_TYPE["stiffness"]
"""Whether a joint of a type has a key, by the key's first word."""


def has_effect(group, kind, key):
    """Whether a key does something for a joint of its type; one that the file gives is shown all the same."""
    name = key.path.split(".")[0]
    if kind != "joint" or name not in OF_TYPE or group.is_property_set(identifier(key.path)):
        return True
    return OF_TYPE[name](group.type, key.path)


def unit_of(group, kind, key):
    """The unit of a number, of a joint by its type and axis; empty where Blender shows it."""
    units = key.unit.split(", ") if key.unit else []
    if key.unit in SHOWN_UNITS or not units:
        return ""
    if len(units) == 1 or kind != "joint":
        return key.unit
    slides = ".linear." in key.path if group.type.startswith("six dof") else group.type in SLIDING
    turning = [unit for unit in units if "rad" in unit or unit == "N·m·s"]
    return next((unit for unit in units if (unit in turning) != slides), units[0])


def draw_keys(layout, group, kind, keys):
    """Rows of properties; those that the file does not give are dim, those that it gives can be taken out."""
    layout.use_property_split = True
    layout.use_property_decorate = False
    block = ""
    for key in [key for key in keys if has_effect(group, kind, key)]:
        name, unit = identifier(key.path), unit_of(group, kind, key)
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
            if unit:
                body.prop(group, shown, text=f"{group.bl_rna.properties[shown].name} ({unit})")
            else:
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
            if obj.adf.called and obj.adf.called != obj.name:
                layout.label(text="Renamed: the export writes the new name", icon="INFO")
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
        elif obj.adf.role in making.PARENTED:
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


ABOVE: dict = {}
"""What other modules draw above the keys of a sub-panel, by its name: functions that return whether keys follow."""


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
        if category in ABOVE and not ABOVE[category](self.layout, context):
            return
        draw_keys(self.layout, group_of(context.object), kind, SHOWN[kind][category])

    name = "ADF_PT_keys_" + identifier(category)
    options = set() if category in ("Type and Limits", "Mass", "Soft Tissue") else {"DEFAULT_CLOSED"}
    return type(
        name, (Physics, bpy.types.Panel),
        {"bl_label": category, "bl_idname": name, "bl_parent_id": "ADF_PT_object", "bl_options": options,
         "poll": classmethod(poll), "draw": draw, "__doc__": f"{category} of the active object."},
    )  # fmt: skip


SUB_PANELS = tuple(_sub_panel(category) for category in (*CATEGORIES, OTHER))


CLASSES = (ADF_OT_unset_key, ADF_OT_edit_list, ADF_PT_object, *SUB_PANELS)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
