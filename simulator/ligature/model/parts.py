"""Bodies, joints and sensors of one element each; bodies and sensors before they have index and identity.

Frames and units as in `ligature.model.scene`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ligature.adf import Diagnostic, Element, Severity
from ligature.mesh import box_inertia
from ligature.model.frames import Array, frame, joint_frames, pose_matrix
from ligature.model.geometry import FileContext, colliders, estimate_size, mesh_centroid, visual
from ligature.model.scene import (
    Body,
    CartesianController,
    Gains,
    Identity,
    Joint,
    JointType,
    OutputType,
    Resistance,
    Sensor,
    SensorType,
    SixDof,
)
from ligature.model.shapes import Collider, ShaderFiles
from ligature.model.tissue import inertial_of, surface_friction, tissue_of

_INERTIAL_KEYS = ("inertia", "inertial offset", "gravity")
SIX = tuple(f"{half}.{axis}" for half in ("linear", "angular") for axis in "xyz")


def body_of(element: Element, context: FileContext, gravity: Array, shaders: ShaderFiles | None) -> Callable[..., Body]:
    """Makes a body, without its joints, of ``index`` and ``identity``.

    ``gravity`` (3,) holds unless the body has its own. Raises `GeometryError`.
    """
    inertial_block = element.has("mass")
    offset = pose_matrix(*element.pose("inertial offset")) if element.has("inertial offset") else None
    shapes = colliders(element, context, np.eye(4) if offset is None else offset)
    looks = visual(element, context, shaders)
    tissue = tissue_of(element, context, looks, shapes)
    margin = element.number("collision margin")
    own = np.array([element.number(f"inertia.{k}") for k in ("ix", "iy", "iz")]) if element.has("inertia") else None
    if tissue is not None:
        mass = element.number("mass") if inertial_block else float(tissue.cell_masses.sum())
        tissue = tissue.with_mass(mass)
        T_body_inertial, inertia = inertial_of(tissue, mass, offset if inertial_block else None)
        inertia = own if inertial_block and own is not None else inertia
        shapes = ()
    else:
        if not inertial_block:
            _warn_no_mass(element, context)
        T_body_inertial = offset if offset is not None and inertial_block else _estimated_offset(shapes)
        mass = element.number("mass")
        if inertial_block and own is not None:
            inertia = own
        else:
            size = estimate_size(shapes, T_body_inertial, margin)
            inertia = np.zeros(3) if size is None else box_inertia(mass, size)
    own_gravity = inertial_block and element.has("gravity")
    return partial(
        Body,
        mass=mass,
        inertia=inertia,
        T_body_inertial=T_body_inertial,
        T_world_body=pose_matrix(*element.pose("location")),
        gravity=np.array(element.vector("gravity")) if own_gravity else gravity,
        colliders=shapes,
        visual=looks,
        collision_margin=margin,
        friction=surface_friction(element),
        rolling_friction=element.number("friction.rolling"),
        restitution=element.number("restitution"),
        linear_damping=min(max(element.number("damping.linear"), 0.0), 1.0),
        angular_damping=min(max(element.number("damping.angular"), 0.0), 1.0),
        controller=controller_of(element, "controller", CartesianController()),
        publish_children_names=element.flag("publish children names"),
        publish_joint_names=element.flag("publish joint names"),
        publish_joint_positions=element.flag("publish joint positions"),
        needle=element.value("ligature needle"),
        inertia_estimated=not (inertial_block and own is not None),
        tissue=tissue,
    )


def _estimated_offset(shapes: tuple[Collider, ...]) -> Array:
    """Inertial frame (4, 4) in B of a body that gives none: at the centroid of its collision mesh (§12.6)."""
    centroid = mesh_centroid(shapes)
    return np.eye(4) if centroid is None else frame(np.eye(3), centroid)


def _warn_no_mass(element: Element, context: FileContext) -> None:
    ignored = [key for key in _INERTIAL_KEYS if element.has(key)]
    severity = Severity.WARNING if ignored else Severity.INFO
    rest = f", and its {', '.join(ignored)} has no effect" if ignored else ""
    message = f"body '{element.key}' has no 'mass'; using 1 kg{rest}"
    context.report(Diagnostic(severity, message, element.mark, "add mass: kilograms; 0 makes it static", "mass"))


def controller_of(element: Element, key: str, otherwise: CartesianController) -> CartesianController:
    """The Cartesian controller below ``key``; without that key, ``otherwise``."""
    if not element.has(key):
        return otherwise
    output = element.value("controller output type") if key == "controller" else None

    def half(name: str) -> tuple[Gains, OutputType]:
        given = element.has(f"{key}.{name}")
        gains = Gains(*(element.number(f"{key}.{name}.{k}") for k in "PID")) if given else Gains()
        if output is not None:
            return gains, OutputType[output]
        return gains, OutputType.FORCE if given else OutputType.VELOCITY

    (linear, linear_output), (angular, angular_output) = half("linear"), half("angular")
    return CartesianController(linear, angular, linear_output, angular_output)


def joint_of(
    element: Element, index: int, identity: Identity, parent: Body, child: Body, scales: tuple[float, float]
) -> Joint:
    """A joint between two bodies; ``scales`` multiply the pivots of parent and child."""
    kind = JointType(element.value("type") or "revolute")
    offset = element.value("offset")
    frames = joint_frames(
        parent.T_body_inertial,
        child.T_body_inertial,
        np.array(element.vector("parent pivot")) * scales[0],
        np.array(element.vector("child pivot")) * scales[1],
        element.vector("parent axis"),
        element.vector("child axis"),
        element.number("child offset") if offset is None else offset,
        element.number("joint offset"),
        kind is JointType.PRISMATIC,
    )
    T_zero = parent.T_body_inertial @ frames.T_parent_child @ np.linalg.inv(child.T_body_inertial)
    low, high = _limits(element, kind)
    springs = kind in (JointType.LINEAR_SPRING, JointType.TORSION_SPRING)
    equilibrium = _scalar(element, "equilibrium point") if springs else None
    if equilibrium is None:
        equilibrium = 0.0 if low is None or high is None else (low + high) / 2
    output = element.value("controller output type")
    default_output = "FORCE" if element.has("controller") else "VELOCITY"
    return Joint(
        index=index,
        identity=identity,
        type=kind,
        parent=parent.index,
        child=child.index,
        axis=frames.axis,
        T_parent_a=frames.T_parent_a,
        T_child_b=frames.T_child_b,
        T_parent_child_zero=T_zero,
        low=low,
        high=high,
        controller=Gains(*(element.number(f"controller.{k}") for k in "PID")),
        output=OutputType[output or default_output],
        max_motor_impulse=element.number("max motor impulse"),
        erp=element.number("joint erp"),
        cfm=element.number("joint cfm"),
        stiffness=(_scalar(element, "stiffness") or 0.0) if springs else 0.0,
        damping=(_scalar(element, "damping") or 0.0) if springs else 0.0,
        equilibrium=equilibrium,
        six_dof=_six_dof(element, kind),
        cone_twist=_cone_twist(element, kind),
        motor_enabled=element.raw_value("enable motor") not in ("0", "false", "False", "no", "off"),
        feedback=element.flag("enable feedback"),
        passive=element.flag("passive"),
    )


def _limits(element: Element, kind: JointType) -> tuple[float | None, float | None]:
    """Both limits or none; a fixed joint has none, a revolute one with low > high neither (§14)."""
    low, high = element.value("joint limits.low"), element.value("joint limits.high")
    limited = (JointType.REVOLUTE, JointType.PRISMATIC, JointType.LINEAR_SPRING, JointType.TORSION_SPRING)
    if low is None or high is None or kind not in limited or low > high:
        return None, None
    return float(low), float(high)


def _scalar(element: Element, path: str) -> float | None:
    """A number where the schema also allows a block; None for a block, and for a number that cannot be used."""
    value = element.value(path)
    return None if isinstance(value, dict) else value


def _six_dof(element: Element, kind: JointType) -> SixDof | None:
    if kind not in (JointType.SIX_DOF, JointType.SIX_DOF_SPRING):
        return None

    def six(block: str, middle: str = "") -> Array:
        names = [f"{block}.{s.replace('.', middle + '.') if middle else s}" for s in SIX]
        return np.array([element.number(name) for name in names])

    low, high = six("joint limits", ".low"), six("joint limits", ".high")
    wrapped = [np.where(np.abs(v) > np.pi, (v + np.pi) % (2 * np.pi) - np.pi, v) for v in (low, high)]
    low[3:], high[3:] = wrapped[0][3:], wrapped[1][3:]
    if kind is JointType.SIX_DOF:
        return SixDof(low, high, np.zeros(6), np.zeros(6), np.zeros(6))
    return SixDof(low, high, six("stiffness"), six("damping"), six("equilibrium point"))


def _cone_twist(element: Element, kind: JointType) -> tuple[float, float, float] | None:
    if kind is not JointType.CONE_TWIST:
        return None
    return (
        element.number("joint limits.x"),
        element.number("joint limits.y"),
        element.number("joint limits.z"),
    )


def sensor_of(element: Element, rays: Array) -> Callable[..., Sensor]:
    """Makes a sensor with its ``rays`` (n, 2, 3) in the sensor frame of ``index``, ``identity`` and ``parent``."""
    return partial(
        Sensor,
        type=SensorType[element.text("type")],
        T_body_sensor=pose_matrix(*element.pose("location")),
        rays=rays,
        range=element.number("range"),
        resistance=Resistance(
            static_friction=element.number("friction.static"),
            damping=element.number("friction.damping"),
            dynamic_friction=element.number("friction.dynamic"),
            variable=element.flag("friction.variable"),
            contact_area=element.number("contact area"),
            contact_stiffness=element.number("contact stiffness"),
        ),
        distance_threshold=element.number("distance threshold"),
        contact_details=element.flag("process contact details"),
        visible=element.flag("visible"),
        visible_size=element.number("visible size"),
    )


def camera_frame(location: Array, target: Array, up: Array) -> Array:
    """Camera frame (4, 4) in its parent's: it looks along -X at ``target``, +Z is up (§18.1).

    A camera that looks at itself or along ``up`` stays at the parent's origin, as in the reference.
    """
    x = location - target
    y = np.cross(up, x)
    if np.linalg.norm(x) < 1e-12 or np.linalg.norm(y) < 1e-12:
        return np.eye(4)
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return frame(np.column_stack([x, y, np.cross(x, y)]), location)


def light_frame(location: Array, direction: Array | None, rpy: tuple[float, float, float]) -> Array:
    """Light frame (4, 4) in its parent's: it shines along +X, the other axes as the reference publishes (§19)."""
    if direction is None or np.linalg.norm(direction) < 0.01:
        return pose_matrix(location, rpy)
    x = direction / np.linalg.norm(direction)
    y = np.cross(x, (0.0, 1.0, 0.0) if abs(x[1]) < 0.999 else (0.0, 0.0, 1.0))
    y /= np.linalg.norm(y)
    return frame(np.column_stack([x, y, np.cross(x, y)]), location)
