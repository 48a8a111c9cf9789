"""Matrices of one cell against energies that are integrated from the strain tensor, for any box, material and motion."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.tissue.elements import blocks, elasticity, gradients, lame, skew_stiffness, stiffness

SIZE = st.tuples(*[st.floats(1e-3, 1e-2)] * 3).map(np.array)
YOUNGS, POISSON = st.floats(1e3, 1e6), st.floats(0.0, 0.49)
MOTION = st.integers(0, 2**32 - 1).map(lambda seed: np.random.default_rng(seed).uniform(-1e-3, 1e-3, (8, 3)))
CORNERS = [(i, j, k) for k, j, i in product((0, 1), repeat=3)]


def displacement(u, x):
    """Trilinear displacement (3,) at ``x`` (3,) of the unit cell."""
    shares = [np.prod([c if corner[a] else 1.0 - c for a, c in enumerate(x)]) for corner in CORNERS]
    return np.array(shares) @ u


def displacement_gradient(u, size, x, step=0.25):
    """Tensor (3, 3) of the derivatives of component i along axis j; differences are exact, for each is linear."""
    ways = step * np.eye(3)
    return np.column_stack(
        [(displacement(u, x + way) - displacement(u, x - way)) / (2 * step * size[j]) for j, way in enumerate(ways)]
    )


def at_gauss_points(u, size):
    places, _ = np.polynomial.legendre.leggauss(2)
    return [displacement_gradient(u, size, (1.0 + np.array(x)) / 2.0) for x in product(places, repeat=3)]


@settings(max_examples=15)
@given(SIZE, MOTION, st.tuples(*[st.floats(0.0, 1.0)] * 3).map(np.array))
def test_gradients_are_those_of_trilinear_displacements(size, u, x):
    np.testing.assert_allclose(u.T @ gradients(size, x), displacement_gradient(u, size, x), atol=1e-9)


@settings(max_examples=15)
@given(YOUNGS, POISSON)
def test_a_bar_under_tension_and_a_sheared_cube_strain_as_hooke_states(youngs, poisson):
    compliance = np.linalg.inv(elasticity(youngs, poisson))
    expected = np.diag([1.0] * 3 + [2.0 * (1.0 + poisson)] * 3)
    expected[:3, :3] -= poisson * (1.0 - np.eye(3))
    np.testing.assert_allclose(compliance, expected / youngs, rtol=1e-9, atol=1e-12 / youngs)


@settings(max_examples=15)
@given(SIZE, YOUNGS, POISSON, MOTION)
def test_a_cell_stores_the_energy_of_its_strain_with_the_mean_change_of_volume(size, youngs, poisson, u):
    first, shear = lame(youngs, poisson)
    strains = [(H + H.T) / 2.0 for H in at_gauss_points(u, size)]
    mean = np.mean([np.trace(e) for e in strains])
    strains = [e + (mean - np.trace(e)) / 3.0 * np.eye(3) for e in strains]
    density = np.mean([first / 2.0 * mean**2 + shear * np.sum(e * e) for e in strains])
    K = stiffness(size, youngs, poisson)
    assert u.ravel() @ K @ u.ravel() / 2.0 == pytest.approx(density * size.prod(), rel=1e-9)
    np.testing.assert_allclose(K, K.T, rtol=1e-12, atol=1e-12 * np.abs(K).max())


@settings(max_examples=15)
@given(SIZE, YOUNGS, POISSON, MOTION)
def test_resistance_to_rotation_is_that_of_the_skew_part_of_the_gradient(size, youngs, poisson, u):
    turns = [(H - H.T) / 2.0 for H in at_gauss_points(u, size)]
    expected = 2.0 * lame(youngs, poisson)[1] * size.prod() * np.mean([np.sum(W * W) for W in turns])
    assert u.ravel() @ skew_stiffness(size, youngs, poisson) @ u.ravel() == pytest.approx(expected, rel=1e-9)


@settings(max_examples=15)
@given(SIZE, YOUNGS, POISSON, MOTION)
def test_blocks_between_patterns_give_the_forces_of_the_whole_matrix(size, youngs, poisson, u):
    signs = np.array([[np.prod([-1 if m >> a & 1 and not corner[a] else 1 for a in range(3)]) for corner in CORNERS]
                      for m in range(8)])  # fmt: skip
    K = stiffness(size, youngs, poisson)
    small, on, forces = blocks(K), signs @ u, np.zeros((8, 3))
    for p, a, b in product(range(8), range(3), range(3)):
        forces[p ^ (1 << a), a] += small[p, a, b] * on[p ^ (1 << b), b]
    expected = (K @ u.ravel()).reshape(8, 3)
    np.testing.assert_allclose(signs.T @ forces, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
