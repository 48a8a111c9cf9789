"""Bodies and sensors of one element each, before they have index and identity.

Frames and units as in `ligature.model.scene`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np

from ligature.adf import Diagnostic, Element, Severity
from ligature.model.doubts import doubts
from ligature.model.extents import estimated_inertial, estimated_moments
from ligature.model.frames import Array, pose_matrix
from ligature.model.geometry import FileContext, colliders, collision_margin, visual
from ligature.model.scene import (
    Body,
    CartesianController,
    Gains,
    OutputType,
    Resistance,
    Sensor,
    SensorType,
)
from ligature.model.shapes import ShaderFiles
from ligature.model.tissue import check_density, inertial_of, tissue_of

_INERTIAL_KEYS = ("inertia", "inertial offset", "gravity")


def body_of(element: Element, context: FileContext, gravity: Array, shaders: ShaderFiles | None) -> Callable[..., Body]:
    """Makes a body, without its joints, of ``index`` and ``identity``.

    ``gravity`` (3,) holds unless the body has its own. Raises `GeometryError`.
    """
    offset = pose_matrix(*element.pose("inertial offset")) if element.has("inertial offset") else None
    shapes = colliders(element, context, np.eye(4) if offset is None else offset)
    margin = collision_margin(element, shapes, context.report)
    looks = visual(element, context, shaders)
    tissue = tissue_of(element, context, looks, shapes)
    has_mass = element.has("mass")  # without it, no inertial key has an effect
    offset, moments = (offset, _moments(element)) if has_mass else (None, None)
    if tissue is not None:
        mass = element.number("mass") if has_mass else float(tissue.cell_masses.sum())
        tissue = tissue.with_mass(mass)
        check_density(element, tissue)
        T_body_inertial, estimated = inertial_of(tissue, mass, offset)
        inertia = estimated if moments is None else moments
        shapes = ()
    else:
        if not has_mass:
            _warn_no_mass(element, context)
        if not shapes:
            _note_no_collision(element, context)
        mass = element.number("mass")
        T_body_inertial = estimated_inertial(shapes) if offset is None else offset
        inertia = estimated_moments(shapes, T_body_inertial, margin, mass) if moments is None else moments
    place = pose_matrix(*element.pose("location"))
    if has_mass and element.has("gravity"):
        gravity = np.array(element.vector("gravity"))
    for doubt in [] if tissue is None else doubts(element, tissue, mass, place[:3, :3], gravity):
        context.report(doubt)
    return partial(
        Body,
        mass=mass,
        inertia=inertia,
        T_body_inertial=T_body_inertial,
        T_world_body=place,
        gravity=gravity,
        colliders=shapes,
        visual=looks,
        collision_margin=margin,
        friction=_surface_friction(element),
        rolling_friction=element.number("friction.rolling"),
        restitution=element.number("restitution"),
        linear_damping=min(max(element.number("damping.linear"), 0.0), 1.0),
        angular_damping=min(max(element.number("damping.angular"), 0.0), 1.0),
        controller=controller_of(element, "controller", CartesianController()),
        publish_children_names=element.flag("publish children names"),
        publish_joint_names=element.flag("publish joint names"),
        publish_joint_positions=element.flag("publish joint positions"),
        needle=element.value("ligature needle"),
        inertia_estimated=moments is None,
        tissue=tissue,
    )


def _moments(element: Element) -> Array | None:
    """Principal moments (3,) of a body that gives them."""
    return np.array([element.number(f"inertia.{k}") for k in ("ix", "iy", "iz")]) if element.has("inertia") else None


def _surface_friction(element: Element) -> float:
    """Friction coefficient of a body's surface."""
    own = element.value("ligature tissue.surface friction")
    return element.number("friction.static") if own is None else float(own)


def _warn_no_mass(element: Element, context: FileContext) -> None:
    ignored = [key for key in _INERTIAL_KEYS if element.has(key)]
    severity = Severity.WARNING if ignored else Severity.INFO
    rest = f", and its {', '.join(ignored)} has no effect" if ignored else ""
    message = f"body '{element.key}' has no 'mass'; using 1 kg{rest}"
    context.report(Diagnostic(severity, message, element.mark, "add mass: kilograms; 0 makes it static", "mass"))


def _note_no_collision(element: Element, context: FileContext) -> None:
    """Report a body that is drawn by a primitive alone: of a mesh, collision shapes are made."""
    key = next((key for key in ("shape", "compound shape") if element.has(key)), None)
    if key is not None:
        message = f"body '{element.key}' collides with nothing: it has a '{key}' but no 'collision shape'"
        hint = "add 'collision shape' and 'collision geometry'" if key == "shape" else "add 'compound collision shape'"
        context.report(Diagnostic(Severity.INFO, message, element.mark_of(key), hint, "geometry"))


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
