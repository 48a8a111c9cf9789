"""Turns a robot of a URDF or SDF file into objects of the format.

Links become bodies at the robot's zero pose, joints keep their axes. What ADF cannot express is reported, never
dropped in silence. Metres and radians.
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
from ligature.authoring.robot.description import Joint, Link, MeshFile, PlacedShape, Robot
from ligature.authoring.shapes import Shape
from ligature.mesh.load import load_mesh
from ligature.mesh.mesh import Mesh, MeshPart

_KINDS = {
    "revolute": "revolute", "continuous": "revolute", "prismatic": "prismatic", "fixed": "fixed", "ball": "p2p",
}  # fmt: skip

DEFAULT_MASS = 1.0
"""Mass in kg of a body whose file gives none, as in the format."""

FRAME_MASS, FRAME_INERTIA = 1e-3, 4e-8
"""Mass in kg and moments in kg m² of a link that is only a frame: those of a ball of 1 cm radius."""


def to_adf(robot: Robot, folder: Path) -> Converted:
    """Bodies and joints of a robot; mesh files are looked up from ``folder``."""
    notes = list(robot.notes)
    meshes: dict[str, Mesh] = {}
    fixed = {joint.child for joint in robot.joints if not joint.parent and joint.kind == "fixed"}
    carried = {joint.child for joint in robot.joints if joint.parent and joint.kind in _KINDS} - fixed
    items = [_body(link, link.name in fixed, link.name in carried, folder, meshes, notes) for link in robot.links]
    poses = {link.name: _rigid(link.T) for link in robot.links}
    inertial = {
        link.name: matrix_of(item.values.get("inertial offset")) for link, item in zip(robot.links, items, strict=True)
    }
    for joint in robot.joints:
        if joint.parent:
            items += _joint(joint, poses, inertial, notes)
        elif joint.kind != "fixed":
            notes.append(
                f"joint '{joint.name}' joins '{joint.child}' to the world, which is not a body; it is left out"
            )
    return Converted(Parts(tuple(items), meshes), notes)


def _body(link: Link, fixed: bool, carried: bool, folder: Path, meshes: dict[str, Mesh], notes: list[str]) -> Item:
    values: dict[str, Any] = {"name": link.name, "location": pose_of(_rigid(link.T))}
    if link.solid is None and carried:
        values.update(_light(link, notes))
    elif link.solid is None or fixed:
        values["mass"] = 0.0
        if not fixed:
            notes.append(f"link '{link.name}' has no mass, so its body is static")
    else:
        keys = mass_keys(link.solid)
        if not link.solid.inertia.any():  # none is given: the simulator estimates it from the shapes
            keys = {key: value for key, value in keys.items() if not key.startswith("inertia.")}
        values.update(keys)
    colour = next((look.colour for look in link.visuals if look.colour is not None), None)
    if colour is not None:
        values.update({f"color rgba.{c}": v for c, v in zip("rgba", colour, strict=True)})
    values.update(_shapes(link.name, link.visuals, "", folder, meshes, notes))
    values.update(_shapes(link.name, link.collisions, "collision ", folder, meshes, notes))
    return Item("body", f"BODY {link.name}", values)


def _light(link: Link, notes: list[str]) -> dict[str, Any]:
    """Keys of the mass of a link that has none and that a joint carries: static, it would hold the whole robot.

    With a shape it gets the format's default mass; the others are frames such as that of a tool.
    """
    mass = DEFAULT_MASS if link.visuals or link.collisions else FRAME_MASS
    notes.append(f"link '{link.name}' has no mass; its body gets {mass:g} kg, since one of 0 kg would be static")
    moment = {} if mass == DEFAULT_MASS else dict.fromkeys(("inertia.ix", "inertia.iy", "inertia.iz"), FRAME_INERTIA)
    return {"mass": mass, **moment}


def _shapes(
    link: str, looks: tuple[PlacedShape, ...], prefix: str, folder: Path, meshes: dict[str, Mesh], notes: list[str]
) -> Iterator[tuple[str, Any]]:
    """Keys of a link's visuals or collisions: primitives as a compound, meshes joined into one file."""
    primitives: list[tuple[Shape, Array]] = []
    parts: list[MeshPart] = []
    for index, look in enumerate(looks):
        if isinstance(look.shape, MeshFile):
            parts += _mesh_parts(link, look.shape, look.T_link, index, folder, notes)
        else:
            primitives.append((look.shape, look.T_link))
    yield from shape_keys(link, prefix, primitives, parts, meshes)


def _mesh_parts(link: str, mesh: MeshFile, T: Array, index: int, folder: Path, notes: list[str]) -> list[MeshPart]:
    """Parts of a mesh file in the link's frame, scale and origin taken in."""
    path = _found(mesh.name, folder)
    if path is None:
        notes.append(f"link '{link}': the mesh '{mesh.name}' is not found from {folder}")
        return []
    try:
        loaded = load_mesh(path, Resolver([path.parent]))
    except AdfError as error:
        notes.append(f"link '{link}': {error}")
        return []
    scale = np.array(mesh.scale)
    flip = -1 if np.prod(scale) < 0.0 else 1
    return [
        MeshPart(
            f"{part.name}_{index}", part.vertices * scale @ T[:3, :3].T + T[:3, 3], part.faces[:, ::flip],
            material=part.material,
        )
        for part in loaded.parts
    ]  # fmt: skip


def _found(name: str, folder: Path) -> Path | None:
    """A mesh file of a robot: relative, or of a package or model that encloses the folder."""
    name = name.removeprefix("file://")
    for scheme in ("package://", "model://"):
        if name.startswith(scheme):
            package, _, inner = name.removeprefix(scheme).partition("/")
            candidates = [parent / inner for parent in (folder, *folder.parents) if parent.name == package]
            candidates += [parent / package / inner for parent in folder.parents]
            break
    else:
        candidates = [folder / name]
    return next((path for path in candidates if path.is_file()), None)


def _joint(joint: Joint, poses: dict[str, Array], inertial: dict[str, Array], notes: list[str]) -> list[Item]:
    kind = _KINDS.get(joint.kind)
    if kind is None:
        notes.append(f"joint '{joint.name}' is {joint.kind}, which no joint of ADF can represent; its child stays free")
        return []
    if joint.mimics:
        notes.append(f"joint '{joint.name}' mimics '{joint.mimics}', which ADF cannot express")
    T_parent_child = inverse(poses[joint.parent]) @ poses[joint.child]
    e = (1.0, 0.0, 0.0) if kind == "prismatic" else (0.0, 0.0, 1.0)
    T_joint = inverse(poses[joint.parent]) @ _rigid(joint.T) @ frame(minimal_rotation(e, joint.axis), (0.0, 0.0, 0.0))
    keys = joint_keys(T_joint, T_parent_child, inertial[joint.parent], inertial[joint.child], kind == "prismatic")
    values: dict[str, Any] = {
        "name": joint.name, "type": kind, "parent": f"BODY {joint.parent}", "child": f"BODY {joint.child}",
        "parent pivot": keys.parent_pivot, "child pivot": keys.child_pivot,
        "parent axis": keys.parent_axis, "child axis": keys.child_axis, "offset": keys.offset,
    }  # fmt: skip
    if kind in ("revolute", "prismatic") and joint.lower is not None and joint.upper is not None:
        values["joint limits.low"], values["joint limits.high"] = joint.lower, joint.upper
    return [Item("joint", f"JOINT {joint.name}", values)]


def _rigid(T: Array) -> Array:
    """A pose whose rotation is orthonormal to the last digit."""
    return frame(quaternion_matrix(matrix_quaternion(T[:3, :3])), T[:3, 3])
