"""Adopts scenes of the original AMBF add-on, and plain rigid-body scenes of Blender, with a report of what came of it.

The add-on keeps its data in properties of objects and of the scene whose names begin with ``ambf_``. When it is not
enabled Blender still has them, choices as numbers. Names differ between its versions, so that properties are found by
the words in their names. Blender's rigid bodies are taken where an object has none of these.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import radians

import bpy
import numpy as np

from . import making
from .compat import custom_properties
from .ligature.adf.frames import axis_rotation, frame, rpy_matrix
from .ligature.authoring.shapes import Shape
from .mesh_reading import points_of
from .placing import place
from .poses import rest_pose
from .references import topic_name
from .solids import own_solid

ROLES = ("NONE", "RIGID_BODY", "GHOST_OBJECT", "CONSTRAINT", "COLLISION_SHAPE")
COLLISIONS = ("MESH", "SINGULAR_SHAPE", "COMPOUND_SHAPE")
MESH_TYPES = ("CONCAVE_MESH", "CONVEX_MESH", "CONVEX_HULL")
JOINTS = (
    "FIXED", "REVOLUTE", "PRISMATIC", "LINEAR_SPRING", "TORSION_SPRING", "P2P", "CONE_TWIST", "SIX_DOF",
    "SIX_DOF_SPRING",
)  # fmt: skip
SHAPES = ("CONE", "CYLINDER", "CAPSULE", "SPHERE", "BOX")
OUTPUTS = ("VELOCITY", "FORCE")
AXES = ("X", "Y", "Z")
"""Choices of the add-on in their order, by which Blender numbers them when it is not enabled."""

SLIDING = ("prismatic", "linear spring")
TURNS = {
    "X": axis_rotation((0.0, 1.0, 0.0), np.pi / 2),
    "Y": axis_rotation((1.0, 0.0, 0.0), -np.pi / 2),
    "Z": np.eye(3),
}
"""Rotations that take Z, along which joints turn, to the axis that the add-on names."""

BLENDER_JOINTS = {
    "FIXED": "fixed", "POINT": "p2p", "HINGE": "revolute", "SLIDER": "prismatic", "PISTON": "six dof",
    "GENERIC": "six dof", "GENERIC_SPRING": "six dof spring",
}  # fmt: skip
BLENDER_SHAPES = {
    "BOX": "BOX", "SPHERE": "SPHERE", "CAPSULE": "CAPSULE", "CYLINDER": "CYLINDER", "CONE": "CONE",
}  # fmt: skip


@dataclass
class Adopted:
    """What came of a scene: what was taken, what was guessed, and what was left."""

    collection: bpy.types.Collection
    bodies: int = 0
    joints: int = 0
    ghosts: int = 0
    shapes: int = 0
    guessed: list[str] = field(default_factory=list)
    left: list[str] = field(default_factory=list)

    def lines(self) -> list[str]:
        """The report, a line each."""
        counts = f"taken: {self.bodies} bodies, {self.joints} joints, {self.ghosts} ghosts, {self.shapes} primitives"
        return [counts, *(f"guessed: {text}" for text in self.guessed), *(f"left: {text}" for text in self.left)]


class Stored:
    """The properties of the add-on on an object or scene, found by words of their names."""

    def __init__(self, owner: bpy.types.ID | dict, report: Adopted | None = None) -> None:
        found = owner if isinstance(owner, dict) else custom_properties(owner)
        self.values = {name: value for name, value in found.items() if name.startswith("ambf_") or owner is found}
        self.used: set[str] = set()
        self.report = report
        self.name = getattr(owner, "name", "")

    def __bool__(self) -> bool:
        return bool(self.values)

    def name_of(self, *words: str) -> str:
        """The shortest name of a property that has all words; empty without one."""
        names = [name for name in self.values if all(word in name.lower() for word in words)]
        return min(names, key=len, default="")

    def get(self, *words: str, default: object = None) -> object:
        """The value of the property whose name has all words."""
        name = self.name_of(*words)
        self.used.add(name)
        return self.values[name] if name else default

    def number(self, *words: str, default: float) -> float:
        """A number."""
        return float(self.get(*words, default=default))

    def flag(self, *words: str, default: bool = False) -> bool:
        """A truth value."""
        return bool(self.get(*words, default=default))

    def vector(self, *words: str, default: tuple[float, float, float] = (0.0, 0.0, 0.0)) -> np.ndarray:
        """Three numbers."""
        return np.array(list(self.get(*words, default=default)), dtype=float)

    def choice(self, choices: tuple[str, ...], *words: str, default: str) -> str:
        """A choice; one that is stored as a number is guessed by the order of the choices."""
        value = self.get(*words, default=default)
        if isinstance(value, str):
            return value
        chosen = choices[int(value)] if 0 <= int(value) < len(choices) else default
        if self.report is not None and chosen not in ("NONE", "RIGID_BODY", "CONSTRAINT"):
            self.report.guessed.append(f"'{self.name}' has the choice {int(value)} of {words[-1]}, taken as {chosen}")
        return chosen

    def left(self) -> list[str]:
        """Names of properties that nobody asked for."""
        return sorted(set(self.values) - self.used)


def adoptable(scene: bpy.types.Scene) -> list[bpy.types.Object]:
    """Objects that are part of the original add-on's scene, or of Blender's rigid-body world, and of no file yet."""
    return [obj for obj in scene.objects if obj.adf.role == "NONE" and _role_of(obj) not in ("NONE", "COLLISION_SHAPE")]


def adopt(scene: bpy.types.Scene) -> Adopted:
    """Make a model of the scene's objects; raises ValueError when there is none."""
    objects = adoptable(scene)
    if not objects:
        raise ValueError("no object has properties of the AMBF add-on, nor a rigid body of Blender")
    whole = Stored(scene)
    names = [_names(obj.name) for obj in objects]
    spaces = [space for space, _ in names if space]
    namespace = str(whole.get("ambf_namespace", default="")) or (max(set(spaces), key=spaces.count) if spaces else "")
    file = making.new_file(scene, "adopted", "MODEL", making.closed(namespace or "/ambf/env/"))
    done = Adopted(file)
    if not namespace:
        done.guessed.append("the namespace is /ambf/env/")
    _file_keys(file, whole)
    entry = scene.adf.models.add()
    entry.collection, entry.path = file, "adopted.yaml"
    roles = {obj: _role_of(obj) for obj in objects}
    for obj, (space, name) in zip(objects, names, strict=True):
        if roles[obj] in ("RIGID_BODY", "GHOST_OBJECT", "BLENDER_BODY"):
            _adopt_shaped(obj, name, making.closed(space) if space else "", roles[obj], done)
    for obj, (_, name) in zip(objects, names, strict=True):
        if roles[obj] == "CONSTRAINT":
            _adopt_joint(obj, name, done)
        elif obj.rigid_body_constraint is not None and roles[obj] in ("BLENDER_JOINT", "BLENDER_BODY"):
            _adopt_blender_joint(obj, name, done)
    return done


def _role_of(obj: bpy.types.Object) -> str:
    stored = Stored(obj)
    role = stored.choice(ROLES, "object_type", default="")
    if role and role != "NONE":
        return role
    if stored and not role:
        if stored.name_of("constraint_name") or stored.name_of("constraint_type"):
            return "CONSTRAINT"
        if stored.name_of("rigid_body"):
            return "RIGID_BODY"
    if obj.rigid_body is not None:
        return "BLENDER_BODY"
    return "BLENDER_JOINT" if obj.rigid_body_constraint is not None else "NONE"


def _names(name: str) -> tuple[str, str]:
    """Namespace and name of an object, both in its name in Blender."""
    space, _, last = name.rpartition("/")
    return space, last


def _file_keys(file: bpy.types.Collection, whole: Stored) -> None:
    group = file.adf.model
    if whole.name_of("ignore_inter"):
        group.ignore_inter_collision = whole.flag("ignore_inter")
    if whole.flag("override_gravity"):
        group.gravity = whole.vector("model_gravity", default=(0.0, 0.0, -9.8))


# --- bodies -----------------------------------------------------------------------------------


def _adopt_shaped(obj: bpy.types.Object, name: str, namespace: str, role: str, done: Adopted) -> None:
    stored = Stored(obj, done)
    ours = "GHOST_OBJECT" if role == "GHOST_OBJECT" else "BODY"
    making.give_role(obj, ours, done.collection)
    group = getattr(obj.adf, ours.lower())
    group.name = topic_name(name)
    _give_key(obj, ours, name, done)
    if namespace and namespace != done.collection.adf.model.namespace:
        group.namespace = namespace
    if role == "BLENDER_BODY":
        _blender_body(obj, group, done)
    elif ours == "BODY":
        _body_keys(obj, group, stored, done)
    if role != "BLENDER_BODY":
        _collision(obj, group, stored, done)
        _owner(obj, stored, ours)
        done.left += [f"'{obj.name}': {left}" for left in stored.left() if not _internal(left)]
    done.bodies += ours == "BODY"
    done.ghosts += ours == "GHOST_OBJECT"


def _give_key(obj: bpy.types.Object, role: str, name: str, done: Adopted) -> None:
    """Identify an object by its name in the file, which is that in Blender without the namespace."""
    obj.adf.key = ""  # its own is no reason to number it
    obj.adf.key = making.free_key(done.collection, role, name)


def _internal(name: str) -> bool:
    """Whether a property belongs to the add-on's own panels."""
    return any(word in name for word in ("show", "pointer", "namespace", "object_type", "visible", "enable", "group"))


def _body_keys(obj: bpy.types.Object, group: bpy.types.PropertyGroup, stored: Stored, done: Adopted) -> None:
    group.mass = 0.0 if stored.flag("is_static") else stored.number("rigid_body", "mass", default=1.0)
    if stored.flag("specify_inertia"):
        for axis in "xyz":
            setattr(group, f"inertia_i{axis}", stored.number(f"inertia_{axis}", default=1.0))
    offset = stored.vector("linear_inertial_offset")
    turned = stored.vector("angular_inertial_offset")
    if offset.any() or turned.any():
        making.inertial_of(obj, frame(rpy_matrix(*turned), offset))
    numbers = (
        ("friction_static", ("static", "friction")), ("friction_rolling", ("rolling", "friction")),
        ("damping_linear", ("linear", "damping")), ("damping_angular", ("angular", "damping")),
        ("restitution", ("restitution",)),
    )  # fmt: skip
    for ours, words in numbers:
        if stored.name_of(*words):
            setattr(group, ours, stored.number(*words, default=0.0))
    if stored.flag("enable_controllers"):
        for half in ("linear", "angular"):
            for letter, default in (("P", 10.0), ("I", 0.0), ("D", 1.0)):
                gain = stored.number(half, f"{letter.lower()}_gain", default=default)
                setattr(group, f"controller_{half}_{letter.lower()}", gain)
        output = stored.choice(OUTPUTS, "rigid_body", "output_type", default="VELOCITY")
        group.controller_output_type = output
    for ours, words in (
        ("passive", ("passive",)), ("publish_children_names", ("children_names",)),
        ("publish_joint_names", ("joint_names",)), ("publish_joint_positions", ("joint_positions",)),
    ):  # fmt: skip
        if stored.name_of(*words):
            setattr(group, ours, stored.flag(*words))


def _collision(obj: bpy.types.Object, group: bpy.types.PropertyGroup, stored: Stored, done: Adopted) -> None:
    if stored.flag("margin_enable"):
        group.collision_margin = stored.number("collision_margin", default=0.001)
    groups = list(stored.get("collision_groups", default=()))
    if any(groups):
        group.collision_groups = ", ".join(str(i) for i, on in enumerate(groups) if on)
    kind = stored.choice(COLLISIONS, "collision_type", default="MESH")
    if kind == "MESH":
        chosen = stored.choice(MESH_TYPES, "collision_mesh_type", default="CONVEX_HULL")
        if obj.type == "MESH":
            group.collision_mesh_type = chosen
        other = stored.get("ambf_collision_mesh", default=None) if stored.flag("separate_collision_mesh") else None
        if isinstance(other, bpy.types.Object) and other.type == "MESH":
            _hull(obj, other)
        return
    items = list(stored.get("collision_shape_prop_collection", default=()))
    if kind == "SINGULAR_SHAPE":
        items = items[:1]
    for item in items:
        entry = Stored(dict(item.items()), done)
        entry.name = obj.name
        making.add_shape(obj, *_shape_of(entry))
        done.shapes += 1
    if not items:
        done.guessed.append(f"'{obj.name}' has no stored primitive, so that it collides by its mesh")


def _shape_of(entry: Stored) -> tuple[Shape, str, np.ndarray]:
    """A primitive of the add-on, its use, and its pose in the body."""
    names = [name for name in entry.values if name.endswith(("shape", "shape_type"))]
    kind = entry.choice(SHAPES, names[0], default="BOX") if names else "BOX"
    shape = Shape(
        kind,
        tuple(entry.vector("dims", default=(1.0, 1.0, 1.0))),
        entry.number("radius", default=1.0),
        entry.number("height", default=1.0),
        entry.choice(AXES, "axis", default="Z"),
    )
    return shape, "COLLISION", frame(rpy_matrix(*entry.vector("angular_offset")), entry.vector("linear_offset"))


def _hull(obj: bpy.types.Object, other: bpy.types.Object) -> None:
    """A separate collision mesh as a part of its body, at the body's origin, where the simulator puts it."""
    part = making.new_part(obj, f"{obj.name} hull", other.data, "HULL")
    part.display_type, part.hide_render = "WIRE", True


def _owner(obj: bpy.types.Object, stored: Stored, ours: str) -> None:
    parent = stored.get("object_parent", default=None)
    if ours == "GHOST_OBJECT" and isinstance(parent, bpy.types.Object):
        making.parent_in_place(obj, parent)


def _blender_body(obj: bpy.types.Object, group: bpy.types.PropertyGroup, done: Adopted) -> None:
    """Keys of a rigid body of Blender."""
    own = obj.rigid_body
    group.mass = 0.0 if own.type == "PASSIVE" or own.kinematic or not own.enabled else own.mass
    group.friction_static, group.restitution = own.friction, own.restitution
    group.damping_linear, group.damping_angular = own.linear_damping, own.angular_damping
    if own.use_margin:
        group.collision_margin = own.collision_margin
    groups = [str(i) for i, on in enumerate(own.collision_collections) if on]
    if groups not in ([], ["0"]):
        group.collision_groups = ", ".join(groups)
    if own.collision_shape in BLENDER_SHAPES and obj.type == "MESH" and not len(points_of(own_solid(obj))[0]):
        done.left.append(f"'{obj.name}': its {own.collision_shape.lower()}, since its mesh has no face")
    elif own.collision_shape in BLENDER_SHAPES and obj.type == "MESH":
        making.add_shape(obj, *_fitted(obj, BLENDER_SHAPES[own.collision_shape]))
        done.shapes += 1
        done.guessed.append(f"'{obj.name}': its {own.collision_shape.lower()} has the size of its mesh's bounding box")
    else:
        group.collision_mesh_type = "CONVEX_HULL" if own.collision_shape == "CONVEX_HULL" else "CONCAVE_MESH"
    if own.collision_shape == "COMPOUND":
        done.guessed.append(f"'{obj.name}' is a compound of its children; it collides by its own mesh here")
    if own.kinematic:
        done.guessed.append(f"'{obj.name}' is animated in Blender and stands still here")


def _fitted(obj: bpy.types.Object, kind: str) -> tuple[Shape, str, np.ndarray]:
    """The primitive of a kind with the extents of a mesh, along Z as in Blender."""
    points = points_of(own_solid(obj))[0]
    size, middle = np.ptp(points, axis=0), (points.min(axis=0) + points.max(axis=0)) / 2.0
    radius = float(size.max() if kind == "SPHERE" else max(size[:2])) / 2.0
    height = max(float(size[2]), 2.0 * radius if kind == "CAPSULE" else 0.0)
    return Shape(kind, tuple(float(v) for v in size), radius, height), "COLLISION", frame(np.eye(3), middle)


# --- joints -----------------------------------------------------------------------------------


def _adopt_joint(obj: bpy.types.Object, name: str, done: Adopted) -> None:
    stored = Stored(obj, done)
    ends = [stored.get(f"object_{end}", default=None) for end in ("parent", "child")]
    ends = [end if isinstance(end, bpy.types.Object) and end.adf.role == "BODY" else None for end in ends]
    if None in ends:
        done.left.append(f"'{obj.name}' is a joint without both bodies")
        return
    kind = stored.choice(JOINTS, "constraint_type", default="REVOLUTE").lower().replace("_", " ")
    axis = stored.choice(AXES, "constraint_axis", default="Z")
    own = str(stored.get("constraint_name", default="")) or name
    _make_joint(obj, own, kind, ends, axis, done)
    group = obj.adf.joint
    slides = kind in SLIDING
    if kind in ("revolute", *SLIDING, "torsion spring") and stored.flag("limits_enable", default=True):
        for ours, word, default in (("low", "lower", -60.0), ("high", "higher", 60.0)):
            value = stored.number("limits", word, default=default)
            setattr(group, f"joint_limits_{ours}", value if slides else radians(value))
    if kind == "cone twist":
        for axis_name, value in zip("xyz", stored.vector("cone_twist", "limits", default=(60.0,) * 3), strict=True):
            setattr(group, f"joint_limits_{axis_name}", radians(float(value)))
    if kind.startswith("six dof"):
        _six(group, stored, kind)
    elif kind in ("linear spring", "torsion spring"):
        group.damping = stored.number("constraint_damping", default=0.7)
        group.stiffness = stored.number("constraint_stiffness", default=10.0)
        rest = stored.number("equilibrium_point", default=0.0)
        group.equilibrium_point = rest if slides else radians(rest)
    if stored.flag("enable_controller_gains"):
        for letter, default in (("p", 10.0), ("i", 0.0), ("d", 1.0)):
            setattr(group, f"controller_{letter}", stored.number("constraint", f"{letter}_gain", default=default))
        group.controller_output_type = stored.choice(OUTPUTS, "constraint", "output_type", default="VELOCITY")
    if stored.name_of("max_motor_impulse"):
        group.max_motor_impulse = stored.number("max_motor_impulse", default=0.05)
    if stored.flag("enable_feedback"):
        group.enable_feedback = True
    if stored.flag("constraint", "passive"):
        group.passive = True
    done.left += [f"'{obj.name}': {left}" for left in stored.left() if not _internal(left)]


def _six(group: bpy.types.PropertyGroup, stored: Stored, kind: str) -> None:
    """Limits of a six-DOF joint, and its springs."""
    for half, most in (("linear", 1.0), ("angular", 60.0)):
        scale = 1.0 if half == "linear" else radians(1.0)
        for end, sign in (("low", -1.0), ("high", 1.0)):
            limits = stored.vector("six_dof", "limits", end, half, default=(sign * most,) * 3)
            for axis, value in zip("xyz", limits, strict=True):
                setattr(group, f"joint_limits_{half}_{end}_{axis}", float(value) * scale)
        if kind != "six dof spring":
            continue
        for block, default, unit in (("stiffness", 1.0, 1.0), ("damping", 1.0, 1.0), ("equilibrium", 0.0, scale)):
            values = stored.vector("six_dof", block, half, default=(default,) * 3)
            ours = "equilibrium_point" if block == "equilibrium" else block
            for axis, value in zip("xyz", values, strict=True):
                setattr(group, f"{ours}_{half}_{axis}", float(value) * unit)


def _adopt_blender_joint(obj: bpy.types.Object, name: str, done: Adopted) -> None:
    """Make a joint of a rigid-body constraint of Blender; the object that has it may be a body itself."""
    own = obj.rigid_body_constraint
    ends = [own.object1, own.object2]
    why = (
        "is switched off" if not own.enabled
        else f"is of type {own.type.lower()}, which has no joint in the format" if own.type not in BLENDER_JOINTS
        else "has not both bodies" if any(end is None or end.adf.role != "BODY" for end in ends)
        else ""
    )  # fmt: skip
    if why:
        done.left.append(f"'{obj.name}': its constraint {why}")
        return
    kind = BLENDER_JOINTS[own.type]
    joint = obj
    if obj.adf.role == "BODY":
        joint = bpy.data.objects.new(f"{ends[0].name}-{ends[1].name}", None)
        done.collection.objects.link(joint)
        place(joint, rest_pose(obj))
        name = joint.name
    _make_joint(joint, name, kind, ends, "Z", done, turned=False)
    group = joint.adf.joint
    if kind == "revolute" and own.use_limit_ang_z:
        group.joint_limits_low, group.joint_limits_high = turned_limits(own.limit_ang_z_lower, own.limit_ang_z_upper)
    if kind == "prismatic" and own.use_limit_lin_x:
        group.joint_limits_low, group.joint_limits_high = own.limit_lin_x_lower, own.limit_lin_x_upper
    if kind.startswith("six dof"):
        _blender_six(group, own, kind)
    if not own.disable_collisions:
        group.ignore_inter_collision = False


def turned_limits(low: float, high: float) -> tuple[float, float]:
    """Limits of a rotation by the right-hand rule, which Blender states by the left-hand one, as Bullet counts it.

    Those of a piston are right-handed in Blender too.
    """
    return 0.0 - high, 0.0 - low


def _blender_six(group: bpy.types.PropertyGroup, own: bpy.types.RigidBodyConstraint, kind: str) -> None:
    """Limits of a generic constraint. The format states a free axis as a low limit above the high one."""
    for half, short in (("linear", "lin"), ("angular", "ang")):
        for axis in "xyz":
            fixed = own.type == "PISTON" and axis != "x"
            limited = fixed or getattr(own, f"use_limit_{short}_{axis}")
            low, high = (
                (0.0, 0.0)
                if fixed
                else tuple(getattr(own, f"limit_{short}_{axis}_{end}") for end in ("lower", "upper"))
                if limited
                else (1.0, -1.0)
            )
            if half == "angular" and limited and own.type != "PISTON":
                low, high = turned_limits(low, high)
            setattr(group, f"joint_limits_{half}_low_{axis}", low)
            setattr(group, f"joint_limits_{half}_high_{axis}", high)
            if kind == "six dof spring":
                word = axis if half == "linear" else f"ang_{axis}"
                on = getattr(own, f"use_spring_{word}")
                setattr(group, f"stiffness_{half}_{axis}", getattr(own, f"spring_stiffness_{word}") if on else 0.0)
                setattr(group, f"damping_{half}_{axis}", getattr(own, f"spring_damping_{word}") if on else 0.0)


def _make_joint(
    obj: bpy.types.Object, name: str, kind: str, ends: list, axis: str, done: Adopted, turned: bool = True
) -> None:
    """Make an object the joint of two bodies; its frame is rotated so that the axis is that of this format."""
    T = rest_pose(obj)
    if turned:
        T = T @ frame(TURNS[axis], (0.0, 0.0, 0.0))
        if kind == "prismatic":
            T = T @ frame(axis_rotation((0.0, 1.0, 0.0), -np.pi / 2), (0.0, 0.0, 0.0))  # it slides along its X
    making.give_role(obj, "JOINT", done.collection)
    _give_key(obj, "JOINT", name, done)
    obj.adf.joint.name = name
    obj.adf.joint.type = kind
    obj.adf.parent_object, obj.adf.child_object = ends
    making.parent_in_place(obj, ends[0], T)
    done.joints += 1


__all__ = ["Adopted", "adopt", "adoptable"]
