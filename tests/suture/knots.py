"""Knots to lay into threads; `ligature.tasks.knots` tells them apart."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

Array = NDArray[np.float64]

LEFT_HALF = [
    (-1.6, -30, 1), (-1.6, -8, 2), (-1.6, -4, 2), (-1.6, -1.2, 2.5), (-1.6, 0.9, 1.5), (-1.2, 2.6, 2.3),
    (0, 3.2, 2.5), (1.2, 2.6, 2.3), (1.6, 0.9, 1.5), (1.6, -1.2, 2.5), (1.6, -3, 1.5),
]  # fmt: skip
RIGHT_HALF = [
    (0.7, 3.0, 1.3), (0.75, 1.8, 2.3), (1.6, 0.9, 2.8), (2.8, 0.2, 2.2), (2.9, -0.8, 1.6), (1.6, -1.2, 1.3),
    (0, -1.3, 1.3), (-1.6, -1.2, 1.3), (-2.9, -0.8, 1.6), (-2.8, 0.2, 2.2), (-1.6, 0.9, 2.8), (-0.75, 1.8, 2.3),
    (-0.7, 3.0, 1.3), (-0.7, 4.5, 1.4), (-1.0, 8, 2), (-1.6, 30, 1),
]  # fmt: skip
"""Two bights through each other, in twice the thickness of the thread: a square knot, once a loop joins them below."""

BELOW = [(1.0, -3.5, -2.0), (0.8, 0.0, -4.0), (0.7, 3.2, -2.0)]
"""The loop."""


def square_knot() -> Array:
    """A loose square knot in an open thread (n, 3), for a thread 0.8 thick; its ends part along y."""
    corners = np.array([*LEFT_HALF, *BELOW, *RIGHT_HALF], dtype=float)
    at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(corners, axis=0), axis=1))]
    return np.asarray(PchipInterpolator(at, corners)(np.linspace(0.0, at[-1], 1500)))


def wound(around: int, waves: int, lifts: int, hand: int = 1) -> Array:
    """A knot wound ``around`` a ring, cut open at its outside (n, 3), its ends parting along y.

    Meanwhile it waves in and out, and up and down so often; ``hand`` -1 is the mirror image. (2, 3, 3) is a trefoil,
    (2, 5, 5) the knot of five crossings on a torus, (3, 2, 4) the figure of eight.
    """
    t = np.linspace(0.0, 2.0 * np.pi, 1200)
    # The end passes inside the beginning where they were one.
    r = 2.0 + np.cos(waves * t) + 0.9 * np.exp(-((t / 0.5) ** 2))
    knot = np.column_stack([r * np.cos(around * t), r * np.sin(around * t), hand * np.sin(lifts * t)])
    away = np.linspace(6.0, 0.1, 60)[:, None] * [0.0, 1.0, 0.0]
    return np.vstack([knot[0] - away, knot, knot[-1] + away[::-1]])


def wander(rng: np.random.Generator) -> Array:
    """A random curve (n, 3), knotted or not, whose ends part along y.

    They lead out of it: a curve that ends among its own loops has no knot, as these slip off its end.
    """
    u = np.linspace(0.0, 1.0, 1500)
    points = np.column_stack([np.zeros_like(u), 10.0 * (u - 0.5), np.zeros_like(u)])
    for k in range(1, 5):
        points += np.sin(np.pi * k * u)[:, None] * rng.normal(scale=4.0 / k**0.5, size=3)
    low, high = points[:, 1].min() - 1.0, points[:, 1].max() + 1.0
    away = np.linspace(1.0, 0.0, 60)[:-1, None] * [0.0, 1.0, 0.0]
    return np.vstack([
        points[0] - (points[0, 1] - low) * away, points, points[-1] + (high - points[-1, 1]) * away[::-1],
    ])  # fmt: skip


def room(points: Array) -> float:
    """Distance of strands of a curve (n, 3) that are far from each other along it, where they are nearest."""
    at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    some = slice(None, None, max(1, len(points) // 400))
    p, s = points[some], at[some]
    d = np.linalg.norm(p[:, None] - p[None], axis=2)
    apart = np.abs(s[:, None] - s[None])
    return float(d[apart > 1.8 * np.maximum(d, 1e-12)].min(initial=np.inf))
