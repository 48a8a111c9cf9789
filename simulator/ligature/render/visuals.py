"""What of a scene is drawn: the pieces of every body and ghost, from mesh files and primitive shapes.

Pieces stand in the frame of their owner; owners are bodies, then ghosts, counted through. Metres.
"""

from __future__ import annotations

from collections.abc import Hashable, Iterator, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ligature.adf import AdfError, Resolver
from ligature.mesh import Material, Mesh, MeshPart, load_mesh
from ligature.mesh.surface import joined, open_edges, shells
from ligature.model.scene import Scene
from ligature.model.shapes import Capsule, Cone, Cylinder, Hull, Plane, ShaderFiles, Shape, Sphere, TriMesh, Visual
from ligature.render.geometry import Triangles, flat_shaded, of_shape
from ligature.render.surface import Surface, surface_of

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Piece:
    """Triangles of one surface on one owner.

    ``geometry`` equals that of pieces with the same triangles; ``closed`` is whether no back face can
    be seen; ``coarse`` are the triangles of the owner's low-resolution mesh, to be drawn when it is far away.
    """

    geometry: Hashable
    triangles: Triangles
    surface: Surface
    owner: int
    T_owner_piece: Array
    closed: bool = False
    coarse: bool | None = None
    """False: fine, with a coarse alternative; True: that alternative; None: drawn at any distance."""
    shaders: ShaderFiles | None = None
    primitive: tuple[int, float, float] | None = None
    """Kind of an exactly drawn primitive as in ``analytic.glsl``, its radius and half height."""
    deforms: bool = False
    """Whether its vertices move, in world axes, from picture to picture."""


class VisualLoader:
    """Loads the pieces of owners; each mesh file is read once. ``problems`` states which could not be.

    ``roots`` are those of the scene: material libraries and textures may lie anywhere below them.
    """

    def __init__(self, roots: Sequence[Path] = ()) -> None:
        self.problems: list[AdfError] = []
        self._roots = tuple(roots)
        self._meshes: dict[Path, _Loaded | None] = {}

    def of_scene(self, scene: Scene) -> list[Piece]:
        """Pieces of every visible body and ghost but the elements of rods."""
        owners = [(b.index, b.visual) for b in scene.bodies if b.index not in scene.rod_bodies]
        owners += [(len(scene.bodies) + g.index, g.visual) for g in scene.ghosts]
        return [piece for owner, visual in owners if visual.visible for piece in self.pieces(owner, visual)]

    def pieces(self, owner: int, visual: Visual) -> Iterator[Piece]:
        """Pieces of one owner, fine and, where there is one, coarse."""
        if visual.mesh is None:
            for collider in visual.shapes:
                shape, surface = collider.shape, surface_of(visual.colour, None)
                closed = not isinstance(shape, Plane | TriMesh)
                T = collider.T_body_shape
                exact = primitive_of(shape)
                yield Piece(_key(shape), of_shape(shape), surface, owner, T, closed, None, visual.shaders, exact)
            return
        fine = self._mesh(visual.mesh)
        if fine is None:
            return
        low = visual.low_resolution_mesh
        coarse = self._mesh(low) if low is not None and low != visual.mesh and low.is_file() else None
        if coarse is None or not coarse.stands_for(fine):
            yield from fine.pieces(owner, visual, None)
        else:
            yield from fine.pieces(owner, visual, False)
            yield from coarse.pieces(owner, visual, True)

    def material(self, visual: Visual) -> Material | None:
        """The first material of a visual's mesh file."""
        mesh = None if visual.mesh is None else self._mesh(visual.mesh)
        return mesh.mesh.parts[0].material if mesh is not None and mesh.mesh.parts else None

    def _mesh(self, path: Path) -> _Loaded | None:
        if path not in self._meshes:
            try:
                mesh = load_mesh(path, Resolver([*self._roots, path.parent]))
                self.problems += [AdfError(found) for found in mesh.diagnostics if found.message.startswith("texture")]
                self._meshes[path] = _Loaded(mesh)
            except AdfError as error:
                self.problems.append(error)
                self._meshes[path] = None
        return self._meshes[path]


class _Loaded:
    """A mesh file, with what is known of its surface."""

    def __init__(self, mesh: Mesh) -> None:
        self.mesh = mesh
        self.closed = faces_outward(mesh)
        self.triangles = [triangles_of(part) for part in mesh.parts]

    @property
    def count(self) -> int:
        return sum(len(t.faces) for t in self.triangles)

    def stands_for(self, fine: _Loaded) -> bool:
        """Whether it is at most half as detailed as ``fine`` and fills the same box to a tenth of its size."""
        if not self.count or 2 * self.count > fine.count:
            return False
        boxes = [(m.vertices.min(axis=0), m.vertices.max(axis=0)) for m in (self.mesh, fine.mesh)]
        size = float(np.linalg.norm(boxes[1][1] - boxes[1][0]))
        return bool(np.abs(np.array(boxes[0]) - np.array(boxes[1])).max() <= 0.1 * size)

    def pieces(self, owner: int, visual: Visual, coarse: bool | None) -> Iterator[Piece]:
        T = np.diag([visual.scale] * 3 + [1.0])
        closed = self.closed and visual.scale > 0
        for index, (part, triangles) in enumerate(zip(self.mesh.parts, self.triangles, strict=True)):
            if len(part.faces):
                surface = surface_of(visual.colour, part.material)
                key = (self.mesh.path, index)
                yield Piece(key, triangles, surface, owner, T, closed, coarse, visual.shaders)


def triangles_of(part: MeshPart) -> Triangles:
    """The triangles of a mesh part; without normals of its own each face is flat."""
    if part.normals is None:
        return flat_shaded(part.vertices, part.faces)
    uvs = part.uvs if part.uvs is not None else np.zeros((len(part.vertices), 2))
    return Triangles(part.vertices, part.normals, uvs, part.faces)


def faces_outward(mesh: Mesh) -> bool:
    """Whether every connected piece of a mesh is closed and winds counter-clockwise seen from outside."""
    vertices, faces = joined(mesh.parts)
    if not len(faces) or open_edges(faces):
        return False
    a, b, c = faces.T
    volumes = np.einsum("ij,ij->i", vertices[a], np.cross(vertices[b], vertices[c]))
    return bool((np.bincount(shells(len(vertices), faces), weights=volumes) > 0).all())


def primitive_of(shape: Shape) -> tuple[int, float, float] | None:
    """Kind, radius and half height of a round shape, whose depth and outline are drawn exactly."""
    if isinstance(shape, Sphere):
        return 1, shape.radius, shape.radius
    if isinstance(shape, Cylinder):
        return 2, shape.radius, shape.height / 2
    if isinstance(shape, Capsule):
        return 3, shape.radius, max(shape.height / 2, shape.radius)
    if isinstance(shape, Cone):
        return 4, shape.radius, shape.height / 2
    return None


def _key(shape: Shape) -> Hashable:
    """Equal for primitives of equal measures; hulls and meshes are their own."""
    if isinstance(shape, Plane | Hull | TriMesh) or not hasattr(shape, "__dataclass_fields__"):
        return id(shape)
    values = [tuple(v) if isinstance(v, np.ndarray) else v for v in astuple(shape)]
    return (type(shape).__name__, *values)
