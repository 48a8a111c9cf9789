"""The arrays of rigid bodies on the surface of tissue; axes are those of the block, SI units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.tables import opener
from ligature.tissue.layout import MOST_POINTS

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

CAPACITY = 256
"""Most points of contact of a block with bodies: those of a plate on 15 by 15 cells."""


class Touching(NamedTuple):
    """K points of contact of a block."""

    used: Integers  # (K,)
    part: Integers  # (K,) or -1 for a pin
    face: Integers  # (K,)
    point: Integers  # (K,) of the interface
    body: Integers  # (K,) row of `Partners`
    normal: Array  # (K, 3) from the body into the tissue; zero for a pin
    distance: Array  # (K,) between point and part when the tick begins
    anchor: Array  # (K, 3) of friction, in the inertial frame of the body; where a pin holds
    force: Array  # (K, 3) on the tissue
    friction: Array  # (K,) Coulomb coefficient
    soft: Array  # (K,) compliance along the normal, m/N


class Partners(NamedTuple):
    """B bodies; row 0 is the block's own rigid body, the last row the world that pins belong to."""

    R: Array  # (B, 3, 3) of the inertial frame
    centre: Array  # (B, 3)
    twist: Array  # (B, 6) relative to the block, linear part at the centre of mass
    light: Array  # (B,) 1 / kg; 0 for what no force moves
    spin: Array  # (B, 3, 3) inverse of the inertia
    friction: Array  # (B,) coefficient with the block
    tip: Array  # (B, 3) of a needle that punctures; infinite for other bodies
    push: Array  # (B, 6) force and moment of the block on it in this tick


class Parts(NamedTuple):
    """P convex parts of bodies."""

    body: Integers  # (P,) row of `Partners`
    still: Flags  # (P,) of a body without mass, which moves by commands alone
    local: Array  # (P, 4, 4) in the inertial frame of the body
    kind: Integers  # (P,) as in `ligature.mesh.distance`
    size: Array  # (P, 3)
    planes: Array  # (Q, 4)
    plane_range: Integers  # (P, 2)
    middle: Array  # (P, 3) of its box, in its own frame
    half: Array  # (P, 3) size of that
    live: Flags  # (P,) looked at in this tick
    R: Array  # (P, 3, 3) where it is in this tick
    centre: Array  # (P, 3)
    known: Flags  # (P,) was looked at when faces near what stands were looked for


class Solve(NamedTuple):
    """Scratch of a tick."""

    rows: Integers  # (K,)
    w: Array  # (K, 3)
    u: Array  # (K, 3)
    lever: Array  # (K, 3) from the body's centre of mass
    own: Array  # (K, 3) from the centre of mass of the block's own body
    D: Array  # (K, K, 3, 3)
    own_point: Flags  # (N,) points of the interface that are these
    change: Array  # (N, 3) forces on the points without those of bodies, over those of the last step
    found: Integers  # (F, 2) part and face; of parts that stand first
    standing: Integers  # (2,) how many were found of these, and `Field.found` then
    values: Array  # (F, 6) distance, normal towards the tissue, place on the face
    order: Integers  # (F,) the nearest first
    known: Flags  # (K,) points of contact that were not found yet
    vectors: Array  # (5, 3)
    weights: Array  # (4,)


class Contacts(NamedTuple):
    """All that a tick of the bodies at one block works on."""

    touching: Touching
    partners: Partners
    parts: Parts
    solve: Solve
    overflow: Integers  # (1,) points of contact for which there was no room


def touching(capacity: int = CAPACITY) -> Touching:
    """Room for ``capacity`` points of contact, none yet."""
    K, z = capacity, np.zeros
    i = lambda: np.zeros(K, np.int64)  # noqa: E731
    return Touching(i(), i(), i(), i(), i(), z((K, 3)), z(K), z((K, 3)), z((K, 3)), z(K), z(K))


def partners(bodies: int) -> Partners:
    """``bodies`` that nothing moves, and no needles."""
    B, z = bodies, np.zeros
    return Partners(z((B, 3, 3)), z((B, 3)), z((B, 6)), z(B), z((B, 3, 3)), z(B), np.full((B, 3), np.inf), z((B, 6)))


def parts(number: int, planes: int) -> Parts:
    """Room for ``number`` parts with ``planes`` in all."""
    P, z = number, np.zeros
    return Parts(
        np.zeros(P, np.int64), np.zeros(P, np.bool_), z((P, 4, 4)), np.zeros(P, np.int64), z((P, 3)), z((planes, 4)),
        np.zeros((P, 2), np.int64), z((P, 3)), z((P, 3)), np.zeros(P, np.bool_), z((P, 3, 3)), z((P, 3)),
        np.zeros(P, np.bool_),
    )  # fmt: skip


def scratch(points: int = MOST_POINTS, capacity: int = CAPACITY) -> Solve:
    """Scratch for ``capacity`` points of contact among ``points`` of the interface."""
    K, F, z = capacity, 4 * capacity, np.zeros
    return Solve(
        np.zeros(K, np.int64), z((K, 3)), z((K, 3)), z((K, 3)), z((K, 3)), z((K, K, 3, 3)), np.zeros(points, np.bool_),
        z((points, 3)), np.zeros((F, 2), np.int64), np.zeros(2, np.int64), z((F, 6)), np.zeros(F, np.int64),
        np.zeros(K, np.bool_), z((5, 3)), z(4),
    )  # fmt: skip


open_contacts = opener(Contacts(touching(1), partners(1), parts(1, 1), scratch(1, 1), np.zeros(1, np.int64)))
