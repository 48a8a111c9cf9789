"""Turns the objects of a model file into a robot that URDF and SDF can hold; reports what they cannot.

Metres, kilograms, radians.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import count

import numpy as np

from ligature.adf import AdfError, Document, Element, Resolver
from ligature.adf.frames import Array, frame, inverse
from ligature.adf.references import find_by_text
from ligature.authoring.conversion import shape_part
from ligature.authoring.objfile import MeshWriteError, Paint, Surface, obj_texts
from ligature.authoring.placement import AXIS_TURNS, JointKeys, child_pose, joint_pose, matrix_of, vector
from ligature.authoring.robot.description import Colour, Joint, Link, MeshFile, PlacedShape, Robot, unique
from ligature.authoring.robot.left_out import left_out
from ligature.authoring.shapes import ROUND, Shape, shapes_properties
from ligature.mesh.inertia import MassProperties, box_properties, mass_properties
from ligature.mesh.load import load_mesh
from ligature.mesh.mesh import MeshPart
from ligature.mesh.surface import joined
from ligature.paths import as_file_name

MESHES = "meshes"
"""Folder of the mesh files, beside the robot's file."""

KINDS = {
    "revolute": "revolute", "prismatic": "prismatic", "fixed": "fixed", "p2p": "ball", "torsion spring": "revolute",
    "linear spring": "prismatic",
}  # fmt: skip


@dataclass
class Exported:
    """A robot, its mesh files by their path from the robot's file, and what was left out."""

    robot: Robot
    files: dict[str, bytes] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)


def exported(document: Document, resolver: Resolver, name: str) -> Exported:
    """The bodies and joints of a model as a robot."""
    return _Exporter(document, resolver, name).run()


class _Exporter:
    def __init__(self, document: Document, resolver: Resolver, name: str) -> None:
        self.document, self.resolver = document, resolver
        self.done = Exported(Robot(name, (), ()))
        self.bodies = document.elements("bodies")
        names = unique([body.text("name") or body.key for body in self.bodies])
        self.names = {body.key: own for body, own in zip(self.bodies, names, strict=True)}
        self.inertial = {body.key: matrix_of(body.pose("inertial offset")) for body in self.bodies}
        self.names_of_files: set[str] = set()
        self.meshes: dict[str, tuple[MeshPart, ...]] = {}
        """Parts of the meshes that are written, by name."""

    def run(self) -> Exported:
        joints = self.document.elements("joints")
        ends = [(self._body(joint, "parent"), self._body(joint, "child")) for joint in joints]
        at_zero = self._zero_poses(joints, ends)
        links = tuple(self._link(body, at_zero[body.key]) for body in self.bodies)
        names = unique([joint.text("name") or joint.key for joint in joints])
        made = [
            self._joint(joint, name, parent, child, at_zero)
            for joint, name, (parent, child) in zip(joints, names, ends, strict=True)
            if parent is not None and child is not None
        ]
        self.done.notes += left_out(self.document)
        self.done.robot = replace(self.done.robot, links=links, joints=tuple(j for j in made if j is not None))
        return self.done

    def _body(self, joint: Element, end: str) -> Element | None:
        text = joint.text(end)
        found = find_by_text([body.key for body in self.bodies], text)
        if found is None:
            self.done.notes.append(
                f"joint '{joint.key}': its {end} '{text}' is not a body of this file; it is left out"
            )
        return None if found is None else self.bodies[found]

    def _zero_poses(
        self, joints: tuple[Element, ...], ends: list[tuple[Element | None, Element | None]]
    ) -> dict[str, Array]:
        """Pose of each body where all joints stand at zero; the first joint of a body decides."""
        above: dict[str, tuple[Element, Element]] = {}
        for joint, (parent, child) in zip(joints, ends, strict=True):
            if parent is not None and child is not None:
                above.setdefault(child.key, (joint, parent))
        known: dict[str, Array] = {}
        for body in self.bodies:
            chain = [body]
            while chain[-1].key in above and chain[-1].key not in known:
                parent = above[chain[-1].key][1]
                if parent in chain:
                    break  # a loop of parents: it opens where it was entered
                chain.append(parent)
            for link in reversed(chain):
                if link.key in known:
                    continue
                joint_parent = above.get(link.key)
                if joint_parent is None or joint_parent[1].key not in known:
                    known[link.key] = matrix_of(link.pose("location"))
                    continue
                joint, parent = joint_parent
                known[link.key] = known[parent.key] @ child_pose(*self._place(joint, parent, link))
        return known

    def _place(self, joint: Element, parent: Element, child: Element) -> tuple[JointKeys, Array, Array, bool]:
        scales = [body.number("scale") or 1.0 for body in (parent, child)]
        pivot_a, pivot_b = (
            vector(scale * np.array(joint.vector(f"{end} pivot")))
            for scale, end in zip(scales, ("parent", "child"), strict=True)
        )
        offset = joint.number("offset") if joint.has("offset") else joint.number("child offset")
        axes = joint.vector("parent axis"), joint.vector("child axis")
        keys = JointKeys(pivot_a, pivot_b, *axes, offset, joint.number("joint offset"))
        return keys, self.inertial[parent.key], self.inertial[child.key], joint.text("type") == "prismatic"

    def _joint(
        self, joint: Element, name: str, parent: Element, child: Element, at_zero: dict[str, Array]
    ) -> Joint | None:
        kind = joint.text("type")
        if kind not in KINDS:
            self.done.notes.append(f"joint '{name}' is {kind}, which neither format supports; it is left out")
            return None
        if kind.endswith("spring"):
            self.done.notes.append(f"joint '{name}' keeps its axis and limits, not its spring")
        T = at_zero[parent.key] @ joint_pose(*self._place(joint, parent, child))
        low, high = joint.value("joint limits.low"), joint.value("joint limits.high")
        limited = low is not None and high is not None and low <= high
        along = (1.0, 0.0, 0.0) if kind == "prismatic" else (0.0, 0.0, 1.0)
        return Joint(
            name, KINDS[kind], self.names[parent.key], self.names[child.key], T, np.array(along),
            float(low) if limited else None, float(high) if limited else None,
        )  # fmt: skip

    # --- bodies ---

    def _link(self, body: Element, T: Array) -> Link:
        name = self.names[body.key]
        visuals = self._placed_shapes(body, "", body.text("mesh"))
        touched = self._placed_shapes(
            body, "collision ", body.text("collision mesh" if body.has("collision mesh") else "mesh")
        )
        solid = self._solid(body, name, touched or visuals)
        return Link(name, T, solid, tuple(visuals), tuple(replace(look, colour=None) for look in touched))

    def _placed_shapes(self, body: Element, prefix: str, mesh: str) -> list[PlacedShape]:
        """Visual shapes of a body, or its collision shapes (``prefix`` is "collision ")."""
        colour = _colour(body) if not prefix else None
        if body.has(f"{prefix}shape"):
            offset = body.pose("collision offset") if prefix and body.has("collision offset") else None
            T = matrix_of(offset) if offset or not prefix else self.inertial[body.key]
            found = [(_shape_of(body, f"{prefix}shape", f"{prefix}geometry"), T)]
        elif body.has(f"compound {prefix}shape"):
            items = body.children(f"compound {prefix}shape")
            found = [(_shape_of(item, "shape", "geometry"), matrix_of(item.pose("offset"))) for item in items]
        else:
            return [PlacedShape(np.eye(4), file, colour) for file in self._mesh_files(body, mesh, prefix)]
        return [self._plain(body, shape, T, colour) for shape, T in found]

    def _plain(self, body: Element, shape: Shape, T: Array, colour: Colour | None) -> PlacedShape:
        """A primitive along Z; a cone, which neither format has, as a mesh."""
        if shape.kind == "CONE":
            part = shape_part("cone", shape, np.eye(4))
            return PlacedShape(T, self._write(f"{self.names[body.key]}_cone", [part]), colour)
        turned = T @ frame(AXIS_TURNS[shape.axis], (0.0, 0.0, 0.0)) if shape.kind in ROUND else T
        return PlacedShape(turned, replace(shape, axis="Z"), colour)

    def _mesh_files(self, body: Element, name: str, prefix: str) -> Iterator[MeshFile]:
        """The mesh ``name`` of a body as files: one, or one for each convex piece that it collides by."""
        if not name:
            return
        high, low = (body.text(f"{level} resolution path") for level in ("high", "low"))
        folders = [("high", high)] if not prefix else [("low", low or high), ("high", high)]
        files = [os.path.join(self.document.top.text(f"{level} resolution path"), own, name) for level, own in folders]
        try:
            paths = [self.resolver.resolve(file, self.document.path.parent) for file in files]
            mesh = load_mesh(next((path for path in paths if path.is_file()), paths[0]), self.resolver)
        except AdfError as error:
            self.done.notes.append(f"body '{body.key}': {error}")
            return
        scale = body.number("scale") or 1.0
        parts = [replace(part, vertices=part.vertices * scale) for part in mesh.parts if len(part.faces)]
        stem = self.names[body.key]
        if not prefix:
            yield self._write(stem, parts)
            return
        convex = body.text("collision mesh type") in ("CONVEX_HULL", "CONVEX_MESH")
        for group in [[part] for part in parts] if convex else [parts]:  # one file a piece: hulls are taken of files
            yield self._write(f"{stem}_collision", group)

    def _write(self, stem: str, parts: list[MeshPart]) -> MeshFile:
        plain = as_file_name(stem)
        numbered = (f"{plain}{f'_{number}' if number > 1 else ''}" for number in count(1))
        name = next(name for name in numbered if name not in self.names_of_files)
        self.names_of_files.add(name)
        surfaces = [
            Surface(
                Paint(part.name, part.material.diffuse if part.material else (0.8, 0.8, 0.8)), part.vertices, part.faces
            )
            for part in parts
        ]
        try:
            obj, library = obj_texts(surfaces, f"{name}.mtl", name)
        except MeshWriteError as error:
            self.done.notes.append(f"{name}: {error}")
            return MeshFile(f"{MESHES}/{name}.obj")
        self.done.files[f"{MESHES}/{name}.obj"] = obj.encode()
        self.done.files[f"{MESHES}/{name}.mtl"] = library.encode()
        self.meshes[f"{MESHES}/{name}.obj"] = tuple(parts)
        return MeshFile(f"{MESHES}/{name}.obj")

    def _solid(self, body: Element, name: str, looks: list[PlacedShape]) -> MassProperties | None:
        """Mass properties in the body's frame; moments that the file leaves to the simulator come of its shapes."""
        mass = body.number("mass")
        if not mass > 0.0:
            return None
        T = self.inertial[body.key]
        if body.has("mass") and body.has("inertia"):
            moments = np.diag([body.number(f"inertia.i{axis}") for axis in "xyz"])
            return MassProperties(0.0, mass, T[:3, 3], T[:3, :3] @ moments @ T[:3, :3].T)
        self.done.notes.append(f"link '{name}' states no inertia; it has that of its shapes")
        own = self._shaped(looks).with_mass(mass)
        moved = inverse(T)[:3, :3] @ own.inertia @ T[:3, :3]
        return MassProperties(0.0, mass, T[:3, 3], T[:3, :3] @ np.diag(np.diag(moved)) @ T[:3, :3].T)

    def _shaped(self, looks: list[PlacedShape]) -> MassProperties:
        """Mass properties of shapes, or of the box around meshes; of a decimetre where there is neither."""
        shapes = [(look.shape, look.T_link) for look in looks if isinstance(look.shape, Shape)]
        try:
            if shapes:
                return shapes_properties([(shape, T) for shape, T in shapes if shape.kind != "PLANE"])
            parts = [
                replace(part, vertices=part.vertices @ look.T_link[:3, :3].T + look.T_link[:3, 3])
                for look in looks
                if isinstance(look.shape, MeshFile)
                for part in self.meshes[look.shape.name]
            ]
            vertices, faces = joined(tuple(parts))
        except (ValueError, KeyError):
            return box_properties(np.full(3, 0.1))
        if not len(vertices):
            return box_properties(np.full(3, 0.1))
        try:
            return mass_properties(vertices, faces)
        except ValueError:
            size = np.maximum(np.ptp(vertices, axis=0), 1e-4)
            return box_properties(size)


def _shape_of(element: Element, shape: str, geometry: str) -> Shape:
    plain = Shape(element.text(shape))
    keys = ("x", "y", "z", "radius", "height", "axis", "normal", "offset")
    given = {key: element.value(f"{geometry}.{key}") for key in keys if element.has(f"{geometry}.{key}")}
    return Shape.of(plain.kind, given)


def _colour(body: Element) -> Colour | None:
    if body.has("color rgba"):
        r, g, b, a = (body.number(f"color rgba.{c}") for c in "rgba")
        return r, g, b, a
    if body.has("color components.diffuse"):
        r, g, b = (body.number(f"color components.diffuse.{c}") for c in "rgb")
        return r, g, b, body.number("color components.transparency")
    return None
