"""Wrenches that contacts and held constraints exert on bodies, read back from Bullet; world axes, newtons, metres.

Bullet reports a contact's friction in the order of its own pair, whatever order it was asked in; the
handedness of the three directions of a contact shows which order that was.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.frames import pose7_matrix

Array = NDArray[np.float64]


def contact_wrench(
    client: int, uid: int, links: Collection[int], own: Collection[tuple[int, int]], point: Array
) -> Array:
    """Wrench (6,) about ``point`` (3,) on the ``links`` of one multibody, from contacts of the last tick.

    ``own`` are the (multibody, link) pairs whose contacts with these links are inner ones and do not count.
    """
    found = pybullet.getContactPoints(bodyA=uid, physicsClientId=client)
    rows = [c for c in found if c[3] in links and (c[2], c[4]) not in own]
    wrench = np.zeros(6)
    if not rows:
        return wrench
    on_body, force = np.array([c[5] for c in rows]), contact_forces(rows)
    wrench[:3] = force.sum(axis=0)
    wrench[3:] = np.cross(on_body - point, force).sum(axis=0)
    return wrench


def contact_forces(rows: Sequence[Any]) -> Array:
    """Forces (n, 3) on the first body of each of Bullet's contact points, pressure and friction."""
    normal, first, second = (np.array([c[k] for c in rows]) for k in (7, 11, 13))
    press, along_first, along_second = np.array([(c[9], c[10], c[12]) for c in rows]).T[..., None]
    order = np.sign(np.sum(np.cross(normal, first) * second, axis=1))[:, None]
    forces: Array = press * normal + order * (along_first * first + along_second * second)
    return forces


def fixed_wrench(client: int, constraint: int, pose: Array, T_parent_frame: Array, point: Array) -> Array:
    """Wrench (6,) about ``point`` (3,) of a fixed constraint on its parent in the last tick.

    ``pose`` (7,) is the parent's inertial frame, ``T_parent_frame`` (4, 4) the constraint's frame in it. Bullet
    gives the force in world axes and the moment in those of the frame.
    """
    state = np.array(pybullet.getConstraintState(constraint, physicsClientId=client))
    T = pose7_matrix(pose) @ T_parent_frame
    return about(np.concatenate([state[:3], T[:3, :3] @ state[3:]]), T[:3, 3], point)


def about(wrench: Array, origin: Array, point: Array) -> Array:
    """``wrench`` (6,) given about ``origin`` (3,), as seen about ``point`` (3,)."""
    (fx, fy, fz, mx, my, mz), (x, y, z) = wrench.tolist(), (origin - point).tolist()  # np.cross takes ten times as long
    return np.array([fx, fy, fz, mx + (y * fz - z * fy), my + (z * fx - x * fz), mz + (x * fy - y * fx)])
