"""Random chains of bodies and joints, as users make them by operators."""

import bpy
import numpy as np
from mathutils import Quaternion

from .scene import body, model, select

KINDS = ("revolute", "prismatic", "torsion spring", "linear spring", "six dof", "fixed")
SHAPES = ("BOX", "SPHERE", "CYLINDER", "CAPSULE", "CONE")


def turned(obj, rng):
    """Turn an object at random."""
    obj.rotation_mode = "QUATERNION"
    obj.rotation_quaternion = Quaternion(rng.normal(size=4).tolist()).normalized()
    bpy.context.view_layer.update()


def random_chain(seed, count=5, kinds=KINDS):
    """A tree of lopsided bodies with primitives, hulls, inertia, a ghost and a sensor; returns bodies and joints."""
    rng = np.random.default_rng(seed)
    model()
    bodies, joints = [], []
    for n in range(count):
        part = body(f"link{n}_left", size=0.1, location=rng.uniform(-0.5, 0.5, 3))
        part.data.vertices[0].co.x -= 0.05  # no mirror plane of its own
        part.data.vertices[6].co.y += 0.08
        part.scale = rng.uniform(0.5, 2.0, 3)
        turned(part, rng)
        part.adf.body.mass = float(rng.uniform(0.1, 3.0))
        bpy.ops.adf.add_shape(
            kind=str(rng.choice(SHAPES)), size=rng.uniform(0.01, 0.1, 3), radius=0.02, height=0.1,
            axis=str(rng.choice(list("XYZ"))), position=rng.uniform(-0.1, 0.1, 3), rotation=rng.uniform(-3, 3, 3),
        )  # fmt: skip
        if n % 2:
            bpy.ops.adf.add_hull()
        bpy.ops.adf.set_inertia(source="MESH")
        bodies.append(part)
        if n:
            parent = bodies[rng.integers(0, n)]
            select(part, parent)
            bpy.ops.adf.connect(type=str(rng.choice(kinds)))
            joint = next(o for o in bpy.data.objects if o.adf.role == "JOINT" and o not in joints)
            turned(joint, rng)
            limit(joint, rng)
            joints.append(joint)
    select(bodies[-1])
    bpy.context.scene.cursor.location = rng.uniform(-0.3, 0.3, 3)
    bpy.ops.adf.add(role="GHOST_OBJECT", name="feeler_left")
    select(bodies[-1])
    bpy.ops.adf.add_sensor(which="FAN")
    return bodies, joints


def limit(joint, rng):
    """Limits at random, uneven on both sides."""
    group = joint.adf.joint
    if group.type.startswith("six dof"):
        for half in ("linear", "angular"):
            for axis in "xyz":
                low, high = -float(rng.uniform(0.01, 0.3)), float(rng.uniform(0.01, 0.3))
                setattr(group, f"joint_limits_{half}_low_{axis}", low)
                setattr(group, f"joint_limits_{half}_high_{axis}", high)
    elif group.type != "fixed":
        group.joint_limits_low, group.joint_limits_high = -float(rng.uniform(0.01, 0.9)), float(rng.uniform(0.01, 0.9))
