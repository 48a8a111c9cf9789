"""Elasticity against closed forms, and what must never happen."""

from __future__ import annotations

import os
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from ligature.mesh.grid import build_grid
from ligature.model.material import TissueMaterial
from ligature.tissue.elastic import ElasticGrid
from ligature.tissue.elements import CORNERS, lame, stiffness
from ligature.tissue.lips import Lips
from scipy.linalg import eigh
from scipy.spatial.transform import Rotation

YOUNGS = 1e5


def _block(size, cells):
    return build_grid([np.linspace(0.0, s, n + 1) for s, n in zip(size, cells, strict=True)])


def _settle(elastic, external=None, speed=1e-7):
    for _ in range(5000):
        elastic.advance(elastic.predict(external))
        if np.abs(elastic.v).max() < speed:
            return
    raise AssertionError("still moving after 20 s")


def _face_load(grid, axis, force):
    """A force (3,) spread evenly over the far face of an axis."""
    end = grid.nodes[:, axis] > grid.axes[axis][-1] - 1e-12
    area = np.ones(len(grid.nodes))
    for other in {0, 1, 2} - {axis}:
        plane = grid.axes[other]
        width = np.gradient(plane) * np.where(np.isin(np.arange(len(plane)), [0, len(plane) - 1]), 0.5, 1.0)
        area *= width[grid.site[:, other]]
    area = np.where(end, area, 0.0)
    return area[:, None] / area.sum() * np.asarray(force), end


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.49])
def test_bar_under_tension_lengthens_and_thins_as_hooke_states(poisson):
    size, force = np.array([0.02, 0.01, 0.008]), 1e-3
    grid = _block(size, (4, 3, 2))
    load, end = _face_load(grid, 0, (force, 0.0, 0.0))
    # Nothing holds the bar, so that it can narrow: the same load pulls its near face the other way.
    mirrored = np.zeros_like(load)
    lookup = {tuple(s): i for i, s in enumerate(grid.site)}
    for i in np.flatnonzero(end):
        j, k = grid.site[i, 1:]
        mirrored[lookup[(0, j, k)]] = -load[i]
    elastic = ElasticGrid(grid, [TissueMaterial(YOUNGS, poisson)], np.zeros(len(grid.nodes), dtype=bool))
    _settle(elastic, load + mirrored, 1e-12)
    strain = force / (size[1] * size[2]) / YOUNGS
    u = elastic.x - grid.nodes
    lengths = np.ptp(elastic.x, axis=0)
    assert (lengths[0] - size[0]) / size[0] == pytest.approx(strain, rel=1e-6)
    for axis in (1, 2):
        assert (lengths[axis] - size[axis]) / size[axis] == pytest.approx(-poisson * strain, abs=1e-6 * strain)
    assert np.abs(u.mean(axis=0)).max() < 1e-9


def _flap(cells, poisson):
    """Deflection of a flap under a force at its end, over Timoshenko's for a wide beam."""
    length, width, thick, force = 0.02, 0.01, 0.005, 2e-3
    grid = _block((length, width, thick), cells)
    load, end = _face_load(grid, 0, (0.0, 0.0, force))
    elastic = ElasticGrid(grid, [TissueMaterial(YOUNGS, poisson)], grid.nodes[:, 0] < 1e-9)
    _settle(elastic, load)
    sag = float((load[:, 2] @ (elastic.x - grid.nodes)[:, 2]) / force)
    shear = YOUNGS / (2 * (1 + poisson))
    # Cowper, The shear coefficient in Timoshenko's beam theory, 1966, for a rectangle.
    kappa = 10 * (1 + poisson) / (12 + 11 * poisson)
    second = width * thick**3 / 12
    return sag / (force * (length**3 / (3 * YOUNGS * second) + length / (kappa * shear * width * thick)))


@pytest.mark.parametrize("poisson", [0.3, 0.45, 0.49])
def test_flap_bends_as_timoshenko_states_and_better_on_a_finer_grid(poisson):
    coarse, fine = _flap((8, 4, 2), poisson), _flap((16, 8, 4), poisson)
    assert coarse == pytest.approx(1.0, abs=0.15)
    assert fine == pytest.approx(1.0, abs=0.10)
    assert abs(fine - 1.0) <= abs(coarse - 1.0)


def _punch(fine, poisson):
    """Force under a square punch pressed into a deep block, over the one of a half-space."""
    half, depth, n = 4e-3, 1e-5, fine
    inner = np.linspace(-half, half, 2 * n + 1)
    outer = half * np.geomspace(1.0, 40.0, 9)[1:]  # supports far away: nearer ones stiffen by half / distance
    across = np.concatenate([-outer[::-1], inner, outer])
    deep = np.concatenate([-outer[::-1], np.linspace(-half, 0.0, n + 1)])
    grid = build_grid([across, across, deep])
    under = (np.abs(grid.nodes[:, :2]).max(axis=1) < half + 1e-9) & (grid.nodes[:, 2] > -1e-9)
    fixed = under | (grid.nodes[:, 2] < deep[0] + 1e-9) | (np.abs(grid.nodes[:, :2]).max(axis=1) > across[-1] - 1e-9)
    elastic = ElasticGrid(grid, [TissueMaterial(YOUNGS, poisson)], fixed)
    elastic.x[under, 2] -= depth
    _settle(elastic, speed=1e-9)
    force = elastic.elastic_forces()[under, 2].sum()
    # King, Int. J. Solids Struct. 23, 1987, 1657: F = 2 β E* sqrt(A / π) δ with β = 1.012 for a square.
    return force / (2 * 1.012 * YOUNGS / (1 - poisson**2) * np.sqrt((2 * half) ** 2 / np.pi) * depth)


@pytest.mark.parametrize("poisson", [0.45, 0.49])
def test_flat_punch_meets_the_stiffness_of_a_half_space(poisson):
    assert _punch(2, poisson) == pytest.approx(1.0, abs=0.25)


@pytest.mark.slow
@pytest.mark.parametrize("poisson", [0.45, 0.49])
def test_finer_grids_under_a_punch_come_nearer_to_a_half_space(poisson):
    coarse, fine = _punch(2, poisson), _punch(4, poisson)
    assert abs(fine - 1.0) < abs(coarse - 1.0)


def test_error_falls_with_the_square_of_the_cell_size():
    """A cube held all around, under the load that bends it to u_x = a sin(k x) sin(k y) sin(k z)."""
    size, a = 0.02, 1e-6
    k = np.pi / size
    material = TissueMaterial(YOUNGS, 0.3)
    first, shear = lame(material.youngs, material.poisson)
    errors = []
    for n in (4, 8, 12):
        grid = _block((size, size, size), (n, n, n))
        (sx, sy, sz), (cx, cy, cz) = np.sin(k * grid.nodes.T), np.cos(k * grid.nodes.T)
        # f = -μ ∇²u - (λ + μ) ∇ ∇·u
        f = -(first + shear) * a * k**2 * np.stack([-sx * sy * sz, cx * cy * sz, cx * sy * cz], axis=1)
        f[:, 0] += 3.0 * shear * a * k**2 * sx * sy * sz
        rim = (np.abs(grid.site - n / 2).max(axis=1)) > n / 2 - 0.5
        elastic = ElasticGrid(grid, [material], rim)
        _settle(elastic, f * (size / n) ** 3, 1e-12)
        expected = np.zeros_like(grid.nodes)
        expected[:, 0] = a * sx * sy * sz
        errors.append(np.sqrt(np.mean((elastic.x - grid.nodes - expected)[~rim] ** 2)) / a)
    orders = np.diff(np.log(errors)) / -np.diff(np.log([4, 8, 12]))
    assert (orders > 1.8).all(), (errors, orders)


def _pad(**options):
    grid = _block((0.05, 0.04, 0.01), (10, 8, 3))
    fixed = grid.nodes[:, 2] < 1e-9
    return ElasticGrid(grid, [TissueMaterial(YOUNGS)], fixed, **options)


@pytest.mark.parametrize("size", [1e-5, 1e-3, 4e-3])
def test_energy_never_grows_when_nothing_pushes(size):
    """From a shape bent by ``size`` metres, some cells by 40 degrees."""
    elastic = _pad()
    bend = size * np.sin(200.0 * elastic.grid.nodes[:, [1, 2, 0]])
    elastic.x[elastic.free] += bend[elastic.free]
    energies = []
    for _ in range(200):
        energies.append(elastic.energy())
        elastic.advance(elastic.predict())
    assert (np.diff(energies) <= 1e-12 * energies[0]).all()
    assert energies[-1] < 1e-6 * energies[0]
    np.testing.assert_allclose(elastic.x, elastic.grid.nodes, atol=1e-3 * size)


def test_tissue_at_rest_stays_at_rest_to_the_bit():
    elastic = _pad()
    for _ in range(20):
        elastic.advance(elastic.predict())
    np.testing.assert_array_equal(elastic.v, 0.0)
    np.testing.assert_array_equal(elastic.x, elastic.grid.nodes)


def test_turned_cell_has_no_force_and_turned_stretch_turns_its_force():
    grid = _block((0.01, 0.008, 0.006), (2, 2, 2))
    elastic = ElasticGrid(grid, [TissueMaterial(YOUNGS)], np.zeros(len(grid.nodes), dtype=bool))
    rng = np.random.default_rng(3)
    bent = grid.nodes + 3e-4 * rng.normal(size=grid.nodes.shape)
    elastic.x[:] = bent
    for _ in range(10):  # until the frames have turned all the way
        force = elastic.elastic_forces()
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).max()
    for angle in (0.3, 1.5, 3.0):
        R = Rotation.from_rotvec(angle * np.array([0.6, -0.48, 0.64])).as_matrix()
        elastic.x[:] = grid.nodes @ R.T
        for _ in range(10):
            rigid = elastic.elastic_forces()
        assert np.abs(rigid).max() < 1e-9 * np.abs(force).max()
        elastic.x[:] = bent @ R.T
        for _ in range(10):
            turned = elastic.elastic_forces()
        np.testing.assert_allclose(turned, force @ R.T, atol=1e-6 * np.abs(force).max())


@settings(max_examples=30, deadline=None)
@given(
    size=st.tuples(*[st.floats(0.2, 5.0)] * 3), poisson=st.floats(0.0, 0.49), seed=st.integers(0, 2**31),
    turn=st.floats(0.0, 3.0), stretch=st.floats(0.0, 0.4),
)  # fmt: skip
def test_force_of_a_cell_is_that_of_its_stiffness_in_its_nearest_frame(size, poisson, seed, turn, stretch):
    rng = np.random.default_rng(seed)
    grid = build_grid([np.array([0.0, s]) for s in size])
    elastic = ElasticGrid(grid, [TissueMaterial(YOUNGS, poisson)], np.zeros(8, dtype=bool))
    Q = Rotation.from_rotvec(turn * _unit(rng)).as_matrix()
    X = grid.nodes[grid.cells[0]]
    F = Q @ (np.eye(3) + stretch * rng.uniform(-1.0, 1.0, (3, 3)))
    bent = 0.05 * stretch * min(size) * rng.normal(size=(8, 3))
    x = X @ F.T + bent
    elastic.x[grid.cells[0]] = x + 10.0 * rng.normal(size=3)
    for _ in range(12):  # until the frame has turned all the way
        force = elastic.elastic_forces()[grid.cells[0]]
    # The mean gradient, and the rotation nearest to it by its singular values.
    signs = np.where(CORNERS > 0.5, 1.0, -1.0)
    mean = np.einsum("ka,kb->ab", x, 0.25 * signs / np.array(size))
    U, _, V = np.linalg.svd(mean)
    R = U @ np.diag([1.0, 1.0, np.linalg.det(U @ V)]) @ V
    y = ((x - x[0]) @ R - (X - X[0])).reshape(24)
    expected = -(stiffness(np.array(size), YOUNGS, poisson) @ y).reshape(8, 3) @ R.T
    atol = 1e-7 * np.abs(expected).max() + 1e-13 * YOUNGS * max(size) ** 2
    np.testing.assert_allclose(force, expected, atol=atol)


def _unit(rng):
    v = rng.normal(size=3)
    return v / np.linalg.norm(v)


def test_a_solve_in_shares_has_the_bits_of_one_at_once():
    whole, parts = _pad(), _pad()
    rng = np.random.default_rng(4)
    for _ in range(20):
        load = 1e-2 * rng.normal(size=whole.x.shape)
        parts.begin(load)
        for share in np.sort(rng.uniform(0.0, 1.0, 3)):
            parts.solve(share)
            assert parts.progress[0] < len(parts._bulk.shares)
        parts.solve(1.0)
        d = whole.predict(load)
        np.testing.assert_array_equal(parts.displacement(), d)
        whole.advance(d)
        parts.advance(d)


def test_a_body_that_nothing_holds_deforms_about_a_frame_that_takes_its_momentum():
    """What forces do to the whole body is its frame's: centre of mass, and the frame that fits best, stay."""
    grid = _block((0.02, 0.02, 0.02), (3, 3, 3))
    elastic = ElasticGrid(grid, [TissueMaterial(YOUNGS)], np.zeros(len(grid.nodes), dtype=bool))
    rng = np.random.default_rng(1)
    rest = grid.nodes - elastic.mass @ grid.nodes / elastic.mass.sum()
    for _ in range(30):
        elastic.advance(elastic.predict(1e-3 * rng.normal(size=grid.nodes.shape)))
        largest = np.abs(elastic.mass[:, None] * elastic.v).max()
        assert largest > 1e-9
        np.testing.assert_allclose(elastic.mass @ elastic.v, 0.0, atol=1e-9 * largest)
        moved = elastic.mass[:, None] * np.cross(rest, elastic.x - grid.nodes)
        np.testing.assert_allclose(moved.sum(axis=0), 0.0, atol=1e-9 * np.abs(moved).max())


@pytest.mark.parametrize("table", [True, False])
def test_response_is_what_a_force_does_in_a_step(table, monkeypatch):
    if not table:
        monkeypatch.setattr("ligature.tissue.elastic.TABLE_NODES", 0)
    elastic = _pad()
    rng = np.random.default_rng(2)
    cell = elastic.grid.cells[-1]
    weights = rng.dirichlet(np.ones(8))
    force = np.array([0.1, -0.2, 0.05])
    load = np.zeros_like(elastic.x)
    load[cell] = weights[:, None] * force
    expected = elastic.predict(load)
    np.testing.assert_allclose(
        np.tensordot(force, elastic.response(cell, weights), 1), expected, atol=1e-12 * np.abs(expected).max()
    )


def _wound(gap):
    """A pad with a wound of ``gap`` metres through half of its depth."""
    y = np.concatenate([np.linspace(0.0, 0.018, 4), np.linspace(0.018 + gap, 0.036 + gap, 4)])
    filled = np.ones((10, len(y) - 1, 4), dtype=bool)
    filled[2:8, 3, 1:] = False
    grid = build_grid([np.linspace(0.0, 0.05, 11), y, np.linspace(0.0, 0.01, 5)], filled, closing=(1,))
    rim = (grid.nodes[:, 2] < 1e-9) | (grid.nodes[:, 1] < 1e-9) | (grid.nodes[:, 1] > y[-1] - 1e-9)
    elastic = ElasticGrid(grid, [TissueMaterial(YOUNGS)], rim)
    return elastic, Lips(elastic)


def _step(elastic, lips, load):
    external = load.copy()
    lips.expect(external)
    d = elastic.predict(external)
    lips.close(d)
    elastic.advance(d)


def test_lips_pressed_together_close_and_do_not_pass_each_other():
    elastic, lips = _wound(0.004)
    assert lips.gaps().min() == pytest.approx(0.004)
    load = np.zeros_like(elastic.x)
    # The nodes at its two ends hang on the cells beyond.
    along, _, up = elastic.grid.nodes[lips.pairs[:, 0]].T
    top = (up > 0.007) & (along > 0.014) & (along < 0.036)
    middle = (up > 0.009) & (along > 0.019) & (along < 0.031)
    for a, b in lips.pairs[top]:
        load[a, 1], load[b, 1] = 0.4, -0.4
    for step in range(250):
        _step(elastic, lips, load)
        assert lips.gaps().min() > -5e-5, step
    assert lips.gaps()[middle].max() < 1e-4
    assert (lips.force[lips.gaps() > 1e-5] == 0.0).all()
    assert (lips.force >= 0.0).all()
    assert lips.force.sum() > 1.0
    # Let go, they part again.
    for _ in range(400):
        _step(elastic, lips, np.zeros_like(load))
    np.testing.assert_allclose(lips.gaps(), 0.004, atol=1e-6)
    assert not lips.force.any()


PROGRAM = """
import hashlib
import numpy as np
from tests.tissue.test_elastic import _step, _wound
elastic, lips = _wound(0.001)
load = np.zeros_like(elastic.x)
load[lips.pairs[:, 0], 1], load[lips.pairs[:, 1], 1] = 0.1, -0.1
for _ in range(50):
    _step(elastic, lips, load)
print(hashlib.sha256(elastic.x.tobytes() + lips.force.tobytes()).hexdigest())
"""


def test_two_processes_with_different_thread_counts_give_the_same_bits():
    root = __file__.rsplit("/tests/", 1)[0]
    prints = []
    for threads in ("1", "2"):
        environment = {**os.environ, "OMP_NUM_THREADS": threads, "OPENBLAS_NUM_THREADS": threads}
        run = subprocess.run(
            [sys.executable, "-c", PROGRAM], cwd=root, env=environment, capture_output=True, text=True, check=True
        )
        prints.append(run.stdout)
    assert prints[0] == prints[1]
    assert len(prints[0].strip()) == 64


@settings(deadline=None, max_examples=20)
@given(st.integers(0, 10**6), st.floats(0.0, 0.49), st.floats(4.5, 5.5), st.floats(5.0, 40.0))
def test_what_is_dragged_by_many_cells_comes_back(seed, poisson, edge, far):
    """One to three nodes go anywhere at 0.1 m/s, by the forces that take them there, until they are let go."""
    rng = np.random.default_rng(seed)
    grid = _block((8 * 1e-3 * edge, 0.04, 0.015), (8, 8, 3))
    elastic = ElasticGrid(grid, [TissueMaterial(YOUNGS, poisson)], grid.site[:, rng.integers(3)] == 0)
    rest = elastic.x.copy()
    free = elastic.free[np.argsort(np.linalg.norm(rest[elastic.free] - rest[rng.choice(elastic.free)], axis=1))]
    nodes = rng.choice(free[:8], rng.integers(1, 4), replace=False)
    moved = np.concatenate([elastic.response(np.array([node]), np.ones(1)) for node in nodes])
    compliance = moved[:, nodes].reshape(len(moved), -1)
    way = rng.normal(size=3)
    way *= 1e-3 * far / np.linalg.norm(way)
    for k in range(150):
        d = elastic.predict()
        left = rest[nodes] + way * min(1.0, (k + 1) * 0.4 / far) - (elastic.x + d)[nodes]
        elastic.advance(d + np.tensordot(np.linalg.solve(compliance.T, left.reshape(-1)), moved, 1))
        assert np.abs(elastic.x - rest).max() < 1.5e-3 * far + 5e-3
    for _ in range(1500):
        elastic.advance(elastic.predict())
    assert np.abs(elastic.x - rest).max() < 1e-6


@pytest.mark.parametrize("poisson", [0.0, 0.3, 0.45, 0.49])
def test_a_turned_cell_is_as_stiff_as_its_nodes_are_slowed_for(poisson):
    """Largest eigenvalues of its stiffness over its part of the matrix, about 60 random axes."""
    material = TissueMaterial(YOUNGS, poisson)
    elastic = ElasticGrid(_block((0.005, 0.005, 0.005), (1, 1, 1)), [material], np.zeros(8, dtype=bool))
    matrix = elastic._step_K[0] + np.diag(np.repeat(elastic.mass, 3)) / elastic.h**2
    lame_1, shear = lame(YOUNGS, poisson)
    axes = np.random.default_rng(0).normal(size=(60, 3))
    for angle in np.radians([0, 10, 20, 30, 45, 60, 90, 120, 180]):
        bound = 1.0 / 3.0 + np.sin(min(angle, np.pi / 2)) ** 2 * (lame_1 / shear + 2.0)
        found = 0.0
        for axis in axes:
            turn = np.kron(np.eye(8), Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix())
            found = max(found, eigh(turn @ elastic._K[0] @ turn.T, matrix, eigvals_only=True)[-1])
        assert found < 1.1 * bound
        assert found > 0.85 * bound or poisson < 0.45 or angle > 2.1, "nor are nearly incompressible ones slowed more"
