"""Objects mounted on bodies: ghosts, cameras, lights and ray sensors of one element each, before parents are settled.

Frames and units as in `ligature.model.scene`.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from ligature.adf import Diagnostic, Element, Resolver, Severity
from ligature.adf.diagnostics import AdfError
from ligature.adf.lacking import lack_of
from ligature.adf.schema import CLIPPING, MOST_RAYS
from ligature.adf.schema.keys import FARTHEST
from ligature.mesh import load_mesh
from ligature.model.frames import Array, axis_rotation, frame, pose_matrix
from ligature.model.geometry import (
    FileContext,
    GeometryError,
    colliders,
    collision_margin,
    shader_files,
    visual,
)
from ligature.model.piercing import Tissue
from ligature.model.scene import Actuator, Attachment, Body, Camera, Ghost, Identity, Light, SensorType, Slip

MIN_CUTOFF, MAX_CUTOFF = 1e-3, np.pi / 2
"""Half angles in radians to which that of a light is clamped; its shadow map needs one above 0."""


def ghost_of(element: Element, context: FileContext) -> Callable[..., Ghost]:
    """Makes a ghost object of ``index`` and ``identity``; raises `GeometryError` when it has no shape."""
    fallback = pose_matrix(*element.pose("inertial offset")) if element.has("inertial offset") else np.eye(4)
    shapes = colliders(element, context, fallback)
    if not shapes:
        message = f"ghost object '{element.key}' has no collision shape and is left out"
        raise GeometryError(Diagnostic(Severity.ERROR, message, element.mark, "add 'collision shape'", "geometry"))
    return partial(
        Ghost,
        attachment=Attachment(None, pose_matrix(*element.pose("location"))),
        colliders=shapes,
        visual=visual(element, context, None),
        collision_groups=tuple(int(g) for g in element.numbers("collision groups")),
        collision_margin=collision_margin(element, shapes, context.report),
        hole=element.value("ligature hole"),
        tissue=_tissue(element),
    )


def actuator_of(element: Element, index: int, identity: Identity, parent: Body) -> Actuator:
    """An actuator on ``parent``."""
    T_body_actuator = parent.T_body_inertial @ pose_matrix(*element.pose("location"))
    visible, size = element.flag("visible"), element.number("visible size")
    return Actuator(index, identity, parent.index, T_body_actuator, visible, size, _slip(element))


def _slip(element: Element) -> Slip | None:
    """How an actuator yields; None for one that holds rigidly."""
    if not element.has("ligature slip"):
        return None
    names = ("normal force", "friction", "half width", "reach")
    return Slip(*(element.number(f"ligature slip.{name}") for name in names))


def _tissue(element: Element) -> Tissue:
    """How the tissue at a ghost holds what passes through it."""
    values = {name: element.value(f"ligature tissue.{name}") for name in ("stiffness", "strength", "friction", "drag")}
    return Tissue(**{name: value for name, value in values.items() if value is not None})


def light_of(element: Element) -> Callable[..., Light]:
    """Makes a light of ``index`` and ``identity``."""
    direction = np.array(element.vector("direction")) if element.has("direction") else None
    rpy = element.vector("location.orientation")
    return partial(
        Light,
        attachment=Attachment(None, light_frame(np.array(element.vector("location")), direction, rpy)),
        spot_exponent=element.number("spot exponent"),
        cutoff=min(max(element.number("cutoff angle"), MIN_CUTOFF), MAX_CUTOFF),
        shadow_quality=element.integer("shadow quality"),
        attenuation=(
            element.number("attenuation.constant"),
            element.number("attenuation.linear"),
            element.number("attenuation.quadratic"),
        ),
    )


def camera_of(element: Element, folder: Path) -> Callable[..., Camera]:
    """Makes a camera of ``index`` and ``identity``; shader paths are joined to ``folder``."""
    T = camera_frame(*(np.array(element.vector(k)) for k in ("location", "look at", "up")))
    stereo = None
    if element.has("stereo"):
        stereo = (element.number("stereo.eye separation"), element.number("stereo.focal length"))
    matrix = element.value("projection matrix")
    near, far = element.number("clipping plane.near"), element.number("clipping plane.far")
    near, far = (near, far) if 0.0 < near < far else CLIPPING
    return partial(
        Camera,
        attachment=Attachment(None, T),
        near=near,
        far=far,
        field_of_view=element.number("field view angle"),
        orthographic_width=element.value("orthographic view width"),
        stereo=stereo,
        intrinsics=_intrinsics(element),
        projection=None if matrix is None else np.array(matrix, dtype=float),
        resolution=_resolution(element),
        publish_image=element.flag("publish image"),
        image_interval=max(element.integer("publish image interval"), 1),
        publish_depth=element.flag("publish depth"),
        depth_interval=max(element.integer("publish depth interval"), 1),
        depth_noise=_noise(element),
        multipass=element.flag("multipass"),
        visible=element.flag("visible"),
        monitor=element.integer("monitor"),
        window_size=_size(element, "window resolution"),
        controlling_devices=tuple(element.texts("controlling devices")),
        preprocessing_shaders=shader_files(element, "preprocessing shaders", folder),
        depth_shaders=shader_files(element, "depth compute shaders", folder),
        mouse_multipliers={
            name: element.number(f"mouse control multipliers.{name}") for name in ("pan", "rotate", "scroll", "arcball")
        },
        extra={"plugins": element.raw_value("plugins")} if element.has("plugins") else {},
    )


def sensor_rays(element: Element, folder: Path, resolver: Resolver) -> Array:
    """Start and end points (n, 2, 3) of a sensor's rays in its own frame; a contact sensor has none.

    Raises `GeometryError` for a negative range, for a direction that is not of length 1, and for too many rays.
    """
    rays = _rays(element, folder, resolver)
    if len(rays) > MOST_RAYS:
        source = next(name for name in ("array", "mesh", "parametric") if element.has(name))
        message = f"'{source}' of sensor '{element.key}' gives {len(rays)} rays; at most {MOST_RAYS} are cast"
        hint = "take a coarser mesh" if source == "mesh" else "list fewer"
        raise GeometryError(Diagnostic(Severity.ERROR, message, element.mark_of(source), hint, "sensor"))
    return rays


def _rays(element: Element, folder: Path, resolver: Resolver) -> Array:
    """The rays of a sensor, however many."""
    if SensorType[element.text("type")] is SensorType.CONTACT:
        return np.zeros((0, 2, 3))
    reach = element.number("range")
    if reach < 0.0:
        message = f"sensor '{element.key}' has the negative range {reach:g}"
        raise GeometryError(
            Diagnostic(Severity.ERROR, message, element.mark_of("range"), "give a length in metres", "sensor")
        )
    if element.has("array"):
        rays = []
        for item in element.children("array"):
            start, direction = np.array(item.vector("offset")), np.array(item.vector("direction"))
            length = reach * float(np.linalg.norm(direction))
            if length > FARTHEST:
                message = f"a ray of sensor '{element.key}' is {length:g} m long; at most {FARTHEST:g} m"
                hint = "give a direction of length 1; its length multiplies the range"
                raise GeometryError(Diagnostic(Severity.ERROR, message, item.mark_of("direction"), hint, "sensor"))
            rays.append((start, start + reach * direction))
        return np.array(rays).reshape(-1, 2, 3)
    if element.text("mesh"):
        return _contour_rays(element, folder, resolver, reach)
    if element.has("parametric"):
        return _fan_rays(element, reach)
    return np.zeros((0, 2, 3))


def _contour_rays(element: Element, folder: Path, resolver: Resolver, reach: float) -> Array:
    """One ray a triangle, from its centroid along its normal."""
    try:
        path = resolver.resolve(element.text("mesh"), folder, element.mark_of("mesh"))
        if lack_of(path) is not None and lack_of(folder / "high_res" / element.text("mesh")) is None:
            path = resolver.resolve(f"high_res/{element.text('mesh')}", folder)
        lack = lack_of(path)
        if lack is not None:
            message = f"sensor '{element.key}': mesh '{element.text('mesh')}' {lack.fault}"
            hint = lack.hint or f"looked for {path}"
            raise GeometryError(Diagnostic(Severity.ERROR, message, element.mark_of("mesh"), hint, "sensor"))
        mesh = load_mesh(path, resolver)
    except AdfError as error:
        raise GeometryError(error.diagnostics[0]) from error
    rays = []
    for part in mesh.parts:
        a, b, c = (part.vertices[part.faces[:, i]] for i in range(3))
        normal = np.cross(b - a, c - b)
        length = np.linalg.norm(normal, axis=1, keepdims=True)
        solid = length[:, 0] > 0
        start = ((a + b + c) / 3)[solid]
        rays.append(np.stack([start, start + reach * (normal / np.where(length > 0, length, 1))[solid]], axis=1))
    return np.concatenate(rays) if rays else np.zeros((0, 2, 3))


def _fan_rays(element: Element, reach: float) -> Array:
    """A square fan of rays about +X."""
    n = element.integer("parametric.resolution")
    if n < 2:
        return np.zeros((0, 2, 3))
    wide, high = element.number("parametric.horizontal angle"), element.number("parametric.vertical angle")
    start = element.number("parametric.start offset")
    rays = []
    turned = [axis_rotation((0, 0, 1), -wide / 2 + i * wide / (n - 1)) for i in range(n)]
    tilted = [axis_rotation((0, 1, 0), -high / 2 + j * high / (n - 1)) for j in range(n)]
    for across in turned:
        for up in tilted:
            direction = across @ up @ np.array([1.0, 0.0, 0.0])
            rays.append((start * direction, (start + reach) * direction))
    return np.array(rays)


def _resolution(element: Element) -> tuple[int, int]:
    return _size(element, "publish image resolution") or _size(element, "window resolution") or (640, 480)


def _size(element: Element, block: str) -> tuple[int, int] | None:
    return (element.integer(f"{block}.width"), element.integer(f"{block}.height")) if element.has(block) else None


def _noise(element: Element) -> tuple[float, float, float] | None:
    if not element.has("publish depth noise"):
        return None
    deviation = element.value("publish depth noise.std_dev")
    if deviation is None:
        deviation = element.value("publish depth noise.std dev")
    return (
        element.number("publish depth noise.mean"),
        0.001 if deviation is None else float(deviation),
        element.number("publish depth noise.bias"),
    )


def _intrinsics(element: Element) -> dict[str, float] | None:
    if not element.has("camera intrinsics"):
        return None
    values = {k: element.value(f"camera intrinsics.{k}") for k in ("fx", "fy", "f", "cx", "cy", "s")}
    focal = values.pop("f")
    for name in ("fx", "fy"):
        if values[name] is None:
            values[name] = 100.0 if focal is None else focal
    return {name: 0.0 if value is None else float(value) for name, value in values.items()}


def camera_frame(location: Array, target: Array, up: Array) -> Array:
    """Camera frame (4, 4) in its parent's: it looks along -X at ``target``, +Z is up.

    A camera that looks at itself or along ``up`` stays at the parent's origin, as in the reference.
    """
    x = location - target
    y = np.cross(up, x)
    if np.linalg.norm(x) < 1e-12 or np.linalg.norm(y) < 1e-12:
        return np.eye(4)
    x, y = x / np.linalg.norm(x), y / np.linalg.norm(y)
    return frame(np.column_stack([x, y, np.cross(x, y)]), location)


def light_frame(location: Array, direction: Array | None, rpy: tuple[float, float, float]) -> Array:
    """Light frame (4, 4) in its parent's: it shines along +X, the other axes as the reference publishes."""
    if direction is None or np.linalg.norm(direction) < 0.01:
        return pose_matrix(location, rpy)
    x = direction / np.linalg.norm(direction)
    y = np.cross(x, (0.0, 1.0, 0.0) if abs(x[1]) < 0.999 else (0.0, 0.0, 1.0))
    y /= np.linalg.norm(y)
    return frame(np.column_stack([x, y, np.cross(x, y)]), location)
