"""What the mesh files of an object are made of: the object itself, and the convex parts of its collision shape."""

from __future__ import annotations

from dataclasses import dataclass

import bpy
import numpy as np

from .poses import children_with, relative_pose, scaling


@dataclass(frozen=True, eq=False)
class Solid:
    """An object as a shape of an owner: what its transform leaves beside a rigid pose, (4, 4), and that pose.

    ``T_owner`` (4, 4) is None for the owner itself, whose pose is left out.
    """

    obj: bpy.types.Object
    scale: np.ndarray
    T_owner: np.ndarray | None = None


def solids_of(obj: bpy.types.Object) -> list[Solid]:
    """What the mesh files of an object are made of: itself, then the convex parts of its collision shape."""
    hulls = [Solid(hull, scaling(hull), relative_pose(obj, hull)) for hull in children_with(obj, "HULL")]
    return [own_solid(obj), *hulls]


def own_solid(obj: bpy.types.Object) -> Solid:
    """An object with its scale, in its own pose."""
    return Solid(obj, scaling(obj))
