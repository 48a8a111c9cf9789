"""Mass properties against closed forms."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import trimesh
from ligature.adf import Resolver
from ligature.mesh import MassProperties, box_inertia, combined, hull_properties, load_mesh, mass_properties
from ligature.mesh.inertia import (
    box_properties,
    capsule_properties,
    cone_properties,
    cylinder_properties,
    sphere_properties,
)
from ligature.mesh.surface import joined
from ligature.model.frames import pose_matrix, rpy_matrix
from scipy.integrate import quad

from tests.mesh.shapes import ell

SIZE = np.array([0.2, 0.3, 0.5])


def box(offset: np.ndarray | None = None, R: np.ndarray | None = None) -> trimesh.Trimesh:
    mesh = trimesh.creation.box(SIZE)
    vertices = mesh.vertices @ (np.eye(3) if R is None else R).T + (0 if offset is None else offset)
    return trimesh.Trimesh(vertices, mesh.faces, process=False)


def test_a_box_anywhere_has_the_inertia_of_a_box() -> None:
    offset, R = np.array([1.0, -2.0, 3.0]), rpy_matrix(0.3, 0.4, 0.5)
    mesh = box(offset, R)
    found = mass_properties(mesh.vertices, mesh.faces, density=1000.0)
    assert found.volume == pytest.approx(0.03, rel=1e-9) and found.mass == pytest.approx(30.0, rel=1e-9)
    assert found.centre == pytest.approx(offset, rel=1e-9)
    assert np.allclose(found.inertia, R @ np.diag(box_inertia(30.0, SIZE)) @ R.T, rtol=1e-6)
    moments, axes = found.principal()
    assert moments == pytest.approx(np.sort(box_inertia(30.0, SIZE)), rel=1e-6)
    assert np.linalg.det(axes) == pytest.approx(1.0)


def test_a_hull_is_a_solid() -> None:
    assert hull_properties(box().vertices).volume == pytest.approx(0.03, rel=1e-9)
    with pytest.raises(ValueError, match="coplanar"):
        hull_properties(np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [1, 1, 0]], dtype=float))


def test_two_halves_make_the_whole() -> None:
    half = SIZE * [0.5, 1, 1]
    parts = []
    for side in (-1, 1):
        mesh = trimesh.creation.box(half)
        parts.append(mass_properties(mesh.vertices + [side * half[0] / 2, 0, 0], mesh.faces))
    whole = combined(parts)
    assert whole.mass == pytest.approx(0.03)
    assert np.allclose(whole.inertia, np.diag(box_inertia(0.03, SIZE)), rtol=1e-9, atol=1e-12)


def test_an_ell_has_the_inertia_of_its_three_cubes() -> None:
    vertices, faces = ell(1.0)
    cubes = [box_properties(np.ones(3)).placed(pose_matrix(p, (0, 0, 0))) for p in
             ((0.5, 0.5, 0.5), (1.5, 0.5, 0.5), (0.5, 1.5, 0.5))]  # fmt: skip
    expected, found = combined(cubes), mass_properties(vertices, faces)
    assert found.volume == pytest.approx(3.0, rel=1e-14)
    assert np.allclose(found.centre, expected.centre, rtol=1e-14)
    assert np.allclose(found.inertia, expected.inertia, rtol=1e-13, atol=1e-14)
    inwards = mass_properties(vertices, faces[:, ::-1])
    assert inwards.volume == pytest.approx(3.0) and np.allclose(inwards.inertia, expected.inertia)


def test_a_needle_of_a_millimetre_far_away_keeps_its_digits() -> None:
    vertices, faces = ell(1e-3)
    here, there = mass_properties(vertices, faces), mass_properties(vertices + 1.0, faces)
    assert there.volume == pytest.approx(3e-9, rel=1e-9)
    assert np.allclose(there.inertia, here.inertia, rtol=1e-8, atol=1e-22)


def test_surfaces_without_an_inside_are_refused() -> None:
    vertices, faces = ell()
    with pytest.raises(ValueError, match="not closed: 3 edges"):
        mass_properties(vertices, faces[1:])
    with pytest.raises(ValueError, match="encloses no volume"):
        mass_properties(vertices * [1, 1, 0] + [0, 0, 1], np.vstack([faces[:4], faces[:4, ::-1]]))
    with pytest.raises(ValueError, match="no triangle"):
        mass_properties(vertices, faces[:0])
    with pytest.raises(ValueError, match="without mass"):
        combined([])


def _revolved(radius: Callable[[float], float], half: float) -> MassProperties:
    """Of a solid of revolution about Z between ±``half``, from integrals over its discs."""

    def integral(f: Callable[[float], float]) -> float:
        return float(quad(f, -half, half, epsabs=1e-15, epsrel=1e-10, points=(-0.2, 0.0, 0.2), limit=200)[0])

    volume = integral(lambda z: np.pi * radius(z) ** 2)
    centre = integral(lambda z: np.pi * radius(z) ** 2 * z) / volume
    along = integral(lambda z: np.pi / 2 * radius(z) ** 4)
    across = integral(lambda z: np.pi * radius(z) ** 2 * (radius(z) ** 2 / 4 + (z - centre) ** 2))
    return MassProperties(volume, volume, np.array([0, 0, centre]), np.diag([across, across, along]))


@pytest.mark.parametrize(
    ("found", "radius", "half"),
    [
        (sphere_properties(0.3), lambda z: (0.09 - z * z) ** 0.5, 0.3),
        (cylinder_properties(0.3, 1.0), lambda z: 0.3, 0.5),
        (capsule_properties(0.3, 1.0), lambda z: (0.09 - max(abs(z) - 0.2, 0.0) ** 2) ** 0.5, 0.5),
        (cone_properties(0.3, 1.0), lambda z: 0.3 * (0.5 - z), 0.5),
    ],
    ids=["sphere", "cylinder", "capsule", "cone"],
)
def test_primitives_agree_with_integrals_over_their_discs(
    found: MassProperties, radius: Callable[[float], float], half: float
) -> None:
    expected = _revolved(radius, half)
    assert found.volume == pytest.approx(expected.volume, rel=1e-9)
    assert np.allclose(found.centre, expected.centre, rtol=1e-9, atol=1e-12)
    assert np.allclose(found.inertia, expected.inertia, rtol=1e-9)


def test_a_box_of_given_mass_has_bullets_estimate() -> None:
    assert np.allclose(np.diag(box_properties(SIZE, 500.0).inertia), box_inertia(15.0, SIZE), rtol=1e-14)
    heavier = box_properties(SIZE).with_mass(2.0)
    assert heavier.mass == 2.0 and np.allclose(np.diag(heavier.inertia), box_inertia(2.0, SIZE), rtol=1e-14)


def test_a_compound_of_primitives_turns_as_one() -> None:
    T = pose_matrix((0.1, -0.2, 0.3), (0.5, -0.4, 1.2))
    parts = [cone_properties(0.1, 0.4, 700.0), capsule_properties(0.05, 0.6, 900.0)]
    moved, turned = combined([part.placed(T) for part in parts]), combined(parts).placed(T)
    assert np.allclose(moved.centre, turned.centre, rtol=1e-12)
    assert np.allclose(moved.inertia, turned.inertia, rtol=1e-12, atol=1e-15)
    assert np.allclose(moved.principal()[0], combined(parts).principal()[0], rtol=1e-12)


def test_closed_corpus_meshes_agree_with_trimesh(corpus: Path) -> None:
    compared = 0
    for file in sorted((corpus / "multibodies" / "meshes" / "blender_afmb").rglob("*.STL")):
        vertices, faces = joined(load_mesh(file, Resolver([corpus])).parts)
        try:
            found = mass_properties(vertices, faces)
        except ValueError:
            continue
        expected = trimesh.Trimesh(vertices, faces, process=False).mass_properties
        assert found.volume == pytest.approx(abs(expected["volume"]), rel=1e-9), file
        scale = np.abs(found.inertia).max()
        assert np.allclose(found.inertia, np.sign(expected["volume"]) * expected["inertia"], rtol=0, atol=1e-8 * scale)
        compared += 1
    assert compared > 20
