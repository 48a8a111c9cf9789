"""Soft tissue: making a body tissue, its held faces, slits and layers. docs/tissue.md says what each does."""

import bmesh
import bpy
import numpy as np

from .decimals import decimals
from .held_keys import keys_of
from .key_panels import ABOVE, group_of
from .ligature.adf.schema import BY_PATH
from .object_operators import NeedsBody, active_body
from .poses import rest_pose, scaling
from .schema_properties import identifier, unset
from .tissue_grid import FACES, held_faces, surface_of, tissue_keys

MATERIALS = [
    (name, name.capitalize(), f"Numbers of {name}, docs/tissue.md")
    for name in dict.fromkeys(BY_PATH["body"]["ligature tissue.material"].choices.values())
]
BLOCK = "ligature_tissue_"
LEAST = 1e-6
"""Least edge in metres of a slit; a smaller one has no volume."""


def is_tissue(obj):
    """Whether a body states what it is as tissue."""
    return obj is not None and bool(tissue_keys(obj))


class OnTissue(NeedsBody):
    """Asks for an active body of tissue."""

    @classmethod
    def poll(cls, context):
        if not is_tissue(active_body(context, ("BODY", "SOFT_BODY"))):
            cls.poll_message_set("Make a body active that is tissue; Make Tissue makes one")
            return False
        return True


class ADF_OT_make_tissue(NeedsBody, bpy.types.Operator):
    """Make the active body soft tissue, which needles puncture at any place, or give it another material"""

    bl_idname = "adf.make_tissue"
    bl_label = "Make Tissue"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    material: bpy.props.EnumProperty(name="Material", items=MATERIALS)
    cell_size: bpy.props.FloatProperty(
        name="Cell Size", description="Edge of a cell; 0 for some 600 cells", default=0.0, min=0.0, subtype="DISTANCE",
        precision=5,
    )  # fmt: skip

    def execute(self, context):
        body = active_body(context, ("BODY", "SOFT_BODY"))
        if body is None:
            self.report({"ERROR"}, "A ghost cannot be tissue; make a body active")
            return {"CANCELLED"}
        try:
            surface_of(body)
        except ValueError as error:
            self.report({"ERROR"}, f"'{body.name}': {error}")
            return {"CANCELLED"}
        group = group_of(body)
        setattr(group, f"{BLOCK}material", self.material)
        if self.cell_size > 0.0:
            setattr(group, f"{BLOCK}cell_size", self.cell_size)
        return {"FINISHED"}


class ADF_OT_make_rigid(OnTissue, bpy.types.Operator):
    """Make the active body rigid again: all its keys of tissue are taken out"""

    bl_idname = "adf.make_rigid"
    bl_label = "Make Rigid"
    bl_options = {"REGISTER", "UNDO"}

    def execute(self, context):
        body = active_body(context, ("BODY", "SOFT_BODY"))
        group = group_of(body)
        for key in [key for key in keys_of("body") if key.path.startswith("ligature tissue.")]:
            name = identifier(key.path)
            if name in (f"{BLOCK}slits", f"{BLOCK}layers"):
                getattr(group, name).clear()
            elif hasattr(group, name):
                unset(group, name)
        return {"FINISHED"}


class ADF_OT_hold_face(OnTissue, bpy.types.Operator):
    """Let the rigid body hold a face of the tissue, or let it go"""

    bl_idname = "adf.hold_face"
    bl_label = "Hold Face"
    bl_options = {"REGISTER", "UNDO"}

    face: bpy.props.EnumProperty(
        name="Face", items=[(f, f, f"The face {f} of the tissue, along the axes of the body") for f in FACES]
    )

    def execute(self, context):
        body = active_body(context, ("BODY", "SOFT_BODY"))
        held = set(held_faces(body)) ^ {self.face}
        setattr(group_of(body), f"{BLOCK}fixed", ", ".join(face for face in FACES if face in held))
        return {"FINISHED"}


class ADF_OT_add_slit(OnTissue, bpy.types.Operator):
    """Cut the active tissue: between the selected vertices in edit mode, else at the 3D cursor, down from its top"""

    bl_idname = "adf.add_slit"
    bl_label = "Add Slit"
    bl_options = {"REGISTER", "UNDO"}

    along: bpy.props.EnumProperty(
        name="Along", items=[("X", "X", "Along X of the body"), ("Y", "Y", "Along Y of the body")]
    )
    length: bpy.props.FloatProperty(
        name="Length", description="At the 3D cursor", default=0.04, min=1e-4, subtype="DISTANCE", precision=4
    )
    depth: bpy.props.FloatProperty(
        name="Depth",
        description="Below the top; 0 goes through",
        default=0.005,
        min=0.0,
        subtype="DISTANCE",
        precision=5,
    )
    width: bpy.props.FloatProperty(
        name="Width", description="0 is a slit; else the tissue between is missing: a wound that gapes", default=0.0,
        min=0.0, subtype="DISTANCE", precision=5,
    )  # fmt: skip

    def execute(self, context):
        body = active_body(context, ("BODY", "SOFT_BODY"))
        vertices = surface_of(body)[0]
        low, high = vertices.min(axis=0), vertices.max(axis=0)
        ends = selected_points(context, body)
        axis = "XY".index(self.along)
        if ends is None:
            cursor = np.array(context.scene.cursor.location)
            T = rest_pose(body)
            middle = T[:3, :3].T @ (cursor - T[:3, 3])
            start, stop = middle[axis] - self.length / 2, middle[axis] + self.length / 2
        else:
            spans = np.ptp(ends, axis=0)[:2]
            axis = int(np.argmax(spans))
            middle, start, stop = ends.mean(axis=0), ends[:, axis].min(), ends[:, axis].max()
        across = 1 - axis
        box = np.array([low, high])
        box[0, axis], box[1, axis] = max(start, low[axis]), min(stop, high[axis])
        box[:, across] = middle[across] - self.width / 2, middle[across] + self.width / 2
        box[0, 2] = high[2] - self.depth if self.depth > 0.0 else low[2]
        if box[1, axis] - box[0, axis] < LEAST or not low[across] < middle[across] < high[across]:
            self.report(
                {"ERROR"}, f"The slit would lie outside '{body.name}'; select vertices of it, or move the cursor"
            )
            return {"CANCELLED"}
        item = getattr(group_of(body), f"{BLOCK}slits").add()
        start, stop = (decimals(np.round(corner, 6)) for corner in box)
        setattr(item, "from", start)
        item.to = stop
        return {"FINISHED"}


class ADF_OT_add_layer(OnTissue, bpy.types.Operator):
    """Add a layer below those that are there: as thick as given, or in edit mode down to the selected vertices"""

    bl_idname = "adf.add_layer"
    bl_label = "Add Layer"
    bl_options = {"REGISTER", "UNDO"}

    material: bpy.props.EnumProperty(name="Material", items=MATERIALS)
    thickness: bpy.props.FloatProperty(
        name="Thickness", description="The lowest layer takes the rest", default=0.002, min=1e-5, subtype="DISTANCE",
        precision=5,
    )  # fmt: skip

    def execute(self, context):
        body = active_body(context, ("BODY", "SOFT_BODY"))
        layers = getattr(group_of(body), f"{BLOCK}layers")
        thick = self.thickness
        points = selected_points(context, body)
        if points is not None:
            top = surface_of(body)[0][:, 2].max() - sum(layer.thickness for layer in layers)
            thick = float(top - points[:, 2].mean())
            if not thick > LEAST:
                self.report({"ERROR"}, "The selected vertices are in an existing layer; select vertices below it")
                return {"CANCELLED"}
        layer = layers.add()
        layer.thickness, layer.material = round(thick, 6), self.material
        return {"FINISHED"}


def selected_points(context, body):
    """Selected vertices (n, 3) of a body's mesh in its frame, in edit mode; None without any."""
    if context.mode != "EDIT_MESH" or context.object is not body:
        return None
    work = bmesh.from_edit_mesh(body.data)
    chosen = [vertex.co for vertex in work.verts if vertex.select]
    if not chosen:
        return None
    place = scaling(body)
    return np.array(chosen, dtype=float) @ place[:3, :3].T + place[:3, 3]


def draw_tissue(layout, context):
    """Buttons above the keys of tissue, which a rigid body does not show; returns whether they follow."""
    body = context.object
    if body.adf.role not in ("BODY", "SOFT_BODY"):
        return True
    if not is_tissue(body):
        layout.operator_menu_enum("adf.make_tissue", "material", text="Make Tissue", icon="MOD_SOFT")
        return False
    held = held_faces(body)
    column = layout.column(align=True)
    column.label(text="Held faces")
    for pair in (FACES[:2], FACES[2:4], FACES[4:]):
        row = column.row(align=True)
        for face in pair:
            row.operator("adf.hold_face", text=face, depress=face in held).face = face
    column = layout.column(align=True)
    column.operator("adf.add_slit", icon="MOD_EDGESPLIT")
    column.operator_menu_enum("adf.add_layer", "material", text="Add Layer", icon="RENDERLAYERS")
    column.operator("adf.make_rigid", icon="X")
    layout.prop(context.scene.adf, "show_tissue")
    return True


CLASSES = (
    ADF_OT_make_tissue,
    ADF_OT_make_rigid,
    ADF_OT_hold_face,
    ADF_OT_add_slit,
    ADF_OT_add_layer,
)


def attach() -> None:
    """The buttons in the panel of the keys."""
    ABOVE["Soft Tissue"] = draw_tissue


def detach() -> None:
    """Take them away."""
    ABOVE.clear()
