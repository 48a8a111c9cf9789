"""What one mutant goes through: read, checked, resolved; and what is accepted is stepped, or handed to Bullet."""

from __future__ import annotations

from collections.abc import Iterable
from functools import lru_cache
from pathlib import Path

import ligature
import numpy as np
import pybullet
from ligature.adf import AdfError, Diagnostic, Resolver, Severity, read_any
from ligature.mesh import CollisionCache, ConvexPart, collision_parts, load_mesh

from tests.fuzz.seeds import Seed

STEPPED = 10
"""One in so many accepted scenes is simulated, for two ticks."""


def attempt(seed: Seed, folder: Path, number: int) -> str:
    """Load the mutant that stands in ``folder``; returns ``clean``, ``findings`` or ``refused``.

    Raises AssertionError for a finding without words or place and for numbers that are not finite,
    and lets through whatever a user should never see.
    """
    entry = folder / seed.entry
    try:
        found = _scene(entry, number) if entry.suffix == ".yaml" else _mesh(entry)
    except AdfError as error:
        assert error.diagnostics, "refused without a finding"
        _check_located(error.diagnostics)
        return "refused"
    _check_located(found)
    return "findings" if any(d.severity >= Severity.WARNING for d in found) else "clean"


def _check_located(diagnostics: Iterable[Diagnostic]) -> None:
    for diagnostic in diagnostics:
        assert diagnostic.message, "a finding without words"
        assert diagnostic.mark is not None, f"a finding without a place: {diagnostic}"


def _scene(entry: Path, number: int) -> list[Diagnostic]:
    _check_located(read_any(entry, Resolver([entry.parent])).diagnostics)
    scene = ligature.load(entry, models=[0] if entry.name == "launch.yaml" else None, roots=[entry.parent])
    for body in scene.bodies:
        numbers = [body.mass, *body.inertia, *body.gravity, *body.T_world_body.flat, *body.T_body_inertial.flat]
        assert np.isfinite(numbers).all(), f"{body.identity.key} has numbers that are not finite"
    if number % STEPPED == 0:
        simulation = ligature.Simulation(scene)
        simulation.step(2)
        assert np.isfinite(simulation.state["body_pose"]).all(), "poses are not finite after two ticks"
    return list(scene.diagnostics)


def _mesh(entry: Path) -> list[Diagnostic]:
    found: list[Diagnostic] = []
    mesh = load_mesh(entry, Resolver([entry.parent]))
    cache = _cache()
    hulls = [p.vertices for p in collision_parts(mesh, "hull", report=found.append) if isinstance(p, ConvexPart)]
    if hulls:
        _collide(cache.hulls(hulls), 0)
    for part in collision_parts(mesh, "trimesh", report=found.append):
        if not isinstance(part, ConvexPart):
            _collide(cache.triangles(part.vertices, part.faces), pybullet.GEOM_FORCE_CONCAVE_TRIMESH)
    return [*mesh.diagnostics, *found]


@lru_cache(maxsize=1)
def _cache() -> CollisionCache:
    return CollisionCache()


@lru_cache(maxsize=1)
def _client() -> int:
    return int(pybullet.connect(pybullet.DIRECT))


def _collide(file: Path, flags: int) -> None:
    """Let a ball touch the shape of a sanitised file in Bullet."""
    client = _client()
    shape = pybullet.createCollisionShape(pybullet.GEOM_MESH, fileName=str(file), flags=flags, physicsClientId=client)
    ball = pybullet.createCollisionShape(pybullet.GEOM_SPHERE, radius=0.5, physicsClientId=client)
    pybullet.createMultiBody(0.0, shape, physicsClientId=client)
    pybullet.createMultiBody(1.0, ball, basePosition=[0.3, 0.3, 0.3], physicsClientId=client)
    pybullet.stepSimulation(physicsClientId=client)
    pybullet.resetSimulation(physicsClientId=client)
