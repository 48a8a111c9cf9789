"""URDF: robots read from it and written as it. The joint frame is the child's frame; a robot is a tree with one root.

The format is described at wiki.ros.org/urdf/XML.
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ligature.adf.frames import Array, frame, inverse, matrix_quaternion, matrix_rpy, pose_matrix, quaternion_matrix
from ligature.authoring.robot.description import (
    TENSOR,
    WORLD,
    Colour,
    Joint,
    Link,
    MeshFile,
    PlacedShape,
    Robot,
    joint_axis,
    lengths,
    links_by_name,
    numbers,
    refuse,
    root_of,
    sizes,
    solid_of,
    words_of,
)
from ligature.authoring.shapes import Shape
from ligature.mesh.inertia import MassProperties

UNLIMITED = 1e6
"""Effort and velocity where ADF states none: URDF demands both."""


def read_urdf(path: Path) -> Robot:
    """The robot of a file; raises `RobotError`, or `XmlError` for what is no XML."""
    root = root_of(path, "robot")
    materials = {m.get("name", ""): m for m in root.findall("material")}
    links = links_by_name([_link(e, materials) for e in root.findall("link")])
    notes: list[str] = []
    elements = root.findall("joint")
    T = _zero_poses(links, elements, notes)
    joints = [_joint(e, T) for e in elements if _ends(e, links)[1] in T]
    return Robot(
        root.get("name") or path.stem,
        tuple(Link(n, T[n], link.solid, link.visuals, link.collisions) for n, link in links.items() if n in T),
        tuple(joints), notes,
    )  # fmt: skip


def _zero_poses(links: dict[str, Link], joints: list[Element], notes: list[str]) -> dict[str, Array]:
    """Pose of every link at zero, in the frame of the root."""
    below: dict[str, list[Element]] = defaultdict(list)
    children: set[str] = set()
    for joint in joints:
        parent, child = _ends(joint, links)
        if child in children:
            refuse(joint, f"the link '{child}' has a second parent; URDF is a tree")
        children.add(child)
        below[parent].append(joint)
    roots = [name for name in links if name not in children]
    if len(roots) != 1:
        notes.append(f"the robot has {len(roots)} roots; each stands at the origin")
    T = {name: np.eye(4) for name in roots}
    waiting = list(roots)
    while waiting:
        name = waiting.pop()
        for joint in below[name]:
            child = _ends(joint, links)[1]
            T[child] = T[name] @ _origin(joint)
            waiting.append(child)
    for name in links:
        if name not in T:
            notes.append(f"the link '{name}' is connected to no root; it is left out")
    return T


def _ends(joint: Element, links: dict[str, Link]) -> tuple[str, str]:
    found = []
    for end in ("parent", "child"):
        element = joint.find(end)
        name = "" if element is None else element.get("link", "")
        if name not in links:
            refuse(joint, f"its {end} is '{name}', which is not a link of the file")
        found.append(name)
    return found[0], found[1]


def _origin(element: Element) -> Array:
    """Pose of an element in what it belongs to."""
    origin = element.find("origin")
    if origin is None:
        return np.eye(4)
    zero = "0 0 0"
    return pose_matrix(
        lengths(origin, origin.get("xyz", zero), 3, "xyz"), numbers(origin, origin.get("rpy", zero), 3, "rpy")
    )


def _link(element: Element, materials: dict[str, Element]) -> Link:
    name = element.get("name", "")
    if not name:
        refuse(element, "a link has no name")
    solid = None
    inertial = element.find("inertial")
    if inertial is not None:
        mass, tensor = inertial.find("mass"), inertial.find("inertia")
        kilograms = 0.0 if mass is None else numbers(mass, mass.get("value"), 1, "value")[0]
        entries = [0.0 if tensor is None else numbers(tensor, tensor.get(i, "0"), 1, i)[0] for i in TENSOR]
        solid = solid_of(element, kilograms, _origin(inertial), entries)
    looks = [
        tuple(look for e in element.findall(tag) if (look := _placed_shape(e, materials)))
        for tag in ("visual", "collision")
    ]
    return Link(name, np.eye(4), solid, *looks)


def _placed_shape(element: Element, materials: dict[str, Element]) -> PlacedShape | None:
    geometry = element.find("geometry")
    for kind in () if geometry is None else geometry:
        shape = _shape(kind)
        if shape is not None:
            return PlacedShape(_origin(element), shape, _colour(element, materials))
    return None


def _shape(kind: Element) -> Shape | MeshFile | None:
    if kind.tag == "box":
        x, y, z = sizes(kind, kind.get("size"), 3, "size")
        return Shape("BOX", size=(x, y, z))
    if kind.tag == "sphere":
        return Shape("SPHERE", radius=sizes(kind, kind.get("radius"), 1, "radius")[0])
    if kind.tag in ("cylinder", "capsule"):
        radius, length = (sizes(kind, kind.get(name), 1, name)[0] for name in ("radius", "length"))
        return Shape(kind.tag.upper(), radius=radius, height=length + 2 * radius * (kind.tag == "capsule"))
    if kind.tag == "mesh" and kind.get("filename"):
        words = kind.get("scale", "1 1 1")
        x, y, z = numbers(kind, words if len(words.split()) == 3 else f"{words} {words} {words}", 3, "scale")
        return MeshFile(kind.get("filename", ""), (x, y, z))
    return None


def _colour(element: Element, materials: dict[str, Element]) -> Colour | None:
    material = element.find("material")
    if material is None:
        return None
    colour = material.find("color")
    if colour is None and material.get("name", "") in materials:
        colour = materials[material.get("name", "")].find("color")
    if colour is None or colour.get("rgba") is None:
        return None
    r, g, b, a = numbers(colour, colour.get("rgba"), 4, "rgba")
    return r, g, b, a


def _joint(element: Element, T: dict[str, Array]) -> Joint:
    parent, child = (
        _end.get("link", "") for _end in (element.find("parent"), element.find("child")) if _end is not None
    )
    axis, limit, mimic = element.find("axis"), element.find("limit"), element.find("mimic")
    lower = upper = None
    given = limit is not None and not {"lower", "upper"}.isdisjoint(limit.keys())
    if limit is not None and given and element.get("type") in ("revolute", "prismatic"):
        lower, upper = (numbers(limit, limit.get(name, "0"), 1, name)[0] for name in ("lower", "upper"))
    return Joint(
        element.get("name") or f"{parent}-{child}",
        element.get("type", ""),
        parent,
        child,
        T[child],
        joint_axis(element, numbers(axis, axis.get("xyz", "1 0 0"), 3, "xyz") if axis is not None else [1.0, 0.0, 0.0]),
        lower,
        upper,
        "" if mimic is None else mimic.get("joint", ""),
    )


# --- writing ----------------------------------------------------------------------------------

KINDS = ("revolute", "continuous", "prismatic", "fixed")


def urdf_text(robot: Robot) -> tuple[str, list[str]]:
    """The robot as a URDF, and what it cannot express; meshes are named as they are.

    A link that a joint carries has the joint's frame; what belongs to it is placed anew.
    """
    notes = [
        f"link '{link.name}' has an infinite plane, which URDF does not support; it is left out"
        for link in robot.links
        if any(
            isinstance(look.shape, Shape) and look.shape.kind == "PLANE" for look in (*link.visuals, *link.collisions)
        )
    ]
    tree = _tree(robot, notes)
    carried = {joint.child: joint for joint in tree}
    frames = {link.name: carried[link.name].T if link.name in carried else link.T for link in robot.links}
    root = Element("robot", name=robot.name)
    free = [link for link in robot.links if link.name not in carried]
    if len(free) != 1 or not np.array_equal(frames[free[0].name], np.eye(4)):
        SubElement(root, "link", name=WORLD)
        for link in free:
            kind = "fixed" if link.solid is None else "floating"
            anchor = SubElement(root, "joint", name=f"{WORLD}_{link.name}", type=kind)
            SubElement(anchor, "parent", link=WORLD)
            SubElement(anchor, "child", link=link.name)
            _put_origin(anchor, frames[link.name])
    for link in robot.links:
        _put_link(root, link, inverse(frames[link.name]) @ link.T)
    for joint in tree:
        _put_joint(root, joint, inverse(frames[joint.parent]) @ joint.T)
    ElementTree.indent(root)
    return '<?xml version="1.0"?>\n' + ElementTree.tostring(root, encoding="unicode") + "\n", notes


def _tree(robot: Robot, notes: list[str]) -> list[Joint]:
    """The joints that make a tree: no link has two parents, and no loop is closed."""
    kept: list[Joint] = []
    above: dict[str, str] = {}
    for joint in robot.joints:
        if not joint.parent:
            continue
        if joint.kind not in KINDS:
            notes.append(f"joint '{joint.name}' is {joint.kind}, which URDF does not support; it is left out")
        elif joint.child in above or _reaches(above, joint.parent, joint.child):
            notes.append(f"joint '{joint.name}' closes a loop, which URDF cannot express; it is left out")
        else:
            above[joint.child] = joint.parent
            kept.append(joint)
    return kept


def _reaches(above: dict[str, str], name: str, other: str) -> bool:
    while name in above and name != other:
        name = above[name]
    return name == other


def _put_origin(element: Element, T: Array) -> None:
    if not np.array_equal(T, np.eye(4)):
        R = quaternion_matrix(matrix_quaternion(T[:3, :3]))
        SubElement(element, "origin", xyz=words_of(T[:3, 3]), rpy=words_of(matrix_rpy(R)))


def _put_link(root: Element, link: Link, T_frame_link: Array) -> None:
    element = SubElement(root, "link", name=link.name)
    if link.solid is not None:
        _put_inertial(element, link.solid.placed(T_frame_link))
    for tag, looks in (("visual", link.visuals), ("collision", link.collisions)):
        for look in (plain for one in looks for plain in _plain(one)):
            item = SubElement(element, tag)
            _put_origin(item, T_frame_link @ look.T_link)
            _put_shape(SubElement(item, "geometry"), look.shape)
            if tag == "visual" and look.colour is not None:
                material = SubElement(item, "material", name=f"{link.name}_colour")
                SubElement(material, "color", rgba=words_of(look.colour))


def _put_inertial(element: Element, solid: MassProperties) -> None:
    inertial = SubElement(element, "inertial")
    SubElement(inertial, "origin", xyz=words_of(solid.centre), rpy="0 0 0")
    SubElement(inertial, "mass", value=words_of(solid.mass))
    i = solid.inertia
    entries = (i[0, 0], i[0, 1], i[0, 2], i[1, 1], i[1, 2], i[2, 2])
    SubElement(inertial, "inertia", {name: words_of(value) for name, value in zip(TENSOR, entries, strict=True)})


def _plain(look: PlacedShape) -> Iterator[PlacedShape]:
    """A capsule, which URDF has not, as a cylinder between two spheres; an infinite plane not at all."""
    shape = look.shape
    if isinstance(shape, MeshFile) or shape.kind not in ("CAPSULE", "PLANE"):
        yield look
    elif shape.kind == "CAPSULE":
        length = max(shape.height - 2 * shape.radius, 0.0)
        if length > 0.0:
            yield replace(look, shape=Shape("CYLINDER", radius=shape.radius, height=length))
        for end in (-length / 2, length / 2):
            T = look.T_link @ frame(np.eye(3), (0.0, 0.0, end))
            yield replace(look, T_link=T, shape=Shape("SPHERE", radius=shape.radius))


def _put_shape(geometry: Element, shape: Shape | MeshFile) -> None:
    if isinstance(shape, MeshFile):
        SubElement(geometry, "mesh", filename=shape.name, scale=words_of(shape.scale))
    elif shape.kind == "BOX":
        SubElement(geometry, "box", size=words_of(shape.size))
    elif shape.kind == "SPHERE":
        SubElement(geometry, "sphere", radius=words_of(shape.radius))
    else:
        SubElement(geometry, "cylinder", radius=words_of(shape.radius), length=words_of(shape.height))


def _put_joint(root: Element, joint: Joint, T_parent_joint: Array) -> None:
    limited = joint.lower is not None and joint.upper is not None
    kind = "continuous" if joint.kind == "revolute" and not limited else joint.kind
    element = SubElement(root, "joint", name=joint.name, type=kind)
    _put_origin(element, T_parent_joint)
    SubElement(element, "parent", link=joint.parent)
    SubElement(element, "child", link=joint.child)
    if kind == "fixed":
        return
    SubElement(element, "axis", xyz=words_of(joint.axis))
    if kind != "continuous":
        lower, upper = (joint.lower, joint.upper) if limited else (-UNLIMITED, UNLIMITED)
        SubElement(
            element, "limit", lower=words_of(lower), upper=words_of(upper), effort=words_of(UNLIMITED),
            velocity=words_of(UNLIMITED),
        )  # fmt: skip
