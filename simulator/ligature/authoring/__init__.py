"""Tools for authors of scenes: placing, fitting, weighing, generating, checking, writing. No Blender, no simulation.

The Blender extension ships this package with `adf` and `mesh`; the command line uses it too.
"""
