"""A thread on the surface of soft tissue, against statics and Coulomb's law."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

G, TOP, ELEMENTS = 9.8, 0.105, 30
INNER = np.array([0.026, 0.016])
"""Half the size of the top, m, without its rim."""


class Laid:
    """A pad of silicone and a thread of 50 mm that lies on it at rest, along x."""

    def __init__(self, kit) -> None:
        thread = kit.THREAD.replace("  parent: BODY Needle\n", "").replace("length: 0.1", "length: 0.05")
        thread = thread.partition("  location:")[0].replace("elements: 50", f"elements: {ELEMENTS}")
        where = "{position: {x: -0.025, y: 0.003, z: 0.106}, orientation: {r: 0, p: 1.570796327, y: 0}}"
        self.simulation = kit.run(kit.pad(), f"{thread}  location: {where}\n")
        self.piece = self.simulation.tissues.pieces[0]
        self.rod = self.simulation._suture.rods.rods[0]
        self.mass = self.rod.description.mass
        pad = self.simulation.scene.bodies[self.piece.tissue.body]
        self.friction = pad.friction * float(self.rod.description.friction[0])
        self.simulation.step(300)
        self._start = self.simulation.snapshot()

    def begin(self) -> None:
        self.simulation.restore(self._start)
        self.fall([0.0, 0.0, -G])

    def fall(self, acceleration, elements=None) -> None:
        for e in range(ELEMENTS) if elements is None else elements:
            self.rod.set_gravity(e, acceleration)

    @property
    def heights(self):
        return self.rod.positions[:, 2] - TOP

    @property
    def force(self):
        """On the thread in the last tick, N."""
        return np.sum([f for _, f in self.piece.lying[0].forces], axis=0)

    @property
    def speed(self):
        return float(np.abs(self.rod.twists[:, :3]).max())


@pytest.fixture(scope="module")
def laid(tmp_path_factory):
    from tests.soft import conftest as kit

    class Kit:
        THREAD, pad = kit.THREAD, staticmethod(kit.pad)

        @staticmethod
        def run(*blocks):
            return kit.Simulation(kit.load(tmp_path_factory.mktemp("laid"), *blocks))

    return Laid(Kit)


def test_a_thread_lies_on_tissue_with_its_weight(laid):
    laid.begin()
    laid.simulation.step(100)
    assert laid.force == pytest.approx([0.0, 0.0, laid.mass.sum() * G], abs=1e-4 * laid.mass.sum() * G)
    assert laid.piece.wrench[:3] == pytest.approx(-laid.force, abs=1e-15)
    radius = laid.rod.description.radius[0]
    assert laid.heights == pytest.approx(np.full(ELEMENTS, radius), abs=0.1 * radius)
    assert laid.speed < 1e-6


@given(share=st.floats(0.0, 0.9), way=st.floats(-np.pi, np.pi))
@settings(max_examples=8)
def test_friction_holds_a_thread_that_is_pulled_by_less(laid, share, way):
    laid.begin()
    before, pull = laid.rod.positions.copy(), share * laid.friction * G
    laid.fall([pull * np.cos(way), pull * np.sin(way), -G])
    laid.simulation.step(100)
    assert np.abs(laid.rod.positions - before).max() < 1e-4


@given(share=st.floats(1.4, 4.0), away=st.sampled_from([-1.0, 1.0]))
@settings(max_examples=8)
def test_a_thread_that_is_pulled_by_more_slips_as_coulomb_says(laid, share, away):
    laid.begin()
    laid.fall([0.0, away * share * laid.friction * G, -G])
    laid.simulation.step(20)
    before = laid.rod.twists[:, 1].mean()
    laid.simulation.step(20)
    gained = away * (laid.rod.twists[:, 1].mean() - before)
    assert gained == pytest.approx((share - 1.0) * laid.friction * G * 0.02, rel=0.12)


@given(
    yaw=st.floats(-0.3, 0.3),
    tilt=st.floats(-0.15, 0.15),
    height=st.floats(1e-4, 0.01),
    speed=st.tuples(st.floats(-0.1, 0.1), st.floats(-0.05, 0.05), st.floats(-0.5, 0.0)),
)
@settings(max_examples=10)
def test_a_thread_that_falls_comes_to_rest_on_the_surface(laid, yaw, tilt, height, speed):
    laid.begin()
    poses, turn = np.hstack([laid.rod.positions, laid.rod.orientations]), Rotation.from_euler("zy", [yaw, tilt])
    middle = poses[:, :3].mean(axis=0)
    poses[:, :3] = turn.apply(poses[:, :3] - middle) + [0.0, 0.0, TOP]
    poses[:, 2] += height + TOP - poses[:, 2].min() + laid.rod.description.radius[0]
    poses[:, 3:] = (turn * Rotation.from_quat(poses[:, 3:])).as_quat()
    laid.rod.set_motion(poses, np.tile([*speed, 0.0, 0.0, 0.0], (ELEMENTS, 1)))
    for _ in range(60):
        laid.simulation.step(10)
        within = (np.abs(laid.rod.positions[:, :2]) < INNER).all(axis=1)
        assert laid.heights[within].min(initial=0.0) > -5e-4
    assert within.any()
    assert laid.heights[within].min() > 0.0
    assert laid.speed < 1e-3


@given(load=st.floats(0.01, 0.4), first=st.integers(3, ELEMENTS - 6))
@settings(max_examples=6)
def test_a_thread_that_is_pressed_cuts_in_by_less_than_a_millimetre(laid, load, first):
    laid.begin()
    few = range(first, first + 3)
    for part in np.linspace(0.0, 1.0, 100):
        laid.fall([0.0, 0.0, -G - part * load / laid.mass[first : first + 3].sum()], few)
        laid.simulation.step(2)
    laid.simulation.step(100)
    assert laid.force[2] == pytest.approx(load + laid.mass.sum() * G, rel=1e-3)
    assert laid.heights.min() > -1e-3
    assert np.abs(laid.rod.twists[first : first + 3, 2]).max() < 1e-3  # ends that stand up may still swing


@given(ticks=st.integers(1, 30))
@settings(max_examples=3)
def test_a_snapshot_of_a_thread_that_slips_goes_on_to_the_bit(laid, ticks):
    laid.begin()
    pull = [3.0 * laid.friction * G, 0.0, -G]
    laid.fall(pull)
    laid.simulation.step(ticks)
    kept = laid.simulation.snapshot()
    laid.simulation.step(40)
    once = laid.simulation.state_hash()
    laid.simulation.restore(kept)
    laid.fall(pull)
    laid.simulation.step(40)
    assert laid.simulation.state_hash() == once
