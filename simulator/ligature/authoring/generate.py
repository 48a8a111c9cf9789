"""Generates parts of suturing scenes: needle, thread, suture hole, grasp set of two jaws, stereo endoscope.

Every function returns `Parts`: objects of a model or world file, and the meshes that they name. All
numbers are SI; poses are in the world, or in the frame of the parent that is named.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ligature.adf.frames import Array, axis_rotation, frame, inverse, minimal_rotation
from ligature.adf.update import Item
from ligature.authoring.placement import joint_keys, pose_of
from ligature.authoring.shapes import Shape, shape_properties
from ligature.mesh.inertia import MassProperties, mass_properties
from ligature.mesh.mesh import Mesh, MeshPart

STEEL = 7900.0
SUTURE_DENSITY = 1200.0
RING_SIDES = 12


@dataclass(frozen=True)
class Parts:
    """Generated objects, and the meshes that their keys name, by file name."""

    items: tuple[Item, ...]
    meshes: Mapping[str, Mesh] = field(default_factory=dict)

    def __add__(self, other: Parts) -> Parts:
        return Parts((*self.items, *other.items), {**self.meshes, **other.meshes})


@dataclass(frozen=True, eq=False)
class Anchor:
    """A body that holds something: its key, its pose in the world, its inertial frame in the body."""

    key: str
    T_world: Array
    T_inertial: Array = field(default_factory=lambda: np.eye(4))


@dataclass(frozen=True)
class Needle:
    """A curved needle: ``arc`` radians of a circle of ``radius``, a wire of ``thickness``, a point of ``taper``.

    ``taper`` is the part of the arc over which the wire narrows to the point; ``hulls`` is the number
    of convex pieces that collide.
    """

    radius: float = 0.0085
    arc: float = np.pi
    thickness: float = 0.001
    taper: float = 0.25
    hulls: int = 9


@dataclass(frozen=True)
class Thread:
    """A thread: metres, the number of elements, and the material (E in Pa, density in kg/m³, damping in s)."""

    length: float = 0.1
    diameter: float = 0.0004
    elements: int = 40
    youngs_modulus: float = 2.0e9
    poisson_ratio: float = 0.4
    density: float = SUTURE_DENSITY
    damping_time: float = 0.002


def needle(spec: Needle, name: str = "Needle", T_world: Array | None = None) -> Parts:
    """A needle body with its visual mesh and convex pieces.

    The arc lies in the XY plane around the origin, from +X to the angle ``arc``.
    """
    count = max(spec.hulls, 1)
    stations = np.linspace(0.0, spec.arc, 4 * count + 1)
    visual = _tube(spec, stations)
    pieces = [_tube(spec, stations[4 * i : 4 * i + 5 : 4]) for i in range(count)]
    files = {
        f"{name}.OBJ": Mesh(Path(f"{name}.OBJ"), (MeshPart(name, *visual),)),
        f"{name}_collision.OBJ": Mesh(
            Path(f"{name}_collision.OBJ"), tuple(MeshPart(f"hull_{i:03d}", *p) for i, p in enumerate(pieces))
        ),
    }
    solid = mass_properties(*visual, STEEL)
    values = {
        "name": name,
        "mesh": f"{name}.OBJ",
        "collision mesh": f"{name}_collision.OBJ",
        "collision mesh type": "CONVEX_HULL",
        "collision margin": spec.thickness / 10.0,
        "friction.static": 0.3,
        "damping.linear": 0.1,
        "damping.angular": 0.5,
        **mass_keys(solid),
        "location": pose_of(np.eye(4) if T_world is None else T_world),
    }
    return Parts((Item("body", f"BODY {name}", values),), files)


def needle_end(spec: Needle) -> Array:
    """Pose (4, 4), in the needle's frame, of its blunt end: +Z leaves the needle there."""
    return frame(minimal_rotation((0.0, 0.0, 1.0), (0.0, -1.0, 0.0)), (spec.radius, 0.0, 0.0))


def suture(spec: Thread, T_start: Array, name: str = "Suture", parent: str = "") -> Parts:
    """A thread by physical data in one block; it leaves ``T_start``, in the parent's frame, along +Z."""
    values: dict[str, Any] = {
        "name": name,
        "length": spec.length,
        "diameter": spec.diameter,
        "density": spec.density,
        "youngs modulus": spec.youngs_modulus,
        "poisson ratio": spec.poisson_ratio,
        "damping time": spec.damping_time,
        "elements": spec.elements,
        "location": pose_of(T_start),
    }
    if parent:
        values["parent"] = parent
    return Parts((Item("suture", name, values),))


def suture_chain(spec: Thread, T_start: Array, name: str = "Thread", anchor: Anchor | None = None) -> Parts:
    """A thread as capsules and six-DOF springs, which every simulator of the format can load.

    ``T_start`` is in the world; ``anchor`` holds the start. The stiffness of a joint is that of a rod of the
    element's length: E·I over length for bending, G·J over length for twist, with I = πd⁴/64 and J = 2I.
    """
    step = spec.length / spec.elements
    radius = spec.diameter / 2.0
    shape = Shape("CAPSULE", radius=radius, height=step + spec.diameter)
    solid = shape_properties(shape).with_mass(spec.density * np.pi * radius**2 * step)
    bodies = [f"{name}_{i:03d}" for i in range(spec.elements)]
    poses = [T_start @ frame(np.eye(3), (0.0, 0.0, (i + 0.5) * step)) for i in range(spec.elements)]
    items = [
        Item("body", f"BODY {body}", {
            "name": body,
            "collision shape": shape.kind,
            **{f"collision geometry.{key}": value for key, value in shape.geometry().items()},
            "shape": shape.kind,
            **{f"geometry.{key}": value for key, value in shape.geometry().items()},
            "collision margin": radius / 10.0,
            "mass": solid.mass,
            **_moments(np.diag(solid.inertia)),
            "damping.linear": 0.5,
            "damping.angular": 0.5,
            "location": pose_of(T),
            "passive": True,
        })
        for body, T in zip(bodies, poses, strict=True)
    ]  # fmt: skip
    second = np.pi * spec.diameter**4 / 64.0
    shear = spec.youngs_modulus / (2.0 * (1.0 + spec.poisson_ratio))
    stiffness = (spec.youngs_modulus * second / step,) * 2 + (2.0 * shear * second / step,)
    for i in range(1, spec.elements):
        T_joint = poses[i - 1] @ frame(np.eye(3), (0.0, 0.0, step / 2.0))
        items.append(_spring(bodies[i - 1], bodies[i], poses[i - 1], poses[i], T_joint, stiffness, spec.damping_time))
    if anchor is not None:
        ends = _joint_ends(anchor, f"BODY {bodies[0]}", poses[0], T_start)
        values = {"name": f"{name} start", **ends, "type": "fixed", "passive": True}
        items.append(Item("joint", f"JOINT {name} start", values))
    return Parts(tuple(items))


def suture_hole(
    name: str, T_world: Array, anchor: Anchor, radius: float = 0.0015, wire: float = 0.0003,
    stiffness: float = 100.0, damping: float = 1.0, travel: float = 0.001,
) -> Parts:  # fmt: skip
    """A ring of four capsules around Z, held to a body by a six-DOF spring, with a ghost that feels the needle."""
    side = Shape("CAPSULE", radius=wire, height=2.0 * (radius + wire), axis="Y")
    ring = tuple(
        {
            "shape": side.kind,
            **{f"geometry.{key}": value for key, value in side.geometry().items()},
            "offset": pose_of(frame(R, R @ np.array([radius, 0.0, 0.0]))),
        }
        for R in (axis_rotation((0.0, 0.0, 1.0), quarter * np.pi / 2.0) for quarter in range(4))
    )
    body = Item("body", f"BODY {name}", {
        "name": name,
        "compound collision shape": ring,
        "collision margin": wire / 10.0,
        "mass": 0.001,
        **_moments(np.full(3, 0.001 * radius**2)),
        "damping.linear": 0.5,
        "damping.angular": 0.5,
        "visible": False,
        "location": pose_of(T_world),
    })  # fmt: skip
    linear = {
        f"joint limits.linear.{end}.{a}": sign * travel for end, sign in (("low", -1), ("high", 1)) for a in "xyz"
    }
    angular = {f"joint limits.angular.{end}.{a}": 0.0 for end in ("low", "high") for a in "xyz"}
    joint = Item("joint", f"JOINT {name}", {
        "name": f"{name}-spring",
        **_joint_ends(anchor, f"BODY {name}", T_world, T_world),
        "type": "six dof spring",
        **linear,
        **angular,
        **{f"stiffness.linear.{a}": stiffness for a in "xyz"},
        **{f"damping.linear.{a}": damping for a in "xyz"},
        **{f"stiffness.angular.{a}": 0.0 for a in "xyz"},
        **{f"damping.angular.{a}": 0.0 for a in "xyz"},
    })  # fmt: skip
    ghost = Item("ghost object", f"GHOST {name}", {
        "name": f"{name}_ghost",
        "parent": f"BODY {name}",
        "collision shape": "CYLINDER",
        "collision geometry.radius": radius,
        "collision geometry.height": 2.0 * wire,
        "visible": False,
        "location": pose_of(np.eye(4)),
    })  # fmt: skip
    return Parts((body, joint, ghost))


def jaw_grasp_set(
    left: str, right: str, wrist: str, reach: float = 0.0066,
    size: tuple[float, float, float] = (0.0004, 0.0052, 0.0016), name: str = "grasp",
) -> Parts:  # fmt: skip
    """A ghost on each jaw and the actuator between them; ``left``, ``right`` and ``wrist`` are references to bodies.

    ``reach`` is the distance from a jaw's pivot along its +Y to the middle of its grasping face.
    """
    items = [
        Item("ghost object", f"GHOST {name} {side}", {
            "name": f"{side}_finger_ghost",
            "parent": jaw,
            "collision shape": "BOX",
            **dict(zip(("collision geometry.x", "collision geometry.y", "collision geometry.z"), size, strict=True)),
            "visible": False,
            "location": ((0.0, reach, 0.0), (0.0, 0.0, 0.0)),
        })
        for side, jaw in (("left", left), ("right", right))
    ]  # fmt: skip
    actuator = Item("actuator", f"ACTUATOR {name}", {
        "name": "Actuator0",
        "type": "CONSTRAINT",
        "parent": wrist,
        "location": ((0.0, -reach, 0.0), (0.0, 0.0, 0.0)),
    })  # fmt: skip
    return Parts((*items, actuator))


def stereo_endoscope(
    parent: str = "",
    separation: float = 0.004,
    field_of_view: float = 1.2,
    ahead: float = 0.05,
    size: tuple[int, int] = (640, 480),
) -> Parts:
    """Two parallel cameras ``separation`` apart that look along the parent's −Z with +Y up, and publish."""
    items = []
    for side, x in (("L", -separation / 2.0), ("R", separation / 2.0)):
        values: dict[str, Any] = {
            "name": f"camera{side}",
            "namespace": "cameras/",
            "location": (x, 0.0, 0.0),
            "look at": (x, 0.0, -ahead),
            "up": (0.0, 1.0, 0.0),
            "clipping plane.near": 0.001,
            "clipping plane.far": 10.0,
            "field view angle": field_of_view,
            "publish image": True,
            "publish image interval": 4,
            "publish image resolution.width": size[0],
            "publish image resolution.height": size[1],
        }
        items.append(Item("camera", f"camera{side}", {**values, "parent": parent} if parent else values))
    return Parts(tuple(items))


def mass_keys(solid: MassProperties, factor: float = 1.0) -> dict[str, Any]:
    """Mass, principal moments times ``factor`` and inertial frame of a solid in its body's frame."""
    moments, axes = solid.principal()
    if np.abs(solid.inertia - np.diag(np.diag(solid.inertia))).max() <= 1e-6 * moments[-1]:
        moments, axes = np.diag(solid.inertia), np.eye(3)  # the body's own axes will do
    return {"mass": solid.mass, **_moments(moments * factor), "inertial offset": pose_of(frame(axes, solid.centre))}


def _moments(moments: Array) -> dict[str, float]:
    return dict(zip(("inertia.ix", "inertia.iy", "inertia.iz"), map(float, moments), strict=True))


def _tube(spec: Needle, stations: Array) -> tuple[Array, Any]:
    """Closed surface of the wire between the first and the last station, angles along the arc."""
    taper_from = spec.arc * (1.0 - spec.taper)
    rings, around = [], np.linspace(0.0, 2.0 * np.pi, RING_SIDES, endpoint=False)
    for angle in stations:
        left = (spec.arc - angle) / (spec.arc - taper_from) if angle > taper_from else 1.0
        thick = spec.thickness / 2.0 * max(float(left), 0.05)
        out = np.array([np.cos(angle), np.sin(angle), 0.0])
        offsets = np.outer(np.cos(around), out) + np.outer(np.sin(around), [0.0, 0.0, 1.0])
        rings.append(spec.radius * out + thick * offsets)
    vertices = np.vstack([*rings, rings[0].mean(axis=0), rings[-1].mean(axis=0)])
    n, last = RING_SIDES, (len(stations) - 1) * RING_SIDES
    first_middle, last_middle = len(vertices) - 2, len(vertices) - 1
    faces = []
    for k in range(n):
        j = (k + 1) % n
        for low in range(0, last, n):
            a, b, c, d = low + k, low + j, low + n + j, low + n + k
            faces += [(a, b, c), (a, c, d)]
        faces += [(first_middle, j, k), (last_middle, last + k, last + j)]
    found = np.array(faces, dtype=np.int32)
    a, b, c = (vertices[found[:, i]] for i in range(3))
    if np.einsum("ij,ij->", a - vertices.mean(axis=0), np.cross(b - a, c - a)) < 0.0:
        found = found[:, ::-1]
    return vertices, found


def _joint_ends(anchor: Anchor, child: str, T_child: Array, T_joint: Array) -> dict[str, Any]:
    """The keys that state which bodies a joint holds, and where; all poses in the world."""
    to_parent = inverse(anchor.T_world)
    keys = joint_keys(to_parent @ T_joint, to_parent @ T_child, anchor.T_inertial)
    return {
        "parent": anchor.key,
        "child": child,
        "parent pivot": keys.parent_pivot,
        "child pivot": keys.child_pivot,
        "parent axis": keys.parent_axis,
        "child axis": keys.child_axis,
        "offset": keys.offset,
        "joint offset": keys.joint_offset,
    }


def _spring(
    before: str,
    after: str,
    T_before: Array,
    T_after: Array,
    T_joint: Array,
    stiffness: tuple[float, ...],
    damping_time: float,
) -> Item:
    """A joint of a thread: bending and twisting against a spring, no stretching."""
    limits = {f"joint limits.linear.{end}.{a}": 0.0 for end in ("low", "high") for a in "xyz"}
    turns = {f"joint limits.angular.{end}.{a}": s * 0.8 for end, s in (("low", -1), ("high", 1)) for a in "xyz"}
    springs = {f"stiffness.angular.{a}": k for a, k in zip("xyz", stiffness, strict=True)}
    dampers = {f"damping.angular.{a}": k * damping_time for a, k in zip("xyz", stiffness, strict=True)}
    locked = {f"{what}.linear.{a}": 0.0 for what in ("stiffness", "damping") for a in "xyz"}
    ends = _joint_ends(Anchor(f"BODY {before}", T_before), f"BODY {after}", T_after, T_joint)
    values = {
        "name": f"{before}-{after}",
        **ends,
        "type": "six dof spring",
        **limits,
        **turns,
        **springs,
        **dampers,
        **locked,
    }
    return Item("joint", f"JOINT {before}-{after}", {**values, "passive": True})
