"""What the checks look at: one model file with its meshes, and what they find."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ligature.adf import AdfError, Document, Element, Resolver, Severity
from ligature.adf.frames import Array
from ligature.adf.references import find_by_text
from ligature.authoring.placement import matrix_of
from ligature.authoring.shapes import Shape
from ligature.mesh.load import load_mesh
from ligature.mesh.mesh import Mesh
from ligature.mesh.surface import Faces, joined

HIGH, LOW = "high resolution path", "low resolution path"


@dataclass(frozen=True)
class Finding:
    """One finding: the rule, the object's key (empty: the file), what is wrong, what would be right.

    ``fix`` are the values of keys that mend it; None takes a key away.
    """

    rule: str
    severity: Severity
    key: str
    message: str
    hint: str = ""
    fix: Mapping[str, Any] = field(default_factory=dict)


Rule = Callable[["Subject"], Iterator[Finding]]
RULES: dict[str, Rule] = {}


def rule(name: str) -> Callable[[Rule], Rule]:
    """Enter a function into `RULES` under a name."""

    def enter(function: Rule) -> Rule:
        RULES[name] = function
        return function

    return enter


@dataclass
class Subject:
    """A model to check.

    Attributes
    ----------
    document, resolver
        The file as read, and what opens its meshes.
    unsaved
        Names of mesh files that are not on the disk yet, and are no fault for that.
    inflated
        Keys of bodies whose inertia was enlarged on purpose.
    """

    document: Document
    resolver: Resolver
    unsaved: frozenset[str] = frozenset()
    inflated: frozenset[str] = frozenset()

    @cached_property
    def bodies(self) -> dict[str, Element]:
        """Bodies by key."""
        return {e.key: e for e in self.document.elements("bodies")}

    @cached_property
    def joints(self) -> list[Element]:
        """Joints, each once."""
        return list({e.key: e for e in self.document.elements("joints")}.values())

    @cached_property
    def objects(self) -> list[Element]:
        """Every object of the file, each once."""
        return list({e.key: e for listed in self.document.lists.values() for e in listed}.values())

    def body(self, text: str) -> Element | None:
        """The body of this file that a reference means."""
        keys = list(self.bodies)
        found = find_by_text(keys, text)
        if found is None:
            names = [f"{self.document.top.text('namespace')}{key}" for key in keys]
            found = find_by_text(names, text)
        return None if found is None else self.bodies[keys[found]]

    def folder(self, element: Element, key: str) -> Path:
        """The folder that a path key of the file and of the object name; an absolute one counts alone (as in AMBF)."""
        own = element.text(key) or (element.text(HIGH) if key == LOW else "")
        return self.document.path.parent / self.document.top.text(key) / own

    def mesh_path(self, element: Element, key: str) -> Path | None:
        """Where the mesh of ``mesh`` or ``collision mesh`` lies; None without one."""
        name = element.value(key)
        if not name:
            return None
        return self.folder(element, HIGH if key == "mesh" else LOW) / str(name)

    def mesh(self, element: Element, key: str) -> Mesh | None:
        """The mesh, when it can be read."""
        path = self.mesh_path(element, key)
        return None if path is None else self._load(path)

    def surface(self, element: Element) -> tuple[Array, Faces] | None:
        """The whole mesh as the simulator scales it, welded, in metres: the visual one, else that of collisions."""
        mesh = self.outside(element)
        if mesh is None:
            return None
        vertices, faces = joined(mesh.parts)
        return vertices * element.number("scale"), faces

    def outside(self, element: Element) -> Mesh | None:
        """The visual mesh, else that of collisions, as it is in its file."""
        return self.mesh(element, "mesh") or self.mesh(element, "collision mesh")

    def _load(self, path: Path) -> Mesh | None:
        if path not in self._meshes:
            try:
                self._meshes[path] = load_mesh(path, self.resolver)
            except (AdfError, OSError):
                self._meshes[path] = None
        return self._meshes[path]

    @cached_property
    def _meshes(self) -> dict[Path, Mesh | None]:
        return {}

    def shapes(self, element: Element) -> list[tuple[Shape, Array]]:
        """Collision primitives and their poses in the body."""
        if element.has("collision shape"):
            offset = element.value("collision offset") or element.value("inertial offset")
            return [(self._shape(element, "collision shape", "collision geometry"), matrix_of(offset))]
        return [
            (self._shape(item, "shape", "geometry"), matrix_of(item.value("offset")))
            for item in element.children("compound collision shape")
        ]

    def looks(self, element: Element) -> list[tuple[Shape, Array]]:
        """Primitives that are drawn, which soft tissue fills, and their poses in the body."""
        if element.has("shape"):
            return [(self._shape(element, "shape", "geometry"), np.eye(4))]
        return [
            (self._shape(item, "shape", "geometry"), matrix_of(item.value("offset")))
            for item in element.children("compound shape")
        ]

    @staticmethod
    def _shape(element: Element, kind: str, block: str) -> Shape:
        names = ("x", "y", "z", "radius", "height", "axis", "normal", "offset")
        geometry = {n: element.value(f"{block}.{n}") for n in names if element.has(f"{block}.{n}")}
        return Shape.of(element.text(kind), geometry)

    def moves(self, element: Element) -> bool:
        """Whether a body is moved by forces."""
        return element.number("mass") > 0.0
