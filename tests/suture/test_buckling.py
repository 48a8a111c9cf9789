"""A twisted ring leaves its plane where Michell states."""

from __future__ import annotations

import numpy as np
import pytest
from ligature.model.frames import pose7_matrix


def _ring(n, radius):
    """Points of a closed ring, its ends meeting at the bottom."""
    angle = np.linspace(-np.pi / 2, 3 * np.pi / 2, n + 1)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), np.zeros(n + 1)], axis=1)


def test_ring_twisted_slowly_leaves_its_plane_at_michells_twist(kit):
    """Michell 1890; Goriely, Twisted elastic rings and the rediscoveries of Michell's instability, 2006:
    the critical twist is 2 pi sqrt(3) times the ratio of bending to twisting stiffness.
    """
    n, radius, poisson = 60, 0.02, 0.4
    description = kit.from_material(_ring(n, radius), 1e-3, 1e8, 1100.0, gravity=(0, 0, 0), poisson_ratio=poisson)
    rod = kit.Bench([]).add(kit.damped(description, 1 - 1e-6))
    rod.hold_element(0)
    rod.hold_element(n - 1)
    axis = pose7_matrix(np.r_[0, 0, 0, rod.orientations[-1]])[:3, 2]
    disturbance = 1e-3 * np.sin(2 * np.linspace(0, 2 * np.pi, n))[1:-1]
    turned = 0.0
    while np.abs(rod.positions[:, 2]).max() < 0.1 * radius:
        assert turned < 4.0, "the ring never left its plane"
        rate = 2.0 if turned < 2.0 else 0.2
        twists = rod.twists
        twists[0] = 0.0
        twists[-1] = np.r_[0.0, 0.0, 0.0, 2 * np.pi * rate * axis]
        twists[1:-1, 2] += disturbance * kit.DT / 0.1
        rod.set_motion(np.hstack([rod.positions, rod.orientations]), twists)
        rod.step()
        turned += rate * kit.DT
    # E I / (G J) of a round rod is 1 + Poisson's ratio.
    assert turned == pytest.approx(np.sqrt(3.0) * (1.0 + poisson), rel=0.10)
