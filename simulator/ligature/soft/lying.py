"""A thread that lies on soft tissue: springs at its elements that are below the surface; SI units.

A spring pushes an element out along the normal of the face it lies on, with a friction that grows with its speed up to
Coulomb's limit. Points of contact would cost a row of the tissue's compliance for every element, at every place that
it slides to. So the surface moves on as it did in the last tissue step, and what the thread does to it
moves it in the next one; no impulse is lost, and springs softer than the tissue keep that stable.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.soft.frame import Frame, FrameArrays, into, open_frame, velocity_at
from ligature.suture.rod import Rod
from ligature.suture.rotations import cross, rotate, rotate_back
from ligature.suture.springs import Springs, open_springs
from ligature.suture.tracking import open_nodes
from ligature.tables import opener, table_of
from ligature.tissue.block import TissueBlock
from ligature.tissue.layout import SHEAR, Field, open_tissue

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

STIFFNESS = 3.0
"""Stiffness of a spring over the shear modulus and the length of its element: about that of the tissue below."""

DEEPEST = 3e-3
"""Depth in metres below which an element is in the tissue, not on it."""

CREEP = 2e-3
"""Speed in m/s below which friction is in proportion to speed."""

BESIDE = 0.05
"""How far beside a face, in edges, an element still lies on it."""


class Lying(NamedTuple):
    """The E elements of a rod at a body of tissue."""

    face: Integers  # (E,) on which an element lies, -1 for none
    within: Integers  # (E,) 1 for those that a path holds
    row: Integers  # (E,) of the rod's springs, -1 for none
    weights: Array  # (E, 4) of the face's corners
    stiffness: Array  # (layers,) of a spring, N/m
    wrench: Array  # (6,) on the tissue about the origin of its frame, in W
    place: Array  # (6,) scratch: normal of a face, distance from it, and place on it


def _lying(elements: int, layers: int) -> Lying:
    i = lambda: np.full(elements, -1, np.int64)  # noqa: E731
    return Lying(i(), i(), i(), np.zeros((elements, 4)), np.zeros(layers), np.zeros(6), np.zeros(6))


open_lying = opener(_lying(1, 1))


class LyingThread:
    """One rod on one body of tissue.

    Parameters
    ----------
    friction
        Coulomb coefficient of the tissue's surface; that of the thread multiplies it.
    """

    def __init__(self, rod: Rod, block: TissueBlock, friction: float) -> None:
        self.rod, self._block = rod, block
        d = rod.description
        self._arrays = _lying(len(d.mass), len(block.elastic.materials))
        length = float(np.linalg.norm(d.ends[:, 1] - d.ends[:, 0], axis=1).mean())
        self._arrays.stiffness[:] = STIFFNESS * length * block.interface.field.material[:, SHEAR]
        self._friction = friction * float(d.friction.mean())
        self._tables = (block.interface.table, table_of(self._arrays), table_of(rod.nodes), rod.spring_table)

    @property
    def wrench(self) -> Array:
        """Force and moment (6,) on the tissue in this tick, about the origin of its frame, in W."""
        return self._arrays.wrench

    def begin(self, frame: Frame, within: list[int], dt: float) -> None:
        """Hand the rod springs for its elements on the surface; those ``within`` are in a path."""
        self._arrays.within[:] = 0
        self._arrays.within[within] = 1
        lie(*self._tables, frame.table, self._block.elastic.v, self.rod.first, self._friction, dt)

    def end(self, frame: Frame, dt: float) -> None:
        """Push the tissue back."""
        press_back(*self._tables, frame.table, self._block.pushed, dt)

    def reset(self) -> None:
        """As at the start."""
        self._arrays.face[:] = -1
        self._arrays.wrench[:] = 0.0

    def snapshot(self) -> Integers:
        """What lasts from tick to tick: the faces."""
        return self._arrays.face.copy()

    def restore(self, snapshot: Integers) -> None:
        """Continue from `snapshot`."""
        self._arrays.face[:] = snapshot


@inlined
def _see(field: Field, q: int, x: float, y: float, z: float, place: Array) -> None:
    """Fill ``place`` with the outward normal of a face, the height of a point over it, and where it is along it."""
    i, j, k, m = field.faces[q, 0], field.faces[q, 1], field.faces[q, 2], field.faces[q, 3]
    X = field.x
    ax, ay, az = X[k, 0] - X[i, 0], X[k, 1] - X[i, 1], X[k, 2] - X[i, 2]
    bx, by, bz = X[m, 0] - X[j, 0], X[m, 1] - X[j, 1], X[m, 2] - X[j, 2]
    nx, ny, nz = cross(ax, ay, az, bx, by, bz)
    size = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
    nx, ny, nz = nx / size, ny / size, nz / size
    x -= 0.25 * (X[i, 0] + X[j, 0] + X[k, 0] + X[m, 0])
    y -= 0.25 * (X[i, 1] + X[j, 1] + X[k, 1] + X[m, 1])
    z -= 0.25 * (X[i, 2] + X[j, 2] + X[k, 2] + X[m, 2])
    # Along the mean edges, from corner 0 to 1 and from 0 to 3.
    ux, uy, uz = 0.5 * (ax - bx), 0.5 * (ay - by), 0.5 * (az - bz)
    vx, vy, vz = 0.5 * (ax + bx), 0.5 * (ay + by), 0.5 * (az + bz)
    place[0], place[1], place[2] = nx, ny, nz
    place[3] = nx * x + ny * y + nz * z
    place[4] = 0.5 + (ux * x + uy * y + uz * z) / max(ux * ux + uy * uy + uz * uz, 1e-12)
    place[5] = 0.5 + (vx * x + vy * y + vz * z) / max(vx * vx + vy * vy + vz * vz, 1e-12)


@inlined
def _is_over(place: Array, radius: float) -> bool:
    """Whether what `_see` has seen lies on the face."""
    u, v = place[4], place[5]
    return -DEEPEST < place[3] < radius and -BESIDE < u < 1.0 + BESIDE and -BESIDE < v < 1.0 + BESIDE


@inlined
def _find_face(field: Field, x: float, y: float, z: float, radius: float, place: Array) -> int:
    """The face that a point lies on, the nearest of those that it is below; -1 for none."""
    best, found = -DEEPEST, -1
    for q in range(field.faces.shape[0]):
        low, high = field.face_box[q, 0], field.face_box[q, 1]
        if x < low[0] - DEEPEST or x > high[0] + DEEPEST or y < low[1] - DEEPEST or y > high[1] + DEEPEST:
            continue
        if z < low[2] - DEEPEST or z > high[2] + DEEPEST:
            continue
        _see(field, q, x, y, z, place)
        if place[3] > best and _is_over(place, radius):
            best, found = place[3], q
    return found


@inlined
def _make_spring(
    s: Springs, row: int, f: FrameArrays, k: float, c: float, depth: float, place: Array, vx: float, vy: float,
    vz: float,
) -> None:  # fmt: skip
    """A spring k along the normal, c across it, against a surface that moves by (vx, vy, vz) in the tick."""
    nx, ny, nz = rotate(f.R, place[0], place[1], place[2])
    vx, vy, vz = rotate(f.R, vx, vy, vz)
    K, load = s.K[row], s.load[row]
    for a in range(6):
        load[a] = 0.0
        for b in range(6):
            K[a, b] = 0.0
    K[0, 0], K[1, 1], K[2, 2] = c + (k - c) * nx * nx, c + (k - c) * ny * ny, c + (k - c) * nz * nz
    K[0, 1], K[0, 2], K[1, 2] = (k - c) * nx * ny, (k - c) * nx * nz, (k - c) * ny * nz
    K[1, 0], K[2, 0], K[2, 1] = K[0, 1], K[0, 2], K[1, 2]
    load[0] = k * depth * nx + K[0, 0] * vx + K[0, 1] * vy + K[0, 2] * vz
    load[1] = k * depth * ny + K[1, 0] * vx + K[1, 1] * vy + K[1, 2] * vz
    load[2] = k * depth * nz + K[2, 0] * vx + K[2, 1] * vy + K[2, 2] * vz


@kernel
def lie(
    tissue: Integers, lying: Integers, nodes_: Integers, springs: Integers, frame: Integers, v: Array, first: int,
    friction: float, dt: float,
) -> None:  # fmt: skip
    """Find the elements on the surface as a tick begins, and make springs of them; the nodes move by ``v`` (n, 3)."""
    t, own, nodes, s, f = (
        open_tissue(tissue), open_lying(lying), open_nodes(nodes_), open_springs(springs), open_frame(frame),
    )  # fmt: skip
    field, place = t.field, own.place
    clock, ticks = field.clock[0], field.clock[1]
    for e in range(own.face.shape[0]):
        i = first + e
        own.row[e] = -1
        x, y, z = into(f, nodes.x[i, 0], nodes.x[i, 1], nodes.x[i, 2])
        radius, box = nodes.radius[i], field.box
        away = x < box[0, 0] or y < box[0, 1] or z < box[0, 2] or x > box[1, 0] or y > box[1, 1]
        if away or z > box[1, 2] + radius or own.within[e]:
            own.face[e] = -1
            continue
        if own.face[e] >= 0:
            _see(field, own.face[e], x, y, z, place)
        # Faces are looked through once a tissue step, those of one element after the other's.
        if (clock + e) % ticks == 0 or (own.face[e] >= 0 and not _is_over(place, radius)):
            own.face[e] = _find_face(field, x, y, z, radius, place)
            if own.face[e] >= 0:
                _see(field, own.face[e], x, y, z, place)
        q = own.face[e]
        if q < 0 or s.filled[0] == s.node.shape[0]:
            continue
        u, w = min(max(place[4], 0.0), 1.0), min(max(place[5], 0.0), 1.0)
        weights = own.weights[e]
        weights[0], weights[1], weights[2], weights[3] = (1 - u) * (1 - w), u * (1 - w), u * w, (1 - u) * w
        vx, vy, vz = velocity_at(f, x, y, z)
        depth = radius - place[3]
        for c in range(4):
            n = field.faces[q, c]
            vx, vy, vz = vx + weights[c] * v[n, 0], vy + weights[c] * v[n, 1], vz + weights[c] * v[n, 2]
            # How far the surface has come since the step began.
            moved = place[0] * v[n, 0] + place[1] * v[n, 1] + place[2] * v[n, 2]
            depth += weights[c] * clock * dt * moved
        if depth <= 0.0:
            continue
        k = own.stiffness[field.layer[field.face_cell[q]]]
        rx, ry, rz = rotate_back(f.R, nodes.v[i, 0], nodes.v[i, 1], nodes.v[i, 2])
        rx, ry, rz = rx - vx, ry - vy, rz - vz
        along = rx * place[0] + ry * place[1] + rz * place[2]
        speed = math.sqrt(max(rx * rx + ry * ry + rz * rz - along * along, 0.0))
        row = s.filled[0]
        s.filled[0], s.node[row], own.row[e] = row + 1, i, row
        _make_spring(
            s, row, f, k, friction * k * depth / (dt * max(speed, CREEP)), depth, place, dt * vx, dt * vy, dt * vz
        )


@kernel
def press_back(
    tissue: Integers, lying: Integers, nodes_: Integers, springs: Integers, frame: Integers, pushed: Array, dt: float
) -> None:
    """Add what the springs did in this tick to the forces on the nodes of the tissue."""
    t, own, nodes, s, f = (
        open_tissue(tissue), open_lying(lying), open_nodes(nodes_), open_springs(springs), open_frame(frame),
    )  # fmt: skip
    for a in range(6):
        own.wrench[a] = 0.0
    for e in range(own.row.shape[0]):
        row = own.row[e]
        if row < 0:
            continue
        J, i = s.impulse[row], s.node[row]
        x, y, z = -J[0] / dt, -J[1] / dt, -J[2] / dt
        lx, ly, lz = nodes.x[i, 0] - f.p[0], nodes.x[i, 1] - f.p[1], nodes.x[i, 2] - f.p[2]
        mx, my, mz = cross(lx, ly, lz, x, y, z)
        w = own.wrench
        w[0], w[1], w[2], w[3], w[4], w[5] = w[0] + x, w[1] + y, w[2] + z, w[3] + mx, w[4] + my, w[5] + mz
        x, y, z = rotate_back(f.R, x, y, z)
        for c in range(4):
            n, part = t.field.faces[own.face[e], c], own.weights[e, c]
            pushed[n, 0], pushed[n, 1], pushed[n, 2] = (
                pushed[n, 0] + part * x, pushed[n, 1] + part * y, pushed[n, 2] + part * z,
            )  # fmt: skip
