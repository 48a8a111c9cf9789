"""Mesh tools free of Blender and of the physics engine: load, split, decompose, inertia, cache."""

from ligature.cache import CacheError, cache_folder
from ligature.mesh.cache import CollisionCache
from ligature.mesh.collision import ConvexPart, TrianglePart, collision_parts
from ligature.mesh.inertia import MassProperties, box_inertia, combined, hull_properties, mass_properties
from ligature.mesh.load import load_mesh
from ligature.mesh.mesh import Material, Mesh, MeshError, MeshPart

__all__ = [
    "CacheError",
    "CollisionCache",
    "ConvexPart",
    "MassProperties",
    "Material",
    "Mesh",
    "MeshError",
    "MeshPart",
    "TrianglePart",
    "box_inertia",
    "cache_folder",
    "collision_parts",
    "combined",
    "hull_properties",
    "load_mesh",
    "mass_properties",
]
