"""What conversions of other formats share: the converted objects, and shapes as keys of a body. Metres."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np

from ligature.adf.frames import Array
from ligature.authoring.generate import Parts
from ligature.authoring.placement import pose_of
from ligature.authoring.shapes import Shape, shape_mesh
from ligature.mesh.mesh import Material, Mesh, MeshPart
from ligature.paths import as_file_name

COLLIDING = "_collision.OBJ"
"""How names of mesh files end that collide, and no others."""


@dataclass
class Converted:
    """A converted robot, what could not be expressed, and keys of the model file as a whole."""

    parts: Parts
    notes: list[str] = field(default_factory=list)
    top: Mapping[str, Any] = field(default_factory=dict)


def shape_keys(
    owner: str, prefix: str, primitives: list[tuple[Shape, Array]], parts: list[MeshPart], meshes: dict[str, Mesh]
) -> Iterator[tuple[str, Any]]:
    """Keys of a body's looks (``prefix`` empty) or of what collides (``"collision "``).

    Primitives at poses (4, 4) in the body become a compound. The format has either primitives or a
    mesh; where there are both, the primitives become parts of the mesh, which is put into ``meshes``.
    """
    if primitives and not parts:
        yield (
            f"compound {prefix}shape",
            tuple(
                {
                    "shape": shape.kind,
                    **{f"geometry.{key}": value for key, value in shape.geometry().items()},
                    "offset": pose_of(T),
                }
                for shape, T in primitives
            ),
        )
    elif parts:
        name = _file_of(owner, COLLIDING if prefix else ".OBJ", meshes)
        drawn = [shape_part(f"{shape.kind.lower()}_{i}", shape, T) for i, (shape, T) in enumerate(primitives)]
        meshes[name] = Mesh(Path(name), (*parts, *drawn))
        yield f"{prefix}mesh", name
        if prefix:
            yield "collision mesh type", "CONVEX_HULL"
    elif prefix:
        yield "collision mesh", ""  # otherwise the visual mesh would collide


def _file_of(owner: str, ending: str, meshes: Mapping[str, Mesh]) -> str:
    """A name of a mesh file that is none of ``meshes``: links may be called ``arm/base``, or by a path elsewhere."""
    numbered = (f"{as_file_name(owner)}{f'_{number}' if number > 1 else ''}{ending}" for number in count(1))
    return next(file for file in numbered if file not in meshes and file.endswith(COLLIDING) is (ending == COLLIDING))


def shape_part(name: str, shape: Shape, T: Array, material: Material | None = None) -> MeshPart:
    """A primitive at a pose as triangles."""
    vertices, polygons = shape_mesh(shape)
    faces = [(face[0], b, c) for face in polygons for b, c in zip(face[1:], face[2:], strict=False)]
    return MeshPart(name, vertices @ T[:3, :3].T + T[:3, 3], np.array(faces, dtype=np.int32), material=material)
