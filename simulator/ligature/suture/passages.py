"""Arrays of the passages of needles and rods through tissue holes, grouped for compiled code; SI units, world axes.

A path is the centre line that passes through tissue: the arc of a needle, or a rod. A passage is one path in one hole.
Its entry marks a puncture: a point and three axes fixed in the hole's body, tangent first, then the normal of
the arc, then outwards. The deviation of the path from them, in those axes, is the stretch (6): displacement
along and across, then rotation of the path's axes at the hole. A needle that follows its arc turns and
slides at once, and its axes at the hole stay: so the rotation about the normal counts less ``bend``
(the arc's curvature) times the displacement along. Poses are of inertial frames I.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

CAPACITY = 64
"""Most passages of a scene at one time."""


class Passages(NamedTuple):
    """C passages, of which the first ``filled`` count."""

    filled: Integers  # (1,)
    hole: Integers  # (C,)
    path: Integers  # (C,) needles come first, then rods
    owner: Integers  # (C,) the rod in whose solve the path moves, -1 for a needle without a rod
    node: Integers  # (C,) of that rod
    element: Integers  # (C,) of the rod; 0 for a needle
    point: Array  # (C, 3) puncture in I of the hole's body
    frame: Array  # (C, 3, 3) axes in I of the hole's body, in columns
    anchor: Array  # (C,) depth at which friction is unloaded, from the path's end
    depth: Array  # (C,) length of the path beyond the hole
    x: Array  # (C, 3) of the node at the start of the tick
    q: Array  # (C, 4)
    axes: Array  # (C, 3, 3) of the path at the hole, in columns
    bend: Array  # (C,) curvature of the path, 1/m
    lever: Array  # (C, 3) from the node's centre to the hole
    stretch: Array  # (C, 6) at the start of the tick
    stiffness: Array  # (C, 6)
    damping: Array  # (C, 6)
    limit: Array  # (C, 6) of the elastic load; beyond it the puncture moves
    mode: Integers  # (C, 6) a `FrictionMode` each
    switches: Integers  # (C,) of modes in this tick
    secant: Array  # (C, 6) stiffness in use
    bias: Array  # (C, 6) load in use at no stretch
    recoil: Array  # (C, 6, 6) motion of the hole for a unit of impulse, in ``axes``
    drift: Array  # (C, 6) velocity of the hole, in ``axes``
    K: Array  # (C, 6, 6) stiffness at the node
    load: Array  # (C, 6) at the start of the tick
    force: Array  # (C, 6) on the path, in ``axes``
    impulse: Array  # (C, 6) of the tick on the path, about the node's centre
    J: Array  # (6, 6) scratch
    T: Array  # (6, 6) scratch
    d: Array  # (6,) scratch
    A: Array  # (3, 3) scratch
    B: Array  # (3, 3) scratch


class Sites(NamedTuple):
    """H holes."""

    pose: Array  # (H, 7) of the hole's body
    twist: Array  # (H, 6)
    R: Array  # (H, 3, 3) of the hole in I, z through it
    origin: Array  # (H, 3)
    half: Array  # (H, 2)
    recoil: Array  # (H, 6, 6) of the body about its centre
    shared: Integers  # (H,) passages in it


class Paths(NamedTuple):
    """L paths, of which needles come first; arcs are those of `ligature.model.piercing`."""

    pose: Array  # (L, 7)
    centre: Array  # (L, 3)
    x: Array  # (L, 3)
    y: Array  # (L, 3)
    radius: Array  # (L,)
    begin: Array  # (L,)
    end: Array  # (L,)
    owner: Integers  # (L,)
    node: Integers  # (L,)
    stiffness: Array  # (L, H, 6)
    damping: Array  # (L, H, 6)
    limit: Array  # (L, H, 6)


def passages(capacity: int = CAPACITY) -> Passages:
    """Arrays for ``capacity`` passages, none yet."""
    C, z = capacity, np.zeros
    i: dict[str, Any] = {
        name: np.zeros(C, np.int64) for name in ("hole", "path", "owner", "node", "element", "switches")
    }
    six: dict[str, Any] = {name: z((C, 6)) for name in SIX_ROWS}
    return Passages(
        filled=np.zeros(1, np.int64), point=z((C, 3)), frame=z((C, 3, 3)), anchor=z(C), depth=z(C),
        x=z((C, 3)), q=z((C, 4)), axes=z((C, 3, 3)), bend=z(C), lever=z((C, 3)), mode=np.zeros((C, 6), np.int64),
        recoil=z((C, 6, 6)), K=z((C, 6, 6)), J=z((6, 6)), T=z((6, 6)), d=z(6), A=z((3, 3)),
        B=z((3, 3)), **i, **six,
    )  # fmt: skip


SIX_ROWS = ("stretch", "stiffness", "damping", "limit", "secant", "bias", "drift", "load", "force", "impulse")

NOT_ROWS = ("filled", "J", "T", "d", "A", "B")
"""Arrays of `Passages` that are not one row a passage."""

ROWS = tuple(name for name in Passages._fields if name not in NOT_ROWS)
"""Arrays of `Passages` with one row a passage."""


def sites(n: int) -> Sites:
    """Arrays for ``n`` holes."""
    z = np.zeros
    return Sites(
        pose=z((n, 7)), twist=z((n, 6)), R=z((n, 3, 3)), origin=z((n, 3)), half=z((n, 2)), recoil=z((n, 6, 6)),
        shared=np.zeros(n, np.int64),
    )  # fmt: skip


def paths(n: int, holes: int) -> Paths:
    """Arrays for ``n`` paths among ``holes`` holes."""
    z = np.zeros
    law = [z((n, holes, 6)) for _ in range(3)]
    return Paths(
        z((n, 7)), z((n, 3)), z((n, 3)), z((n, 3)), np.ones(n), z(n), z(n), np.full(n, -1), np.zeros(n, np.int64), *law
    )
