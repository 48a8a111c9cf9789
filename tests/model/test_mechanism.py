"""Kinematics of loops: Jacobians are derivatives, steps close loops, and motions that keep loops closed do."""

from __future__ import annotations

from pathlib import Path

import ligature
import numpy as np
import pytest
from ligature.model.mechanism import Mechanism, chain_of
from numpy.typing import NDArray

from tests.physics.linkages import KINDS, linkage

Array = NDArray[np.float64]

RCOND = 0.02
STEP = 1e-6
CASES = [(kind, closing) for kind in KINDS if kind != "spatial" for closing in ("revolute", "p2p", "cone twist")]
CASES += [("spatial", "p2p"), ("pair", "p2p")]
FREEDOMS = {"revolute": 3, "p2p": 2, "six dof": 3, "cone twist": 5}
"""Directions in which the ends of a planar loop move: in its plane, and where its last joint turns out of it."""

PAIR = """bodies: [A, B, C, D]
joints: [JA, JC, JP]
A: {name: a, mass: 1, inertial offset: {position: {x: 0.02, y: 0, z: 0}, orientation: {r: 0.3, p: 0, y: 0}}}
B: {name: b, mass: 1, location: {position: {x: 0.3, y: 0, z: 0}}}
C: {name: c, mass: 1, location: {position: {x: 0.3, y: 0.4, z: 0}}}
D: {name: d, mass: 1, location: {position: {x: 0.6, y: 0.4, z: 0}}}
JA: {name: ja, type: revolute, parent: A, child: B, parent pivot: {x: 0.3, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}}
JC: {name: jc, type: prismatic, parent: D, child: C, parent pivot: {x: -0.3, y: 0, z: 0}, child pivot: {x: 0, y: 0, z: 0}, parent axis: {x: 1, y: 0, z: 0}, child axis: {x: 1, y: 0, z: 0}}
JP: {name: jp, type: p2p, parent: B, child: C, parent pivot: {x: 0, y: 0.2, z: 0}, child pivot: {x: 0, y: -0.2, z: 0}, parent axis: {x: 0, y: 0, z: 1}, child axis: {x: 0, y: 0, z: 1}}
"""
"""Two trees that both float, joined at a point."""


class Loop:
    """A linkage, and its coordinates ``x``, at which its loops are closed, by joint and by root."""

    def __init__(self, kind: str, closing: str, floats: bool, folder: Path) -> None:
        self.rng = np.random.default_rng([KINDS.index(kind) if kind in KINDS else 9, len(closing), floats])
        text = PAIR if kind == "pair" else linkage(self.rng, kind, closing)
        if floats:
            text = text.replace("mass: 0.000000", "mass: 1").replace("0.000e+00", "1")
        (folder / "m.yaml").write_text(text)
        scene = ligature.load(folder / "m.yaml")
        assert scene.loops
        self.mechanism = Mechanism(
            scene.bodies, scene.joints, scene.articulations, [chain_of(scene.joints[j], True) for j in scene.loops]
        )
        self.coordinates = {joint: np.array(values) for joint, values in scene.start.coordinates.items()}
        self.roots = dict(scene.start.roots)
        x = self.mechanism.gather(self.coordinates, self.roots)
        self.unit = np.where(self.mechanism._units, self.mechanism.size, 1.0)
        self.opened = x + self.rng.normal(0.0, 0.02, len(x)) * self.unit
        self.opened = np.clip(self.opened, self.mechanism.low, self.mechanism.high)
        closed = self.mechanism.solve(self.opened, 30, 1e-9, RCOND)
        self.poses = self.mechanism.poses(closed)
        self.mechanism.scatter(closed, self.coordinates, self.roots)
        self.x = self.mechanism.gather(self.coordinates, self.roots)

    def along(self, direction: Array) -> Array:
        """Derivative of the residual along ``direction`` (n,) without units, by central differences."""
        step = STEP * direction * self.unit
        return (self.mechanism.residual(self.x + step) - self.mechanism.residual(self.x - step)) / (2.0 * STEP)


@pytest.fixture(
    scope="module",
    params=[(*case, floats) for case in CASES for floats in (False, True)],
    ids=lambda case: "-".join(map(str, case)),
)
def loop(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Loop:
    return Loop(*request.param, tmp_path_factory.mktemp("loop"))


def test_a_loop_closes_from_where_it_is_open_with_its_joints_within_their_limits(loop: Loop) -> None:
    mechanism = loop.mechanism
    assert mechanism.gaps(loop.opened).max() > 1e-3
    assert mechanism.gaps(loop.x).max() < 1e-5
    assert ((loop.x >= mechanism.low) & (loop.x <= mechanism.high)).all()
    assert np.abs((loop.x - loop.opened) / loop.unit).max() < 0.5
    assert (
        mechanism.hard_gap(loop.opened, RCOND)
        <= np.linalg.norm(mechanism.residual(loop.opened)) * mechanism.size + 1e-12
    )
    assert mechanism.hard_gap(loop.x, RCOND) < 1e-6


def test_the_size_is_that_of_the_mechanism(tmp_path: Path) -> None:
    assert Loop("pair", "p2p", False, tmp_path).mechanism.size == pytest.approx(0.6)


def test_coordinates_that_were_written_back_give_the_same_poses(loop: Loop) -> None:
    again = loop.mechanism.poses(loop.x)
    for body, T in loop.poses.items():
        np.testing.assert_allclose(again[body], T, atol=1e-12)


def test_the_jacobian_is_the_derivative_of_what_is_open(loop: Loop) -> None:
    _, J = loop.mechanism._evaluate(loop.x)
    numeric = np.column_stack([loop.along(direction) for direction in np.eye(len(loop.x))])
    np.testing.assert_allclose(J, numeric, atol=1e-4)


def test_motions_that_keep_loops_closed_are_all_that_the_rank_leaves(loop: Loop) -> None:
    N = loop.mechanism.tangent(loop.x, RCOND)
    assert N.shape == (len(loop.x), len(loop.x) - loop.mechanism.rank(loop.x, RCOND)) and N.shape[1]
    np.testing.assert_allclose(N.T @ N, np.eye(N.shape[1]), atol=1e-9)
    assert max(np.abs(loop.along(motion)).max() for motion in N.T) < RCOND
    moved = (loop.mechanism.wandered(loop.x, loop.rng, 1e-3, RCOND) - loop.x) / loop.unit
    assert np.abs(moved).max() == pytest.approx(1e-3)
    np.testing.assert_allclose(N @ (N.T @ moved), moved, atol=1e-12)


def test_a_coordinate_that_is_kept_stays_while_the_others_close_the_loop(loop: Loop) -> None:
    joint = loop.mechanism.chains[0].joint
    others = [chain for chain in loop.mechanism._all_chains() if chain.joint != joint]
    other = min(others, key=lambda chain: len(chain.axes)).joint  # of a spatial loop, three axes would not leave enough
    kept = range(loop.mechanism.columns(other).start, loop.mechanism.columns(other).stop)
    start = loop.x.copy()
    start[kept] += 1e-3 * loop.unit[kept]
    x = loop.mechanism.solve(start, 30, 1e-9, RCOND, kept=kept)
    assert (x[kept] == start[kept]).all()
    assert loop.mechanism.hard_gap(x, RCOND) < 1e-6


@pytest.mark.parametrize("closing", FREEDOMS)
@pytest.mark.parametrize("kind", ["four-bar", "slider"])
def test_the_ends_of_a_planar_loop_move_in_its_plane(kind: str, closing: str, tmp_path: Path) -> None:
    loop = Loop(kind, closing, False, tmp_path)
    (gram,) = loop.mechanism.freedoms(loop.x, RCOND)
    moved = (np.linalg.eigvalsh(gram) > RCOND**2).sum()
    assert moved == loop.mechanism.rank(loop.x, RCOND) == FREEDOMS[closing]
