"""Mesh tools free of Blender and of the physics engine: load, split, decompose, inertia, cache."""
