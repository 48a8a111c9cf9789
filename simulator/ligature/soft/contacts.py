"""Rigid bodies that touch the surface of a body of tissue: tools, needles' shafts, what lies on it; SI units."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.model.frames import inverse
from ligature.model.scene import Scene
from ligature.rotations import matrix_of, rotate, rotate_back
from ligature.soft.frame import Frame, FrameArrays, into, open_frame, velocity_at
from ligature.soft.needle import ScenePiercer
from ligature.suture.bodies import SutureBodies
from ligature.suture.colliders import shape_arrays
from ligature.tables import opener, table_of
from ligature.tissue import contact_arrays as arrays
from ligature.tissue.block import TissueBlock
from ligature.tissue.contact import SOFT, touch
from ligature.tissue.contact_arrays import Contacts, open_contacts
from ligature.tissue.contact_search import REACH
from ligature.tissue.layout import open_tissue

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

MAX_APPROACH = 1.0
"""Speed in m/s of bodies between two looks at them."""

MAX_WAIT = 64
"""Most ticks between two looks."""


class Around(NamedTuple):
    """B bodies around a block, in world axes; row 0 is the block's own rigid body."""

    body: Integers  # (B,) in the scene
    light: Array  # (B,) 1 / kg
    moments: Array  # (B, 3) principal
    radius: Array  # (B,) of its parts about the centre of mass
    due: Integers  # (B,) ticks until it is looked at
    kept: Flags  # (B,) touches the tissue
    inside: Flags  # (B,) a needle that is in the tissue
    read: Integers  # (B,) rows that are looked at in this tick
    wanted: Integers  # (B,) the bodies of these rows, and the block's own after them
    motion: Array  # (B + 1, 13) their poses (7,) and twists (6,), and in the last row those of the world
    pushed: Integers  # (B,) rows that the tissue pushes
    turn: Array  # (2, 3, 3) scratch


def _around(bodies: list[int]) -> Around:
    B, z = len(bodies), np.zeros
    i = lambda: np.zeros(B, np.int64)  # noqa: E731
    motion = z((B + 1, 13))
    motion[B, 6] = 1.0
    return Around(
        np.array(bodies, dtype=np.int64), z(B), np.ones((B, 3)), z(B), i(), np.zeros(B, np.bool_),
        np.zeros(B, np.bool_), i(), i(), motion, i(), z((2, 3, 3)),
    )  # fmt: skip


open_around = opener(_around([0]))


class BodyContacts:
    """The bodies of a scene at one body of tissue.

    Parameters
    ----------
    own
        Index of the tissue's rigid body.
    piercers
        Its needles: what is in the tissue does not touch it as a body too.
    """

    def __init__(
        self, scene: Scene, own: int, block: TissueBlock, bodies: SutureBodies, piercers: list[ScenePiercer], dt: float
    ) -> None:
        self._scene, self._own, self._block, self._bodies, self._dt = scene, own, block, bodies, dt
        excluded = scene.bodies[own].no_collision_with | {own}
        placed = {link.body for tree in scene.articulations for link in tree.links} - excluded
        self.listed = [b.index for b in scene.bodies if b.colliders and b.index in placed]
        self._piercers = [(self.listed.index(p.body.index) + 1, p) for p in piercers if p.body.index in self.listed]
        self._around = _around([own, *self.listed])
        self._static = [True, *(scene.bodies[b].static for b in self.listed)]
        self._contacts = Contacts(
            arrays.touching(), arrays.partners(len(self.listed) + 2), self._gather(scene),
            arrays.scratch(), np.zeros(1, np.int64),
        )  # fmt: skip
        self._touching = self._contacts.touching
        self._contacts.partners.friction[1:-1] = [
            scene.bodies[own].friction * scene.bodies[b].friction for b in self.listed
        ]
        self._tables = (block.interface.table, table_of(self._contacts), table_of(self._around))
        own_body = scene.bodies[own]
        assert own_body.tissue is not None
        self._pins = own_body.tissue.pins
        self._pinned = len(self._pins.nodes) > 0
        self._pin()
        self._own_free = not own_body.static and any(
            [link.body for link in tree.links] == [own] for tree in scene.articulations
        )

    @property
    def overflow(self) -> bool:
        """Whether there was no room for a point of contact."""
        return bool(self._contacts.overflow[0])

    def _gather(self, scene: Scene) -> arrays.Parts:
        """The parts of all bodies; their radius about the centre of mass goes to `Around`."""
        rows = [
            (row + 1, inverse(scene.bodies[index].T_body_inertial) @ part.T_body_shape, *shape_arrays(part.shape))
            for row, index in enumerate(self.listed)
            for part in scene.bodies[index].colliders
        ]
        ends = np.cumsum([0, *(len(planes) for _, _, _, _, planes, _ in rows)])
        parts = arrays.parts(len(rows), int(ends[-1]))
        for k, (body, T, kind, size, planes, box) in enumerate(rows):
            parts.body[k], parts.local[k], parts.kind[k], parts.size[k] = body, T, kind, size
            parts.still[k] = self._static[body]
            parts.plane_range[k] = ends[k], ends[k + 1]
            parts.planes[ends[k] : ends[k + 1]] = planes
            parts.middle[k], parts.half[k] = 0.5 * (box[0] + box[1]), 0.5 * (box[1] - box[0])
            reach = float(np.linalg.norm(T[:3, 3]) + np.linalg.norm(np.abs(box).max(axis=0)))
            self._around.radius[body] = max(self._around.radius[body], reach)
        return parts

    def _pin(self) -> None:
        """Fix the points of pins at their initial places."""
        t, T = self._touching, self._scene.bodies[self._own].T_world_body
        for row, (nodes, weights) in enumerate(zip(self._pins.nodes, self._pins.weights, strict=True)):
            t.used[row], t.part[row], t.body[row], t.soft[row] = 1, -1, len(self.listed) + 1, SOFT
            t.point[row] = self._block.interface.add(nodes, weights)
            t.anchor[row] = T[:3, :3] @ (weights @ self._block.elastic.grid.nodes[nodes]) + T[:3, 3]

    # --- the tick -----------------------------------------------------------------------------

    def step(self, frame: Frame) -> None:
        """Find points of contact and push tissue and bodies."""
        tissue, contacts, around = self._tables
        count = choose(contacts, around)
        if not count and not self._pinned:
            return
        self._read(count)
        pushed = meet(tissue, contacts, around, frame.table, count, self._pinned, self._dt)
        if pushed:
            self._push(self._around.pushed[:pushed].tolist())

    def _read(self, count: int) -> None:
        """Read motions and inverse masses of the bodies near the tissue."""
        around, bodies = self._around, self._bodies
        for row, piercer in self._piercers:
            self._contacts.partners.tip[row], around.inside[row] = piercer.tip, piercer.engaged
        bodies.read_motions(around.wanted[: count + 1], around.motion[: count + 1])
        for row in around.read[:count].tolist():
            if not self._static[row]:
                self._read_mass(row, self.listed[row - 1])
        # The tissue's own rigid body recoils where nothing but gravity holds it.
        if self._own_free:
            self._read_mass(0, self._own)

    def _read_mass(self, row: int, body: int) -> None:
        mass, self._around.moments[row] = self._bodies.masses.mass_of(body)
        self._around.light[row] = 0.0 if self._bodies.driven(body) else 1.0 / mass

    def _push(self, rows: list[int]) -> None:
        """Apply the impulses of the tissue to the bodies."""
        push = self._contacts.partners.push
        for row in rows:
            impulse, body = self._dt * push[row], self.listed[row - 1] if row else self._own
            if row or not self._scene.bodies[body].static:
                self._bodies.apply_impulse(body, impulse[:3], impulse[3:])

    # --- state --------------------------------------------------------------------------------

    @property
    def forces(self) -> list[tuple[int, Array]]:
        """Bodies that touch the tissue, and the force (3,) of each on it in B."""
        t = self._touching
        rows = np.flatnonzero(t.used)
        return [
            (self.listed[b - 1], t.force[rows[t.body[rows] == b]].sum(axis=0)) for b in np.unique(t.body[rows]).tolist()
        ]

    def reset(self) -> None:
        """As at the start: nothing touches the tissue."""
        for array in self._touching:
            array[:] = 0
        self._around.due[:] = 0
        self._pin()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        rows = {name: array.copy() for name, array in zip(self._touching._fields, self._touching, strict=True)}
        return {"touching": rows, "due": self._around.due.copy()}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for name, array in zip(self._touching._fields, self._touching, strict=True):
            array[:] = snapshot["touching"][name]
        self._around.due[:] = snapshot["due"]


@kernel
def choose(contact_table: Integers, around_table: Integers) -> int:
    """How many bodies are to be looked at in this tick; ``Around.read`` has their rows."""
    touching, around = open_contacts(contact_table).touching, open_around(around_table)
    for b in range(around.kept.shape[0]):
        around.kept[b] = False
    for r in range(touching.used.shape[0]):
        if touching.used[r] and touching.part[r] >= 0:
            around.kept[touching.body[r]] = True
    count = 0
    for b in range(1, around.due.shape[0]):
        if around.due[b] > 0 and not around.kept[b]:
            around.due[b] -= 1
        else:
            around.read[count], around.wanted[count] = b, around.body[b]
            count += 1
    around.wanted[count] = around.body[0]
    return count


@kernel
def meet(
    tissue: Integers, contact_table: Integers, around_table: Integers, frame_table: Integers, count: int, pinned: bool,
    dt: float,
) -> int:  # fmt: skip
    """A tick of the bodies that were read: how many the tissue pushes, by `Partners.push` in world axes."""
    t, contacts, around, f = (
        open_tissue(tissue), open_contacts(contact_table), open_around(around_table), open_frame(frame_table),
    )  # fmt: skip
    parts, partners, field = contacts.parts, contacts.partners, t.field
    mx, my, mz = _middle(field.box, 0), _middle(field.box, 1), _middle(field.box, 2)
    hx, hy, hz = field.box[1, 0] - mx, field.box[1, 1] - my, field.box[1, 2] - mz
    half = math.sqrt(hx * hx + hy * hy + hz * hz)
    for c in range(parts.live.shape[0]):
        parts.live[c] = False
    near = pinned
    for k in range(count):
        b, m = around.read[k], around.motion[k]
        x, y, z = into(f, m[0], m[1], m[2])
        gap = math.sqrt((x - mx) ** 2 + (y - my) ** 2 + (z - mz) ** 2) - half - around.radius[b] - REACH
        if gap > 0.0 and not around.kept[b]:
            around.due[b] = min(int(gap / (MAX_APPROACH * dt)), MAX_WAIT)
            continue
        near = True
        _place(contacts, around, f, b, m)
        if not around.inside[b]:
            for c in range(parts.live.shape[0]):
                if parts.body[c] == b:
                    parts.live[c] = True
    if not near:
        return 0
    if around.light[0] > 0.0:
        _place(contacts, around, f, 0, around.motion[count])
    else:
        partners.light[0] = 0.0
    if pinned:
        world = around.motion[around.motion.shape[0] - 1]
        _place(contacts, around, f, partners.R.shape[0] - 1, world)
    if not touch(field, t.points, contacts, dt):
        return 0
    pushed = 0
    for b in range(around.kept.shape[0]):
        p, any_ = partners.push[b], False
        p[0], p[1], p[2] = rotate(f.R, p[0], p[1], p[2])
        p[3], p[4], p[5] = rotate(f.R, p[3], p[4], p[5])
        for a in range(6):
            any_ = any_ or p[a] != 0.0
        if any_:
            around.pushed[pushed] = b
            pushed += 1
    return pushed


@inlined
def _middle(box: Array, a: int) -> float:
    return 0.5 * (box[0, a] + box[1, a])


@inlined
def _place(contacts: Contacts, around: Around, f: FrameArrays, b: int, motion: Array) -> None:
    """Where a body with pose and twist ``motion`` (13,) is and how it moves, in the frame of the tissue."""
    partners, pose, twist = contacts.partners, motion[:7], motion[7:]
    Q, R, c, v = around.turn[0], partners.R[b], partners.centre[b], partners.twist[b]
    matrix_of(pose[3], pose[4], pose[5], pose[6], Q)
    for i in range(3):
        for j in range(3):
            R[i, j] = f.R[0, i] * Q[0, j] + f.R[1, i] * Q[1, j] + f.R[2, i] * Q[2, j]
    c[0], c[1], c[2] = into(f, pose[0], pose[1], pose[2])
    v[0], v[1], v[2] = rotate_back(f.R, twist[0], twist[1], twist[2])
    v[3], v[4], v[5] = rotate_back(f.R, twist[3], twist[4], twist[5])
    x, y, z = velocity_at(f, c[0], c[1], c[2])
    v[0], v[1], v[2] = v[0] - x, v[1] - y, v[2] - z
    v[3], v[4], v[5] = v[3] - f.w[0], v[4] - f.w[1], v[5] - f.w[2]
    partners.light[b] = around.light[b] if b < around.light.shape[0] else 0.0
    if partners.light[b] > 0.0:
        m = around.moments[b]
        for i in range(3):
            for j in range(3):
                total = 0.0
                for k in range(3):
                    total += R[i, k] / m[k] * R[j, k]
                partners.spin[b, i, j] = total
