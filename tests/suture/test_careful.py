"""Careful steps converge: contact forces follow Signorini's and Coulomb's laws, and balance all else.

Checked by the equations themselves, written once more with dense matrices.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from ligature.model.shapes import Box, Cylinder
from ligature.suture.careful import UNCHANGED, advance_carefully
from ligature.suture.contacts import detect
from ligature.suture.layout import Touches
from ligature.suture.passage_forces import begin_passages
from ligature.suture.rod import Rod
from ligature.suture.springs import begin_springs
from numpy.typing import NDArray

from tests.suture.conftest import DT, Bench, body, damped, from_material

Array = NDArray[np.float64]

WEIGHT = 1e-3
ALONG_Y = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])


def cross_matrix(r: Array) -> Array:
    return np.array([[0.0, -r[2], r[1]], [r[2], 0.0, -r[0]], [-r[1], r[0], 0.0]])


def thread_on_a_post(seed: int, movable: bool, friction: float) -> tuple[Bench, Rod]:
    """A light thread that winds around a post, nearly touching it, with loads at both ends and a rest of each tick.

    Its skin is up to 2 µm within the post and up to 20 µm off it. After a random number of ticks it moves as it may.
    """
    rng = np.random.default_rng(seed)
    thick, radius, turns = (
        float(rng.uniform(0.2e-3, 0.6e-3)),
        float(rng.uniform(1e-3, 5e-3)),
        float(rng.uniform(0.2, 2.0)),
    )
    angle = np.linspace(0.0, 2.0 * np.pi * turns, 400)
    r = radius + 0.5 * thick + rng.uniform(-2e-6, 2e-5)
    around = np.column_stack([r * np.cos(angle), 1.5 * thick * angle / (2.0 * np.pi), r * np.sin(angle)])
    tails = np.linspace(1.0, 0.0, 60)[:-1, None] * rng.uniform(2e-3, 1e-2)
    begin, end = around[0] - around[1], around[-1] - around[-2]
    points = np.vstack([
        around[0] + tails * begin / np.linalg.norm(begin), around, around[-1] + tails[::-1] * end / np.linalg.norm(end),
    ])  # fmt: skip
    at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    n = int(np.clip(at[-1] / (1.3 * thick), 12, 90))
    even = np.linspace(0.0, at[-1], n + 1)
    points = np.stack([np.interp(even, at, points[:, a]) for a in range(3)], axis=1)
    post = body(0, Cylinder(radius, 0.05), (0.0, 0.0, 0.0), 1e-2 if movable else 0.0, friction=1.0, R=ALONG_Y)
    bench = Bench([post])
    thread = from_material(points, thick, 1e7, 1100.0, gravity=(0, 0, 0), straight=False, friction=friction)
    mass = thread.mass.copy()
    mass[[0, -1]] = WEIGHT
    thread = replace(thread, mass=mass, compliance=np.full(n - 1, at[-1] / n / 4000.0))
    rod = bench.add(damped(thread, 0.99))
    load = 10.0 ** rng.uniform(-3, -0.5)
    rod.set_gravity(0, tuple(load / WEIGHT * begin / np.linalg.norm(begin)))
    rod.set_gravity(n - 1, tuple(load * rng.uniform(0.05, 1.0) / WEIGHT * end / np.linalg.norm(end)))
    bench.step(int(rng.integers(0, 20)))
    for element in range(1, n - 1):
        rod.set_gravity(element, tuple(rng.normal(scale=20.0, size=3)))
    return bench, rod


def step_carefully(bench: Bench, rod: Rod) -> tuple[int, bool, Touches]:
    """A careful step of the rod: its solves, whether it converged, and its contacts."""
    arrays, touches, owner = rod._arrays, rod._touches[1], int(rod._owner[0])
    rod.meet(bench.colliders, bench.colliders.update(bench, rod.box()), bench)
    for row, node in rod._met:
        rod.nodes.x[node], rod.nodes.q[node] = rod._motion[row, :3], rod._motion[row, 3:7]
        rod.nodes.v[node], rod.nodes.w[node] = rod._motion[row, 7:10], rod._motion[row, 10:]
    begin_passages(rod._passages, owner)
    begin_springs(rod.springs, rod.nodes)
    elements, total = len(rod.description.mass), len(rod.nodes.mass)
    touches.count[0] = 0
    detect(
        rod.first, elements, rod.nodes, rod.shapes, rod._touches[0], touches, arrays.work, rod.tension, arrays.counts,
        rod.self_skip, DT,
    )  # fmt: skip
    solves, settled = advance_carefully(
        len(rod.joints.load) + 1, total, rod.nodes, rod.joints, touches, arrays.work, rod._passages, owner,
        rod.springs, float(arrays.constants.stiffness[0]), DT, True, DT,
    )  # fmt: skip
    return solves, settled, touches


def imbalance(rod: Rod, touches: Touches) -> tuple[Array, Array]:
    """What is left of the equations (N, 6) of the nodes and (n - 1, 6) of the joints, as they were linearised last."""
    work, nodes = rod._arrays.work, rod.nodes
    left, gap = np.zeros((len(nodes.mass), 6)), work.c.copy()
    for i in np.flatnonzero(nodes.met & ~nodes.fixed):
        low = np.tril(work.own_matrix[i])
        left[i] = (low + np.tril(low, -1).T) @ work.taken[i] - work.own_load[i]
    for j in range(len(work.c)):
        for side, sign in ((0, 1.0), (1, -1.0)):
            X = np.eye(6)
            X[:3, 3:], X[3:, 3:] = -cross_matrix(work.lever[j, side]), -work.B[j]
            gap[j] += sign * X @ work.taken[j + side]
            left[j + side] -= sign * X.T @ rod.joints.load[j]
        gap[j] += work.compliance[j] * rod.joints.load[j]
    for c in range(touches.count[0]):
        for side, sign in ((0, DT * DT), (1, -DT * DT)):
            i, f = touches.node[c, side], touches.force[c]
            left[i] -= sign * np.r_[f, np.cross(work.arms[c, side], f)]
    left[nodes.fixed | ~nodes.met] = 0.0
    return left, gap


def motion(rod: Rod, touches: Touches, c: int) -> Array:
    """Displacement (3,) of contact ``c`` by the last linearised step."""
    work, u = rod._arrays.work, np.zeros(3)
    for side, sign in ((0, 1.0), (1, -1.0)):
        i = touches.node[c, side]
        if not rod.nodes.fixed[i]:
            d = work.taken[i]
            u += sign * (d[:3] + np.cross(d[3:], work.arms[c, side]))
    return u


threads = given(
    seed=st.integers(0, 2**32 - 1), movable=st.booleans(), friction=st.sampled_from([0.0, 0.1, 0.3, 0.6]),
)  # fmt: skip


@settings(max_examples=50, deadline=None)
@threads
def test_forces_of_a_careful_step_follow_the_laws_of_contact_and_friction(
    seed: int, movable: bool, friction: float
) -> None:
    bench, rod = thread_on_a_post(seed, movable, friction)
    _, settled, touches = step_carefully(bench, rod)
    assume(settled)
    stiffness, count = float(rod._arrays.constants.stiffness[0]), int(touches.count[0])
    scale = max(float(np.abs(touches.force[:count]).max(initial=0.0)), 1e-9)
    for c in range(count):
        n, u, force = touches.normal[c], motion(rod, touches, c), touches.force[c]
        press = force @ n
        room = touches.room[c] + u @ n
        assert press == pytest.approx(stiffness * max(-room, 0.0), abs=3e-3 * scale)
        slip = touches.begun[c] + u - (u @ n) * n
        along, limit = force - press * n, touches.friction[c] * max(press, 0.0)
        error = 2.0 * UNCHANGED * limit + 3e-3 * scale
        assert np.linalg.norm(along) <= limit + error
        # A bristle as far as it bears, then the limit against the slip.
        bristle = stiffness * np.linalg.norm(slip)
        expected = -slip * (stiffness if bristle <= limit else limit / np.linalg.norm(slip))
        np.testing.assert_allclose(along, expected, rtol=0.0, atol=error)


@settings(max_examples=50, deadline=None)
@threads
def test_forces_of_a_careful_step_balance_inertia_and_joints(seed: int, movable: bool, friction: float) -> None:
    bench, rod = thread_on_a_post(seed, movable, friction)
    _, settled, touches = step_carefully(bench, rod)
    assume(settled)
    left, gap = imbalance(rod, touches)
    scale = DT * DT * max(float(np.abs(touches.force[: touches.count[0]]).max(initial=0.0)), 1e-3)
    assert np.abs(left[: len(gap) + 1, :3]).max() < 1e-6 * scale
    # A body is coupled by conjugate gradients; the impulse that it gets is the thread's in any case.
    assert np.abs(left[len(gap) + 1 :, :3]).max() < 0.05 * scale
    assert np.abs(gap[:, :3]).max() < 1e-9


def test_careful_steps_converge_for_nearly_all_threads() -> None:
    ends = [step_carefully(*thread_on_a_post(seed, bool(seed % 2), (0.1, 0.3, 0.6)[seed % 3])) for seed in range(100)]
    # What does not converge in a whole tick is divided by `run_tick`.
    assert sum(settled for _, settled, _ in ends) >= 90
    assert np.median([solves for solves, _, _ in ends]) < 40


@settings(max_examples=50, deadline=None)
@given(
    n=st.integers(10, 60), thick=st.floats(0.2e-3, 1e-3), friction=st.floats(0.05, 1.0), speed=st.floats(0.05, 5.0)
)  # fmt: skip
def test_contacts_that_all_lift_off_do_not_keep_a_careful_step_busy(
    n: int, thick: float, friction: float, speed: float
) -> None:
    """Friction limits that are halved again and again never become nothing: such steps took all 150 solves."""
    points = np.column_stack([np.linspace(0.0, 2.0 * thick * n, n + 1), np.zeros(n + 1), np.full(n + 1, 0.49 * thick)])
    bench = Bench([body(0, Box((1.0, 1.0, 0.02)), (0.0, 0.0, -0.01), friction=1.0)])
    rod = bench.add(from_material(points, thick, 1e7, 1100.0, gravity=(0, 0, -9.81), friction=friction))
    bench.step(3)
    assume(rod._touches[0].press[: rod._touches[0].count[0]].any())
    rod.nodes.v[rod.first : rod.first + n] = 0.0, 0.0, speed
    solves, settled, touches = step_carefully(bench, rod)
    assert touches.press[: touches.count[0]].max() < 1e-9
    assert settled
    assert solves <= 15
