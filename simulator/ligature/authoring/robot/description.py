"""A robot as URDF and SDF describe it: links at the joints' zero, joints between them. Metres, kilograms, radians.

All poses ``T`` are (4, 4) and in the frame of the robot, unless their name says otherwise.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import NoReturn
from xml.etree import ElementTree

import numpy as np

from ligature.adf.frames import Array
from ligature.authoring.shapes import Shape
from ligature.authoring.xml_files import check_xml
from ligature.mesh.inertia import MassProperties
from ligature.paths import open_file

Colour = tuple[float, float, float, float]

TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
WORLD = "world"
"""The link that stands for the world, in both formats."""

MOST_LENGTH = 1e6
"""Largest number of a pose or size in metres; larger ones are errors."""


class RobotError(ValueError):
    """A file that is no robot; the message names the element and what would be right."""


@dataclass(frozen=True)
class MeshFile:
    """A mesh as a robot's file names it, stretched along its axes."""

    name: str
    scale: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass(frozen=True, eq=False)
class PlacedShape:
    """A shape or a mesh at a pose (4, 4) in its link, seen or touched."""

    T_link: Array
    shape: Shape | MeshFile
    colour: Colour | None = None


@dataclass(frozen=True, eq=False)
class Link:
    """A rigid body; ``solid`` are mass, centre and tensor in its frame, None for one without mass."""

    name: str
    T: Array
    solid: MassProperties | None = None
    visuals: tuple[PlacedShape, ...] = ()
    collisions: tuple[PlacedShape, ...] = ()


@dataclass(frozen=True, eq=False)
class Joint:
    """A joint of a kind of URDF or SDF; ``axis`` (3,) is in the frame of the joint.

    ``parent`` is empty for the world. ``lower`` and ``upper`` are None without limits.
    """

    name: str
    kind: str
    parent: str
    child: str
    T: Array
    axis: Array
    lower: float | None = None
    upper: float | None = None
    mimics: str = ""


@dataclass(frozen=True, eq=False)
class Robot:
    """Links and joints, and what the reader left out."""

    name: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    notes: list[str] = field(default_factory=list)


def links_by_name(links: Iterable[Link]) -> dict[str, Link]:
    """The links by their names; raises `RobotError` where two have one."""
    named: dict[str, Link] = {}
    for link in links:
        if link.name in named:
            raise RobotError("two links have the same name; names must be unique")
        named[link.name] = link
    return named


# --- XML --------------------------------------------------------------------------------------


def root_of(path: Path, tag: str) -> ElementTree.Element:
    """The outermost element of a file; raises `RobotError` for another ``tag``, `XmlError` for what is no XML."""
    check_xml(path)
    with open_file(path) as file:
        root = ElementTree.fromstring(file.read())
    if root.tag != tag:
        raise RobotError(f"the outermost element is <{root.tag}>, not <{tag}>")
    return root


def refuse(element: ElementTree.Element, why: str) -> NoReturn:
    """Raise `RobotError` for an element."""
    name = element.get("name")
    raise RobotError(f"<{element.tag}{f' name={name!r}' if name else ''}>: {why}")


def numbers(element: ElementTree.Element, text: str | None, count: int, what: str) -> list[float]:
    """``count`` finite numbers of a text; raises `RobotError`."""
    words = (text or "").split()
    try:
        found = [float(word) for word in words]
    except ValueError:
        refuse(element, f"'{what}' is '{(text or '')[:60]}'; give {count} numbers")
    if len(found) != count or not all(np.isfinite(found)):
        refuse(element, f"'{what}' is '{(text or '')[:60]}'; give {count} finite numbers")
    return found


def lengths(element: ElementTree.Element, text: str | None, count: int, what: str) -> list[float]:
    """``count`` numbers of metres, none absurd; raises `RobotError`."""
    found = numbers(element, text, count, what)
    if max(map(abs, found)) > MOST_LENGTH:
        refuse(element, f"'{what}' has {max(found, key=abs):g} m; give at most {MOST_LENGTH:g}")
    return found


def sizes(element: ElementTree.Element, text: str | None, count: int, what: str) -> list[float]:
    """``count`` positive lengths; raises `RobotError`."""
    found = lengths(element, text, count, what)
    if min(found) <= 0.0:
        refuse(element, f"'{what}' is {min(found):g}; give metres above 0")
    return found


def solid_of(element: ElementTree.Element, mass: float, T_link: Array, entries: list[float]) -> MassProperties | None:
    """Mass properties in the link of a mass at a pose with ixx, ixy, ixz, iyy, iyz, izz; None without mass."""
    if mass < 0.0:
        refuse(element, f"the mass is {mass:g}; give kilograms of 0 or more")
    if mass == 0.0:
        return None
    xx, xy, xz, yy, yz, zz = entries
    R = T_link[:3, :3]
    tensor = R @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ R.T
    return MassProperties(0.0, mass, T_link[:3, 3], tensor)


UNTURNED = ("fixed", "floating", "ball")
"""Kinds of joints that have no axis, whatever their file states."""


def joint_axis(element: ElementTree.Element, axis: list[float]) -> Array:
    """The direction of a joint's axis (3,), X of a joint that has none; raises `RobotError`."""
    return np.array([1.0, 0.0, 0.0]) if element.get("type") in UNTURNED else unit_axis(element, axis)


def unit_axis(element: ElementTree.Element, axis: list[float]) -> Array:
    """The direction of an axis (3,); raises `RobotError` for one without."""
    length = float(np.linalg.norm(axis))
    if not 1e-9 < length < np.inf:
        refuse(element, "the axis has no direction; give one of length 1")
    return np.array(axis) / length


def words_of(values: object) -> str:
    """Numbers as XML has them: the fewest digits that read back the same."""
    return " ".join(repr(float(v) + 0.0) for v in np.asarray(values, dtype=float).reshape(-1))


def unique(names: list[str]) -> list[str]:
    """The names without blanks, and numbered where two are alike."""
    found: list[str] = []
    taken: set[str] = set()
    for name in names:
        plain = "_".join(name.split()) or "unnamed"
        number, new = 1, plain
        while new in taken:
            number += 1
            new = f"{plain}_{number}"
        taken.add(new)
        found.append(new)
    return found
