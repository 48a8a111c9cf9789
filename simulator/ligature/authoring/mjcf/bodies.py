"""Turns an MJCF model, as MuJoCo compiles it, into objects of the format.

The compiled model has all defaults, includes, units and inertias worked out; what is read of it are the
arrays of `mjModel` that MuJoCo documents ("API reference: mjModel"). Bodies stand where they are in MuJoCo's
reference configuration ``qpos0``. What ADF cannot express is reported by name, never dropped in silence.
Metres, kilograms, radians.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ligature.adf.frames import Array, frame, inverse
from ligature.adf.update import Item
from ligature.authoring.conversion import Converted, shape_keys, shape_part
from ligature.authoring.generate import Parts
from ligature.authoring.mjcf.joints import joints_of
from ligature.authoring.mjcf.model import is_static, name_of, names_of, owner_of, rest_poses, rotation
from ligature.authoring.placement import pose_of, vector
from ligature.authoring.shapes import Shape
from ligature.mesh.mesh import Material, Mesh, MeshPart

_PLANE, _SPHERE, _CAPSULE, _ELLIPSOID, _CYLINDER, _BOX, _MESH = 0, 2, 3, 4, 5, 6, 7
_HIDDEN_GROUPS = 3
"""Geoms from this group on are not drawn, by MuJoCo's default."""

_LEFT_OUT = (
    ("neq", "equality", "equality constraints"),
    ("ntendon", "tendon", "tendons"),
    ("nsensor", "sensor", "sensors"),
    ("nsite", "site", "sites"),
    ("ncam", "cam", "cameras"),
    ("nlight", "light", "lights"),
    ("nkey", "key", "keyframes"),
    ("npair", "pair", "contact pairs"),
    ("nexclude", "exclude", "contact exclusions"),
    ("nflex", "flex", "deformables"),
    ("nskin", "skin", "skins"),
)
"""Sizes of `mjModel` whose things have no counterpart here, the accessor of each, and what they are called."""


def from_mjcf(model: Any) -> Converted:
    """Bodies and joints of a compiled model (`mujoco.MjModel`)."""
    notes: list[str] = []
    poses = rest_poses(model)
    meshes: dict[str, Mesh] = {}
    bodies = _bodies(model, notes)
    geoms = {
        body: [g for g in range(model.ngeom) if owner_of(model, int(model.geom_bodyid[g])) == body] for body in bodies
    }
    joints = [item for body in bodies for item in joints_of(model, body, poses, notes)]
    solid = {body: [g for g in chosen if model.geom_type[g] != _PLANE] for body, chosen in geoms.items()}
    parents = {item.values["parent"] for item in joints}
    if not solid[0] and f"BODY {name_of(model, 'body', 0)}" not in parents:
        bodies = bodies[1:]  # nothing is on the world's own body
    groups = _need_groups(model, notes)
    items = [_body(model, body, solid[body], poses, groups, meshes, notes) for body in bodies]
    items += [_plane(model, g, poses) for g in range(model.ngeom) if model.geom_type[g] == _PLANE]
    _note_unsupported(model, notes)
    top = {"gravity": vector(model.opt.gravity)}
    return Converted(Parts((*items, *joints), meshes), notes, top)


def _bodies(model: Any, notes: list[str]) -> list[int]:
    found = []
    for body in range(model.nbody):
        owner = owner_of(model, body)
        if owner == body:
            found.append(body)
        else:
            owner_name = name_of(model, "body", owner)
            notes.append(f"body '{name_of(model, 'body', body)}' has no mass; its geoms are part of '{owner_name}'")
        if model.body_mocapid[body] >= 0:
            notes.append(
                f"body '{name_of(model, 'body', body)}' is moved by motion capture; in Ligature it does not move"
            )
    return found


def _body(
    model: Any, body: int, geoms: list[int], poses: list[Array], groups: bool, meshes: dict[str, Mesh], notes: list[str]
) -> Item:
    name = name_of(model, "body", body)
    values: dict[str, Any] = {"name": name, "location": pose_of(poses[body])}
    if is_static(model, body):
        values["mass"] = 0.0
    else:
        values["mass"] = float(model.body_mass[body])
        moments = (float(v) for v in model.body_inertia[body])
        values |= dict(zip(("inertia.ix", "inertia.iy", "inertia.iz"), moments, strict=True))
        values["inertial offset"] = pose_of(frame(rotation(model.body_iquat[body]), model.body_ipos[body]))
    if model.body_gravcomp[body]:
        notes.append(f"body '{name}' has gravity compensation, which is left out")
    drawn = [g for g in geoms if model.geom_group[g] < _HIDDEN_GROUPS and _colour(model, g)[3] > 0.0]
    touched = [g for g in geoms if _collides(model, g)]
    for prefix, chosen in (("", drawn), ("collision ", touched)):
        notes_of_group = notes if prefix or not touched else []  # what is drawn and collides is reported once
        values.update(shape_keys(name, prefix, *_shapes(model, chosen, poses[body], poses, notes_of_group), meshes))
    if "mesh" in values:
        values["use material"] = False
    elif drawn:
        values.update(_colour_keys(model, drawn[0]))
    if touched:
        values["friction.static"] = float(model.geom_friction[touched[0], 0])
        if groups:
            values["collision groups"] = _bits(int(model.geom_contype[touched[0]]))
    values["damping.linear"] = values["damping.angular"] = 0.0  # the format's own defaults are not MuJoCo's
    return Item("body", f"BODY {name}", values)


def _plane(model: Any, geom: int, poses: list[Array]) -> Item:
    """Make a plane a static body of its own: it is infinite, and cannot be one of several shapes."""
    name = name_of(model, "geom", geom)
    T = poses[int(model.geom_bodyid[geom])] @ _geom_pose(model, geom)
    values: dict[str, Any] = {"name": name, "location": pose_of(T), "mass": 0.0}
    for prefix in ("", "collision "):
        if not prefix or _collides(model, geom):
            values[f"{prefix}shape"] = "PLANE"
            values |= {f"{prefix}geometry.normal": (0.0, 0.0, 1.0), f"{prefix}geometry.offset": 0.0}
    values |= _colour_keys(model, geom)
    values["friction.static"] = float(model.geom_friction[geom, 0])
    return Item("body", f"BODY plane {name}", values)


def _collides(model: Any, geom: int) -> bool:
    return bool(model.geom_contype[geom] or model.geom_conaffinity[geom])


def _need_groups(model: Any, notes: list[str]) -> bool:
    """Whether collision groups are needed: geoms collide here when they share a bit of one mask."""
    touched = [g for g in range(model.ngeom) if _collides(model, g)]
    masks = {(int(model.geom_contype[g]), int(model.geom_conaffinity[g])) for g in touched}
    if len(masks) < 2:
        return False
    one_per_body = {(int(model.geom_bodyid[g]), int(model.geom_contype[g])) for g in touched}
    if any(a != b for a, b in masks) or len(one_per_body) > len({body for body, _ in one_per_body}):
        note = "contype and conaffinity differ in a way that collision groups cannot express; everything collides"
        if note not in notes:
            notes.append(note)
        return False
    return True


def _bits(mask: int) -> tuple[int, ...]:
    return tuple(bit for bit in range(31) if mask >> bit & 1)


def _colour(model: Any, geom: int) -> tuple[float, ...]:
    """Red, green, blue and alpha: of the geom, or of its material when the geom has none of its own."""
    own = model.geom_rgba[geom]
    material = int(model.geom_matid[geom])
    chosen = model.mat_rgba[material] if material >= 0 and np.allclose(own, (0.5, 0.5, 0.5, 1.0)) else own
    return tuple(round(float(v), 6) for v in chosen)


def _colour_keys(model: Any, geom: int) -> dict[str, float]:
    return dict(zip((f"color rgba.{c}" for c in "rgba"), _colour(model, geom), strict=True))


def _geom_pose(model: Any, geom: int) -> Array:
    return frame(rotation(model.geom_quat[geom]), model.geom_pos[geom])


def _shapes(
    model: Any, geoms: list[int], T_body: Array, poses: list[Array], notes: list[str]
) -> tuple[list[tuple[Shape, Array]], list[MeshPart]]:
    """Primitives with their poses in the body, and triangles of shapes for which the format has no primitive."""
    primitives: list[tuple[Shape, Array]] = []
    parts: list[MeshPart] = []
    for geom in geoms:
        name, kind = name_of(model, "geom", geom), int(model.geom_type[geom])
        T = inverse(T_body) @ poses[int(model.geom_bodyid[geom])] @ _geom_pose(model, geom)
        r, g, b, _ = _colour(model, geom)
        material = Material(name, diffuse=(r, g, b))
        x, y, z = (float(v) for v in model.geom_size[geom])
        if kind == _BOX:
            primitives.append((Shape("BOX", size=(2.0 * x, 2.0 * y, 2.0 * z)), T))
        elif kind == _SPHERE:
            primitives.append((Shape("SPHERE", radius=x), T))
        elif kind == _CYLINDER:
            primitives.append((Shape("CYLINDER", radius=x, height=2.0 * y), T))
        elif kind == _CAPSULE:
            primitives.append((Shape("CAPSULE", radius=x, height=2.0 * (x + y)), T))
        elif kind == _ELLIPSOID:
            ball = shape_part(name, Shape("SPHERE", radius=1.0), np.eye(4))
            vertices = ball.vertices * (x, y, z) @ T[:3, :3].T + T[:3, 3]
            parts.append(MeshPart(name, vertices, ball.faces, material=material))
        elif kind == _MESH:
            vertices, faces = _triangles(model, int(model.geom_dataid[geom]))
            parts.append(MeshPart(name, vertices @ T[:3, :3].T + T[:3, 3], faces, material=material))
        else:
            notes.append(
                f"geom '{name}' is a height or distance field, which no shape of ADF can represent; it is left out"
            )
    return primitives, parts


def _triangles(model: Any, mesh: int) -> tuple[Array, Any]:
    first, count = int(model.mesh_vertadr[mesh]), int(model.mesh_vertnum[mesh])
    vertices = np.asarray(model.mesh_vert[first : first + count], dtype=float)
    first, count = int(model.mesh_faceadr[mesh]), int(model.mesh_facenum[mesh])
    return vertices, np.asarray(model.mesh_face[first : first + count], dtype=np.int32)


def _note_unsupported(model: Any, notes: list[str]) -> None:
    """Note elements of the model that have no counterpart."""
    for size, kind, plural in _LEFT_OUT:
        count = int(getattr(model, size, 0))
        if count:
            named = f": {names_of(model, kind, range(count))}" if hasattr(model, kind) else ""
            notes.append(f"{plural} are left out{named}")
    if model.nu:
        notes.append(
            f"gains of the actuators are left out: {names_of(model, 'actuator', range(model.nu))}; "
            "send commands to their joints instead"
        )
