"""SDF: robots read from it and written as it. Links stand where they are stated; loops are allowed.

The format is described at sdformat.org/spec. A pose without ``relative_to`` is in the model, that of a joint in its
child, that of what belongs to a link in the link.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ligature.adf.frames import Array, inverse, matrix_quaternion, matrix_rpy, pose_matrix, quaternion_matrix
from ligature.authoring.robot.description import (
    TENSOR,
    WORLD,
    Colour,
    Joint,
    Link,
    MeshFile,
    PlacedShape,
    Robot,
    RobotError,
    joint_axis,
    lengths,
    links_by_name,
    numbers,
    refuse,
    root_of,
    sizes,
    solid_of,
    unit_axis,
    words_of,
)
from ligature.authoring.shapes import Shape
from ligature.mesh.inertia import MassProperties

NO_LIMIT = 1e15
"""Limits beyond this mean none."""

PLANE_SIZE = 100.0
"""Edge in metres of the square that shows a plane; the plane that collides is infinite."""


def read_sdf(path: Path) -> Robot:
    """All models of a file as one robot; raises `RobotError`, or `XmlError` for what is no XML."""
    root = root_of(path, "sdf")
    models = [*root.findall("model"), *(m for world in root.findall("world") for m in world.findall("model"))]
    if not models:
        raise RobotError("the file has no <model>; give a file that describes a robot")
    notes = [f"<{e.tag}> is left out: models of other files are not read" for e in root.iter("include")]
    read = [_model(m, f"{m.get('name', 'model')}_" if len(models) > 1 else "", notes) for m in models]
    links = tuple(link for one, _ in read for link in one)
    links_by_name(links)
    return Robot(models[0].get("name") or path.stem, links, tuple(j for _, some in read for j in some), notes)


@dataclass(eq=False)
class _Frames:
    """Named frames of a model: links, joints, frames; each is worked out when it is asked for."""

    model: Array
    elements: dict[str, Element]
    known: dict[str, Array] = field(default_factory=dict)
    open: set[str] = field(default_factory=set)

    def of(self, name: str, user: Element) -> Array:
        """Pose of a frame in the world; raises `RobotError`."""
        if name in ("__model__", ""):
            return self.model
        if name == WORLD:
            return np.eye(4)
        if name not in self.elements:
            refuse(user, f"there is no frame '{name}' in the model")
        if name in self.open:
            refuse(user, f"the frame '{name}' is stated relative to itself")
        if name not in self.known:
            self.open.add(name)
            element = self.elements[name]
            default = (
                (element.findtext("child") or "").strip() if element.tag == "joint" else element.get("attached_to", "")
            )
            self.known[name] = self.placed(element, default)
            self.open.remove(name)
        return self.known[name]

    def placed(self, element: Element, default: str) -> Array:
        """Pose in the world of an element whose pose is stated in a frame, ``default`` where none is named."""
        pose = element.find("pose")
        base = self.of(default if pose is None else pose.get("relative_to", default), element)
        return base if pose is None else base @ _pose(pose)


def _pose(pose: Element | None) -> Array:
    if pose is None or not (pose.text or "").strip():
        return np.eye(4)
    words = (pose.text or "").split()
    angles = numbers(pose, " ".join(words[3:]), 3, "pose")
    if pose.get("degrees", "false") in ("true", "1"):
        angles = [float(np.radians(a)) for a in angles]
    return pose_matrix(lengths(pose, " ".join(words[:3]), 3, "pose"), angles)


def _model(model: Element, prefix: str, notes: list[str]) -> tuple[list[Link], list[Joint]]:
    for nested in model.findall("model"):
        notes.append(f"the model '{nested.get('name', '')}' inside another is left out")
    named = [e for tag in ("link", "joint", "frame") for e in model.findall(tag)]
    for element in named:
        if not element.get("name"):
            refuse(element, "it has no name")
    frames = _Frames(_pose(model.find("pose")), {e.get("name", ""): e for e in named})
    static = (model.findtext("static") or "").strip() in ("true", "1")
    still = {
        (joint.findtext("child") or "").strip()
        for joint in model.findall("joint")
        if joint.get("type") == "fixed" and (joint.findtext("parent") or "").strip() == WORLD
    }
    links = [_link(e, prefix, frames, static or e.get("name") in still) for e in model.findall("link")]
    names = {link.name for link in links}
    joints = [_joint(e, prefix, names, frames) for e in model.findall("joint")]
    return links, joints


def _link(element: Element, prefix: str, frames: _Frames, still: bool) -> Link:
    inertial = element.find("inertial")
    solid = None
    if not still:
        mass, tensor, T = 1.0, [1.0, 0.0, 0.0, 1.0, 0.0, 1.0], np.eye(4)  # what SDF takes where none is stated
        if inertial is not None:
            T = _pose(inertial.find("pose"))
            mass = numbers(inertial, inertial.findtext("mass", "1"), 1, "mass")[0]
            given = inertial.find("inertia")
            if given is not None:
                tensor = [numbers(given, given.findtext(i, "0"), 1, i)[0] for i in TENSOR]
        solid = solid_of(element, mass, T, tensor)
    looks = [tuple(look for e in element.findall(tag) if (look := _placed_shape(e))) for tag in ("visual", "collision")]
    name = element.get("name", "")
    return Link(prefix + name, frames.of(name, element), solid, *looks)


def _placed_shape(element: Element) -> PlacedShape | None:
    geometry = element.find("geometry")
    for kind in () if geometry is None else geometry:
        shape = _shape(kind)
        if shape is not None:
            return PlacedShape(_pose(element.find("pose")), shape, _colour(element))
    return None


def _shape(kind: Element) -> Shape | MeshFile | None:
    def size(name: str, count: int = 1) -> list[float]:
        return sizes(kind, kind.findtext(name), count, name)

    if kind.tag == "box":
        x, y, z = size("size", 3)
        return Shape("BOX", size=(x, y, z))
    if kind.tag == "sphere":
        return Shape("SPHERE", radius=size("radius")[0])
    if kind.tag in ("cylinder", "capsule"):
        radius, length = size("radius")[0], size("length")[0]
        return Shape(kind.tag.upper(), radius=radius, height=length + 2 * radius * (kind.tag == "capsule"))
    if kind.tag == "cone":
        return Shape("CONE", radius=size("radius")[0], height=size("length")[0])
    if kind.tag == "plane":
        x, y, z = unit_axis(kind, numbers(kind, kind.findtext("normal", "0 0 1"), 3, "normal"))
        return Shape("PLANE", normal=(float(x), float(y), float(z)))
    if kind.tag == "mesh" and (kind.findtext("uri") or "").strip():
        x, y, z = numbers(kind, kind.findtext("scale", "1 1 1"), 3, "scale")
        return MeshFile((kind.findtext("uri") or "").strip(), (x, y, z))
    return None


def _colour(element: Element) -> Colour | None:
    text = element.findtext("material/diffuse")
    if text is None:
        return None
    words = text.split()
    r, g, b, a = numbers(element, " ".join([*words, "1"][:4]), 4, "diffuse")
    return r, g, b, a


def _joint(element: Element, prefix: str, names: set[str], frames: _Frames) -> Joint:
    ends = {end: (element.findtext(end) or "").strip() for end in ("parent", "child")}
    for end, name in ends.items():
        if prefix + name not in names and not (end == "parent" and name == WORLD):
            refuse(element, f"its {end} is '{name}', which is not a link of the model")
    T = frames.of(element.get("name", ""), element)
    given = element.find("axis")
    axis, lower, upper = [0.0, 0.0, 1.0], None, None
    if given is not None:
        axis = numbers(given, given.findtext("xyz", "0 0 1"), 3, "axis/xyz")
        direction = given.find("xyz")
        base = "" if direction is None else direction.get("expressed_in", "")
        old = (given.findtext("use_parent_model_frame") or "").strip() in ("true", "1")
        if base or old:
            axis = (T[:3, :3].T @ frames.of("__model__" if old else base, element)[:3, :3] @ np.array(axis)).tolist()
        low, high = (given.findtext(f"limit/{end}") for end in ("lower", "upper"))
        if low is not None and high is not None:
            lower, upper = _limit(given, low), _limit(given, high)
    kind = element.get("type", "")
    unlimited = lower is None or upper is None or min(-lower, upper) > NO_LIMIT
    return Joint(
        prefix + element.get("name", ""), kind, "" if ends["parent"] == WORLD else prefix + ends["parent"],
        prefix + ends["child"], T, joint_axis(element, axis), None if unlimited else lower,
        None if unlimited else upper,
    )  # fmt: skip


def _limit(element: Element, text: str) -> float:
    """A limit; SDF writes an infinite one as inf, or as 1e16."""
    try:
        value = float(text)
    except ValueError:
        refuse(element, f"the limit '{text[:60]}' is not a number")
    if np.isnan(value):
        refuse(element, "the limit is nan; give a number or inf")
    return value


# --- writing ----------------------------------------------------------------------------------

KINDS = {"revolute": "revolute", "continuous": "continuous", "prismatic": "prismatic", "fixed": "fixed", "ball": "ball"}


def sdf_text(robot: Robot) -> tuple[str, list[str]]:
    """The robot as a model of SDF 1.7, and what it cannot express; bodies without mass are fixed to the world."""
    notes: list[str] = []
    root = Element("sdf", version="1.7")
    model = SubElement(root, "model", name=robot.name)
    poses = {link.name: link.T for link in robot.links}
    held = {joint.child for joint in robot.joints if joint.kind in KINDS}
    for link in robot.links:
        _put_link(model, link)
    for link in robot.links:
        if link.solid is None and link.name not in held:
            anchor = SubElement(model, "joint", name=f"{WORLD}_{link.name}", type="fixed")
            SubElement(anchor, "parent").text, SubElement(anchor, "child").text = WORLD, link.name
    for joint in robot.joints:
        if joint.kind not in KINDS:
            notes.append(f"joint '{joint.name}' is {joint.kind}, which SDF does not support; it is left out")
            continue
        _put_joint(model, joint, inverse(poses[joint.child]) @ joint.T)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n", notes


def _put(element: Element, tag: str, values: object) -> None:
    SubElement(element, tag).text = words_of(values)


def _put_pose(element: Element, T: Array) -> None:
    R = quaternion_matrix(matrix_quaternion(T[:3, :3]))
    if not np.array_equal(T, np.eye(4)):
        _put(element, "pose", [*T[:3, 3], *matrix_rpy(R)])


def _put_link(model: Element, link: Link) -> None:
    element = SubElement(model, "link", name=link.name)
    _put_pose(element, link.T)
    if link.solid is not None:
        _put_inertial(element, link.solid)
    for tag, looks in (("visual", link.visuals), ("collision", link.collisions)):
        for number, look in enumerate(looks):
            item = SubElement(element, tag, name=f"{link.name}_{tag}_{number}")
            _put_pose(item, look.T_link)
            _put_shape(SubElement(item, "geometry"), look.shape)
            if tag == "visual" and look.colour is not None:
                material = SubElement(item, "material")
                _put(material, "ambient", look.colour)
                _put(material, "diffuse", look.colour)


def _put_inertial(element: Element, solid: MassProperties) -> None:
    inertial = SubElement(element, "inertial")
    _put(inertial, "pose", [*solid.centre, 0.0, 0.0, 0.0])
    _put(inertial, "mass", solid.mass)
    tensor = SubElement(inertial, "inertia")
    i = solid.inertia
    entries = (i[0, 0], i[0, 1], i[0, 2], i[1, 1], i[1, 2], i[2, 2])
    for name, value in zip(TENSOR, entries, strict=True):
        _put(tensor, name, value)


def _put_shape(geometry: Element, shape: Shape | MeshFile) -> None:
    if isinstance(shape, MeshFile):
        mesh = SubElement(geometry, "mesh")
        SubElement(mesh, "uri").text = shape.name
        _put(mesh, "scale", shape.scale)
        return
    kind = SubElement(geometry, shape.kind.lower())
    if shape.kind == "BOX":
        _put(kind, "size", shape.size)
    elif shape.kind == "PLANE":
        _put(kind, "normal", shape.normal)
        _put(kind, "size", (PLANE_SIZE, PLANE_SIZE))
    else:
        _put(kind, "radius", shape.radius)
        if shape.kind != "SPHERE":
            _put(kind, "length", shape.height - 2 * shape.radius * (shape.kind == "CAPSULE"))


def _put_joint(model: Element, joint: Joint, T_child_joint: Array) -> None:
    limited = joint.lower is not None and joint.upper is not None
    kind = "continuous" if joint.kind == "revolute" and not limited else joint.kind
    element = SubElement(model, "joint", name=joint.name, type=kind)
    _put_pose(element, T_child_joint)
    SubElement(element, "parent").text = joint.parent or WORLD
    SubElement(element, "child").text = joint.child
    if kind in ("fixed", "ball"):
        return
    axis = SubElement(element, "axis")
    _put(axis, "xyz", joint.axis)
    limit = SubElement(axis, "limit")
    lower, upper = (joint.lower, joint.upper) if limited else (-1e16, 1e16)
    _put(limit, "lower", lower)
    _put(limit, "upper", upper)
