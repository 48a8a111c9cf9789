"""Operators that add what bodies collide with: primitives, hulls, rings."""

import bmesh
import bpy
import numpy as np

from . import making
from .ligature.adf.frames import pose_matrix
from .ligature.authoring.rings import capsules_along, edge_loops
from .ligature.authoring.shapes import Shape, fitted, oriented
from .mesh_reading import points_of, surfaces_of
from .object_operators import NeedsBody, active_body
from .poses import scaling
from .properties import SHAPE_KINDS, USES
from .solids import own_solid


class ADF_OT_add_shape(NeedsBody, bpy.types.Operator):
    """Add a primitive to the active body"""

    bl_idname = "adf.add_shape"
    bl_label = "Add Primitive"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    kind: bpy.props.EnumProperty(name="Shape", items=SHAPE_KINDS)
    use: bpy.props.EnumProperty(name="Use", items=USES)
    size: bpy.props.FloatVectorProperty(name="Size", size=3, default=(0.1, 0.1, 0.1), min=1e-6, subtype="XYZ_LENGTH")
    radius: bpy.props.FloatProperty(name="Radius", default=0.05, min=1e-6, subtype="DISTANCE", precision=5)
    height: bpy.props.FloatProperty(name="Height", default=0.2, min=1e-6, subtype="DISTANCE", precision=5)
    axis: bpy.props.EnumProperty(name="Axis", items=[(a, a, f"Along {a}") for a in "XYZ"], default="Z")
    position: bpy.props.FloatVectorProperty(name="Position", size=3, subtype="TRANSLATION")
    rotation: bpy.props.FloatVectorProperty(name="Rotation", size=3, subtype="EULER")

    def execute(self, context):
        shape = Shape(self.kind, tuple(self.size), self.radius, self.height, self.axis)
        making.add_shape(active_body(context), shape, self.use, pose_matrix(self.position, self.rotation))
        return {"FINISHED"}


class ADF_OT_redraw_shape(bpy.types.Operator):
    """Draw the primitive again after its numbers were changed"""

    bl_idname = "adf.redraw_shape"
    bl_label = "Update Primitive"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        if context.object is None or context.object.adf.role != "SHAPE":
            cls.poll_message_set("Make a primitive active")
            return False
        return True

    def execute(self, context):
        making.redraw_shape(context.object)
        return {"FINISHED"}


class ADF_OT_fit(NeedsBody, bpy.types.Operator):
    """Fit the smallest primitive around the active body's mesh, or around its selected faces in edit mode"""

    bl_idname = "adf.fit_shape"
    bl_label = "Fit Primitive"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    kind: bpy.props.EnumProperty(name="Shape", items=SHAPE_KINDS[:5])
    along: bpy.props.EnumProperty(
        name="Axes",
        items=[
            ("BODY", "Body", "Along the body's own axes"),
            ("PRINCIPAL", "Principal", "Along the principal axes of the points"),
        ],
    )
    use: bpy.props.EnumProperty(name="Use", items=USES)

    def execute(self, context):
        body = active_body(context)
        points = _chosen_points(context, body)
        if len(points) < 2:
            self.report({"ERROR"}, f"'{body.name}' has no mesh to fit a shape to")
            return {"CANCELLED"}
        T_axes = oriented(points) if self.along == "PRINCIPAL" else np.eye(4)
        local = (points - T_axes[:3, 3]) @ T_axes[:3, :3]
        try:
            shape, T = fitted(self.kind, local)
        except ValueError as error:
            self.report({"ERROR"}, f"'{body.name}': {error}")
            return {"CANCELLED"}
        making.add_shape(body, shape, self.use, T_axes @ T)
        return {"FINISHED"}


class ADF_OT_add_hull(NeedsBody, bpy.types.Operator):
    """Add the convex hull of the body's mesh, or of its selected faces in edit mode, as a collision piece"""

    bl_idname = "adf.add_hull"
    bl_label = "Add Convex Hull"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    around: bpy.props.EnumProperty(
        name="Around",
        items=[
            ("ALL", "Mesh", "One piece around the mesh, or around its selected faces in edit mode"),
            ("MATERIAL", "Each Material", "One piece around the faces of each material of the mesh"),
        ],
    )

    def execute(self, context):
        body = active_body(context)
        try:
            chosen = _by_material(body) if self.around == "MATERIAL" else [_chosen_points(context, body)]
            for points in chosen:
                making.hull_of(points)  # all or none
            for points in chosen:
                making.add_hull(body, points)
        except ValueError as error:
            self.report({"ERROR"}, f"'{body.name}': {error}")
            return {"CANCELLED"}
        group = getattr(body.adf, body.adf.role.lower())
        if not group.is_property_set("collision_mesh_type"):
            group.collision_mesh_type = "CONVEX_HULL"
        self.report({"INFO"}, f"'{body.name}': {len(chosen)} pieces added")
        return {"FINISHED"}


def _by_material(body):
    """Points of the body's mesh in its frame, by the material of their faces; raises ValueError without a mesh."""
    if body.type != "MESH":
        raise ValueError("it has no mesh to put pieces around")
    found = [surface.vertices[np.unique(surface.triangles)] for surface in surfaces_of(own_solid(body), corners=False)]
    if not found:
        raise ValueError("it has no face to put pieces around")
    return found


class ADF_OT_add_ring(NeedsBody, bpy.types.Operator):
    """Add capsules along the open boundaries of the body's mesh, or along its selected edges in edit mode"""

    bl_idname = "adf.add_ring"
    bl_label = "Add Boundary Ring"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    sides: bpy.props.IntProperty(
        name="Most Sides", description="Capsules of one ring; finer loops are cut evenly", default=12, min=3, max=256
    )
    radius: bpy.props.FloatProperty(name="Radius", default=0.0005, min=1e-6, subtype="DISTANCE", precision=5)

    def execute(self, context):
        body = active_body(context)
        try:
            vertices, edges = _rim(context, body)
            rings = [
                capsules_along(vertices[run], closed, self.sides, self.radius) for run, closed in edge_loops(edges)
            ]
        except ValueError as error:
            self.report({"ERROR"}, f"'{body.name}': {error}")
            return {"CANCELLED"}
        for shape, T in [capsule for ring in rings for capsule in ring]:
            making.add_shape(body, shape, "COLLISION", T)
        self.report({"INFO"}, f"'{body.name}': {len(rings)} rings, {sum(map(len, rings))} capsules")
        return {"FINISHED"}


def _rim(context, body):
    """Vertices of the body's mesh in its frame, and the edges of its boundaries; raises ValueError when it has none."""
    if body.type != "MESH":
        raise ValueError("it has no mesh whose boundary a ring could follow")
    work = bmesh.from_edit_mesh(body.data) if context.mode == "EDIT_MESH" else bmesh.new()
    try:
        if context.mode == "EDIT_MESH":
            chosen = [edge for edge in work.edges if edge.select]
        else:
            work.from_mesh(body.data)
            chosen = [edge for edge in work.edges if edge.is_boundary]
        points = np.array([vertex.co for vertex in work.verts], dtype=float).reshape(-1, 3)
        edges = [(edge.verts[0].index, edge.verts[1].index) for edge in chosen]
    finally:
        if context.mode != "EDIT_MESH":
            work.free()
    if not edges:
        raise ValueError("its mesh has no open boundary; select edges of it in edit mode")
    place = scaling(body)
    return points @ place[:3, :3].T + place[:3, 3], edges


def _chosen_points(context, body):
    """Points of the body's mesh in its frame: of the selected faces in edit mode, else of all."""
    obj = context.object if context.object is not None and context.object.type == "MESH" else body
    if obj.type != "MESH":
        return np.zeros((0, 3))
    if context.mode == "EDIT_MESH":
        work = bmesh.from_edit_mesh(obj.data)
        chosen = [v.co for face in work.faces if face.select for v in face.verts]
        if chosen:
            return np.array(chosen, dtype=float)
    return points_of(own_solid(body))[0] if body.type == "MESH" else np.zeros((0, 3))


CLASSES = (ADF_OT_add_shape, ADF_OT_redraw_shape, ADF_OT_fit, ADF_OT_add_hull, ADF_OT_add_ring)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
