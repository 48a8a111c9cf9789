"""Turns a URDF robot, as yourdfpy reads it, into objects of the format.

Links become bodies at the robot's zero pose, joints keep their axes; the joint frame of URDF is the
child's frame. What ADF cannot express is reported, never dropped in silence. Metres and radians.
"""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ligature.adf import AdfError, Resolver
from ligature.adf.frames import Array, frame, inverse, matrix_quaternion, minimal_rotation, quaternion_matrix
from ligature.adf.update import Item
from ligature.authoring.conversion import Converted, shape_keys
from ligature.authoring.generate import Parts, mass_keys
from ligature.authoring.placement import joint_keys, matrix_of, pose_of
from ligature.authoring.shapes import Shape
from ligature.mesh.inertia import MassProperties
from ligature.mesh.load import load_mesh
from ligature.mesh.mesh import Mesh, MeshPart

_KINDS = {"revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed"}


def from_urdf(robot: Any, folder: Path) -> Converted:
    """Bodies and joints of ``robot`` (`yourdfpy.Robot`); mesh files are looked up from ``folder``."""
    notes: list[str] = []
    poses = _zero_poses(robot, notes)
    items: list[Item] = []
    meshes: dict[str, Mesh] = {}
    for link in robot.links:
        if link.name in poses:
            items.append(_body(link, poses[link.name], folder, meshes, notes))
    inertial = {item.values["name"]: matrix_of(item.values.get("inertial offset")) for item in items}
    for joint in robot.joints:
        if joint.parent in poses and joint.child in poses:
            items += _joint(joint, poses, inertial, notes)
    return Converted(Parts(tuple(items), meshes), notes)


def _zero_poses(robot: Any, notes: list[str]) -> dict[str, Array]:
    """Pose of every link at zero, in the frame of the root."""
    children = {joint.child for joint in robot.joints}
    poses = {link.name: np.eye(4) for link in robot.links if link.name not in children}
    if len(poses) != 1:
        notes.append(f"the robot has {len(poses)} roots; each stands at the origin")
    waiting = list(robot.joints)
    while waiting:
        ready = [joint for joint in waiting if joint.parent in poses]
        if not ready:
            notes.append(f"joint '{waiting[0].name}' is connected to no root; it and all below it are left out")
            break
        for joint in ready:
            poses[joint.child] = poses[joint.parent] @ _matrix(joint.origin)
        waiting = [joint for joint in waiting if joint not in ready]
    return poses


def _body(link: Any, T: Array, folder: Path, meshes: dict[str, Mesh], notes: list[str]) -> Item:
    values: dict[str, Any] = {"name": link.name, "location": pose_of(T)}
    if link.inertial is not None and link.inertial.mass:
        values.update(_mass(link.inertial))
    else:
        values["mass"] = 0.0
        notes.append(f"link '{link.name}' has no mass, so its body is static")
    values.update(_shapes(link.name, link.visuals, "", folder, meshes, notes))
    values.update(_shapes(link.name, link.collisions, "collision ", folder, meshes, notes))
    return Item("body", f"BODY {link.name}", values)


def _mass(inertial: Any) -> dict[str, Any]:
    T = _matrix(inertial.origin)
    tensor = np.asarray(inertial.inertia if inertial.inertia is not None else np.zeros((3, 3)), dtype=float)
    solid = MassProperties(0.0, float(inertial.mass), T[:3, 3], T[:3, :3] @ tensor @ T[:3, :3].T)
    keys = mass_keys(solid)
    if not tensor.any():  # none is given: the simulator estimates it from the shapes
        keys = {key: value for key, value in keys.items() if not key.startswith("inertia.")}
    return keys


def _shapes(
    link: str, given: Any, prefix: str, folder: Path, meshes: dict[str, Mesh], notes: list[str]
) -> Iterator[tuple[str, Any]]:
    """Keys of a link's visuals or collisions: primitives as a compound, meshes joined into one file."""
    primitives: list[tuple[Shape, Array]] = []
    parts: list[MeshPart] = []
    for index, item in enumerate(given or ()):
        T = _matrix(item.origin)
        shape = _primitive(item.geometry)
        if shape is not None:
            primitives.append((shape, T))
        elif item.geometry is not None and item.geometry.mesh is not None:
            parts += _mesh_parts(link, item.geometry.mesh, T, index, folder, notes)
    yield from shape_keys(link, prefix, primitives, parts, meshes)


def _primitive(geometry: Any) -> Shape | None:
    if geometry is None:
        return None
    if geometry.box is not None:
        x, y, z = (float(v) for v in geometry.box.size)
        return Shape("BOX", size=(x, y, z))
    if geometry.cylinder is not None:
        return Shape("CYLINDER", radius=float(geometry.cylinder.radius), height=float(geometry.cylinder.length))
    if geometry.sphere is not None:
        return Shape("SPHERE", radius=float(geometry.sphere.radius))
    return None


def _mesh_parts(link: str, mesh: Any, T: Array, index: int, folder: Path, notes: list[str]) -> list[MeshPart]:
    """Parts of a mesh file in the link's frame, scale and origin taken in."""
    name = mesh.filename.removeprefix("file://")
    path = _found(name, folder)
    if path is None:
        notes.append(f"link '{link}': the mesh '{mesh.filename}' is not found from {folder}")
        return []
    try:
        loaded = load_mesh(path, Resolver([path.parent]))
    except AdfError as error:
        notes.append(f"link '{link}': {error}")
        return []
    scale = np.ones(3) if mesh.scale is None else np.asarray(mesh.scale, dtype=float) * np.ones(3)
    flip = -1 if np.prod(scale) < 0.0 else 1
    return [
        MeshPart(f"{part.name}_{index}", part.vertices * scale @ T[:3, :3].T + T[:3, 3], part.faces[:, ::flip])
        for part in loaded.parts
    ]


def _found(name: str, folder: Path) -> Path | None:
    """A mesh file of a URDF: relative, or of a package that encloses the folder."""
    if name.startswith("package://"):
        package, _, inner = name.removeprefix("package://").partition("/")
        candidates = [parent / inner for parent in (folder, *folder.parents) if parent.name == package]
        candidates += [parent / package / inner for parent in folder.parents]
    else:
        candidates = [folder / name]
    return next((path for path in candidates if path.is_file()), None)


def _joint(joint: Any, poses: dict[str, Array], inertial: dict[str, Array], notes: list[str]) -> list[Item]:
    kind = _KINDS.get(joint.type)
    if kind is None:
        notes.append(f"joint '{joint.name}' is {joint.type}, which ADF has no joint for; its child stays free")
        return []
    if joint.mimic is not None:
        notes.append(f"joint '{joint.name}' mimics '{joint.mimic.joint}', which ADF cannot express")
    T_parent_child = inverse(poses[joint.parent]) @ poses[joint.child]
    axis = np.asarray(joint.axis if joint.axis is not None else (1.0, 0.0, 0.0), dtype=float)
    e = (1.0, 0.0, 0.0) if kind == "prismatic" else (0.0, 0.0, 1.0)
    T_joint = T_parent_child @ frame(minimal_rotation(e, axis), (0.0, 0.0, 0.0))
    keys = joint_keys(T_joint, T_parent_child, inertial[joint.parent], inertial[joint.child], kind == "prismatic")
    values: dict[str, Any] = {
        "name": joint.name, "type": kind, "parent": f"BODY {joint.parent}", "child": f"BODY {joint.child}",
        "parent pivot": keys.parent_pivot, "child pivot": keys.child_pivot,
        "parent axis": keys.parent_axis, "child axis": keys.child_axis, "offset": keys.offset,
    }  # fmt: skip
    if joint.type in ("revolute", "prismatic") and joint.limit is not None and joint.limit.upper is not None:
        values["joint limits.low"], values["joint limits.high"] = (
            float(joint.limit.lower or 0.0),
            float(joint.limit.upper),
        )
    return [Item("joint", f"JOINT {joint.name}", values)]


def _matrix(origin: Any) -> Array:
    """A pose of the file, its rotation made exactly orthonormal."""
    if origin is None:
        return np.eye(4)
    T = np.asarray(origin, dtype=float)
    return frame(quaternion_matrix(matrix_quaternion(T[:3, :3])), T[:3, 3])
