"""Low-resolution collision meshes: a body's mesh with fewer vertices, as one piece of its collision mesh."""

from __future__ import annotations

import bpy
import numpy as np

from . import making
from .mesh_making import shape_data
from .mesh_reading import points_of
from .object_operators import active_body
from .poses import children_with
from .quality import measure
from .solids import own_solid
from .steps import InSteps

TRIES = 24
"""Most ratios that are tried; each is reduced by the factor by which the one before missed its target."""


def decimated(vertices: np.ndarray, faces: np.ndarray, most: int) -> tuple[np.ndarray, list[tuple[int, ...]]]:
    """A triangle mesh of at most ``most`` vertices, by Blender's Decimate modifier; raises ValueError.

    A closed mesh stays closed, since edges collapse.
    """
    used, welded = np.unique(vertices[faces].reshape(-1, 3).astype(np.float32), axis=0, return_inverse=True)
    triangles = welded.reshape(-1, 3)
    triangles = triangles[(np.diff(np.sort(triangles, axis=1), axis=1) > 0).all(axis=1)]
    if len(used) <= most:
        return used.astype(float), [tuple(face) for face in triangles.tolist()]
    data = shape_data(used, [tuple(face) for face in triangles.tolist()], "decimated")
    obj, scene = bpy.data.objects.new("decimated", data), bpy.data.scenes.new("ADF decimation")
    try:
        scene.collection.objects.link(obj)
        modifier = obj.modifiers.new("decimate", "DECIMATE")
        ratio = most / len(used)
        for _ in range(TRIES):
            modifier.ratio = ratio
            scene.view_layers[0].update()
            evaluated = obj.evaluated_get(scene.view_layers[0].depsgraph)
            mesh = evaluated.to_mesh()
            if 4 <= len(mesh.vertices) <= most and len(mesh.polygons):
                points = np.array([v.co for v in mesh.vertices], dtype=float)
                return points, [tuple(p.vertices) for p in mesh.polygons]
            ratio *= min(0.95 * most / max(len(mesh.vertices), 1), 0.97)
            evaluated.to_mesh_clear()
    finally:
        bpy.data.scenes.remove(scene)
        bpy.data.objects.remove(obj)
        bpy.data.meshes.remove(data)
    raise ValueError(f"its mesh cannot be reduced to {most} vertices; ask for more")


def low_resolution(body: bpy.types.Object, most: int) -> tuple[int, np.ndarray, list[tuple[int, ...]]]:
    """A body's mesh with at most ``most`` vertices, and how many it has; raises ValueError."""
    if body.type != "MESH":
        raise ValueError("it has no mesh to reduce")
    vertices, faces = points_of(own_solid(body))
    if not len(faces):
        raise ValueError("its mesh has no face")
    before = len(np.unique(vertices[faces].reshape(-1, 3).astype(np.float32), axis=0))
    return before, *decimated(vertices, faces, most)


def replace_collision(body: bpy.types.Object, points: np.ndarray, polygons: list[tuple[int, ...]]) -> None:
    """Give a body a mesh as its collision mesh, in place of the pieces there."""
    for old in children_with(body, "HULL"):
        bpy.data.objects.remove(old)
    piece = making.new_part(body, f"{body.name} low", shape_data(points, polygons, f"{body.name} low"), "HULL")
    making.look_like_collision(piece)


class ADF_OT_low_resolution(InSteps, bpy.types.Operator):
    """Give the selected bodies collision meshes with fewer vertices than their own; they replace the pieces there"""

    bl_idname = "adf.low_resolution"
    bl_label = "Low-Resolution Mesh"
    bl_options = {"REGISTER", "UNDO", "PRESET"}

    vertices: bpy.props.IntProperty(name="Most Vertices", default=150, min=4, max=100000)
    collides: bpy.props.EnumProperty(
        name="Collides As",
        items=[
            ("KEEP", "As Stated", "What the body states, or a hull where it states nothing"),
            ("CONVEX_HULL", "Convex Hull", "The hull around the reduced mesh; for bodies that move"),
            ("CONCAVE_MESH", "Triangles", "The reduced mesh as it is; for bodies that stand still"),
        ],
    )

    @classmethod
    def poll(cls, context):
        if not _bodies(context):
            cls.poll_message_set("Select bodies or ghosts")
            return False
        return True

    def steps(self, context):
        made, failed, bodies = [], [], _bodies(context)
        for number, body in enumerate(bodies):
            yield f"Reducing '{body.name}'", number / len(bodies)
            try:
                made.append((body, *low_resolution(body, self.vertices)))
            except ValueError as error:
                failed.append(f"'{body.name}': {error}")
        done = []
        for body, before, points, polygons in made:
            replace_collision(body, points, polygons)
            group = getattr(body.adf, body.adf.role.lower())
            if self.collides != "KEEP":
                group.collision_mesh_type = self.collides
            elif not group.is_property_set("collision_mesh_type"):
                group.collision_mesh_type = "CONVEX_HULL"
            done.append((body, before, len(points)))
        for words in failed:
            self.report({"WARNING"} if done else {"ERROR"}, words)
        if not done:
            return {"CANCELLED"}
        words = f"{len(done)} bodies: {sum(b for _, b, _ in done)} vertices became {sum(a for _, _, a in done)}"
        if len(done) == 1:
            try:
                words += f"; {measure(done[0][0])}"
            except ValueError as error:
                words += f"; {error}"
        self.report({"INFO"}, words)
        return {"FINISHED"}


def _bodies(context):
    """The selected bodies and ghosts, or the active one."""
    chosen = [obj for obj in context.selected_objects if obj.adf.role in ("BODY", "GHOST_OBJECT")]
    active = active_body(context, ("BODY", "GHOST_OBJECT"))
    return chosen or ([active] if active is not None else [])


CLASSES = (ADF_OT_low_resolution,)


def attach() -> None:
    """Nothing but the classes."""


def detach() -> None:
    """Nothing but the classes."""
