"""Rigid bodies that touch the surface of a body of tissue: tools, needles' shafts, what lies on it; SI units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse, matrix_quaternion, quaternion_matrix
from ligature.model.scene import Scene
from ligature.soft.frame import Frame
from ligature.soft.needle import ScenePiercer
from ligature.suture.bodies import SutureBodies
from ligature.suture.colliders import shape_arrays
from ligature.tissue import contact
from ligature.tissue.block import TissueBlock

Array = NDArray[np.float64]

FINE = 0.1e-3
"""How exact the place of a point of contact is found, m."""

REACH = 1.5e-3
"""Distance in metres at which a point of contact is let go."""

MEET = 0.5e-3
"""Distance in metres at which one begins, beside what the body moves in a tick."""

DEEPER = 0.2e-3
"""Depth in metres by which another place of a face must be deeper for the point of contact to move there."""

MAX_APPROACH = 1.0
"""Speed in m/s of bodies between two looks at them."""

MAX_WAIT = 64
"""Most ticks between two looks."""

RECOVERY = 4e-5
"""Depth in metres out of which a body is pushed in a tick."""

SWEEPS = 12
"""Sweeps of projected Gauss–Seidel in a tick, from the forces of the last one."""

TIP = 4e-3
"""Length of a needle from its tip, m, that does not touch the surface as a body, for it punctures it."""


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
        self._piercers = {p.body.index: p for p in piercers}
        n = len(self.listed) + 1
        self._partners = contact.Partners(np.zeros((n, 7)), np.zeros((n, 6)), np.zeros(n), np.zeros((n, 3, 3)))
        self._partners.pose[:, 6] = 1.0
        self._parts, self._radius = self._gather(scene)
        self._touching, self._work = contact.touching(), contact.scratch(len(block.interface.points.status))
        grid, fixed = block.elastic.grid, block.elastic.row < 0
        self._looked_at = ~fixed[grid.faces].all(axis=1)
        self._found = np.zeros((4 * contact.CAPACITY, 2), np.int64)
        self._values = np.zeros((4 * contact.CAPACITY, 6))
        self._scratch = np.zeros((15, 3))
        self._due = np.zeros(len(self.listed), np.int64)
        own_body = scene.bodies[own]
        self._own_free = not own_body.static and any(
            [link.body for link in tree.links] == [own] for tree in scene.articulations
        )
        self.overflow = False

    def _gather(self, scene: Scene) -> tuple[contact.Parts, Array]:
        """The parts of all bodies, and the radius of each about its centre of mass."""
        body, local, kind, size, planes, corners = [], [], [], [], [], []
        radius = np.zeros(len(self.listed))
        for row, index in enumerate(self.listed):
            to_inertial = inverse(scene.bodies[index].T_body_inertial)
            for part in scene.bodies[index].colliders:
                shape_kind, shape_size, shape_planes, box = shape_arrays(part.shape)
                T = to_inertial @ part.T_body_shape
                body.append(row + 1)
                local.append(T)
                kind.append(shape_kind)
                size.append(shape_size)
                planes.append(shape_planes)
                corners.append(box)
                far = np.abs(box).max(axis=0)
                radius[row] = max(radius[row], float(np.linalg.norm(T[:3, 3]) + np.linalg.norm(far)))
        ends = np.cumsum([0] + [len(p) for p in planes])
        n = len(body)
        parts = contact.Parts(
            np.array(body, dtype=np.int64), np.array(local).reshape(n, 4, 4), np.array(kind, dtype=np.int64),
            np.array(size).reshape(n, 3), np.vstack(planes) if planes else np.zeros((0, 4)),
            np.column_stack([ends[:-1], ends[1:]]).astype(np.int64), np.array(corners).reshape(n, 2, 3),
            np.zeros(n, dtype=np.bool_),
        )  # fmt: skip
        return parts, radius

    # --- the tick -----------------------------------------------------------------------------

    def step(self, frame: Frame, box: Array) -> None:
        """Find points of contact and push tissue and bodies; ``box`` (2, 3) surrounds the tissue in B."""
        used = self._touching.used.astype(bool)
        live = self._look(frame, box, used)
        if not live and not used.any():
            return
        self._place_own(frame)
        block, points = self._block, self._block.interface.points
        contact.measure_contacts(self._touching, points, self._parts, self._partners, self._scratch)
        count = contact.find_contacts(
            block.elastic.x, block.elastic.grid.faces, self._looked_at, self._parts, self._partners, REACH, FINE,
            self._found, self._values, self._scratch,
        )  # fmt: skip
        self._match(count)
        n = contact.press(
            self._touching, self._work, points, self._partners, block.interface.fraction, self._dt, SWEEPS, RECOVERY
        )
        if n:
            self._push(frame)

    def _look(self, frame: Frame, box: Array, used: NDArray[np.bool_]) -> bool:
        """Read the motion of the bodies that are near; whether any is."""
        middle, half = 0.5 * (box[0] + box[1]), 0.5 * float(np.linalg.norm(box[1] - box[0]))
        kept = set(self._touching.body[used].tolist())
        self._parts.live[:] = False
        any_live = False
        for k, index in enumerate(self.listed):
            if self._due[k] > 0 and k + 1 not in kept:
                self._due[k] -= 1
                continue
            pose, twist = self._bodies.motion(index)
            centre = frame.into(pose[:3])
            gap = float(np.linalg.norm(centre - middle)) - half - float(self._radius[k]) - REACH
            if gap > 0.0 and k + 1 not in kept:
                self._due[k] = min(int(gap / (MAX_APPROACH * self._dt)), MAX_WAIT)
                continue
            any_live = True
            self._place(k + 1, index, frame, pose, twist, centre)
            piercer = self._piercers.get(index)
            if piercer is None or not piercer.engaged:
                self._parts.live[self._parts.body == k + 1] = True
        return any_live

    def _place(self, row: int, index: int, frame: Frame, pose: Array, twist: Array, centre: Array) -> None:
        p = self._partners
        R = frame.R.T @ quaternion_matrix(pose[3:])
        p.pose[row, :3], p.pose[row, 3:] = centre, matrix_quaternion(R)
        p.twist[row, :3], p.twist[row, 3:] = frame.R.T @ twist[:3], frame.R.T @ twist[3:]
        if frame.moves:
            p.twist[row] -= frame.drift(centre, 1.0)
        if self._scene.bodies[index].static or self._bodies.driven(index):
            p.light[row], p.spin[row] = 0.0, 0.0
        else:
            mass, inertia = self._bodies.masses.mass_of(index)
            p.light[row] = 1.0 / mass
            p.spin[row] = (R / inertia) @ R.T

    def _place_own(self, frame: Frame) -> None:
        """The tissue's own rigid body recoils where nothing but gravity holds it."""
        p = self._partners
        if self._own_free and not self._bodies.driven(self._own):
            pose, _ = self._bodies.motion(self._own)
            mass, inertia = self._bodies.masses.mass_of(self._own)
            R = frame.R.T @ quaternion_matrix(pose[3:])
            p.pose[0, :3], p.light[0], p.spin[0] = frame.into(pose[:3]), 1.0 / mass, (R / inertia) @ R.T
        else:
            p.pose[0, :3], p.light[0], p.spin[0] = 0.0, 0.0, 0.0

    def _match(self, count: int) -> None:
        """Keep, begin, move and end points of contact after what was found."""
        t, dt = self._touching, self._dt
        known = {(int(t.part[r]), int(t.face[r])): r for r in np.flatnonzero(t.used).tolist()}
        order = np.argsort(self._values[:count, 0], kind="stable").tolist()
        for i in order:
            part, face = self._found[i].tolist()
            distance, normal = float(self._values[i, 0]), self._values[i, 1:4]
            weights = contact.face_weights(*self._values[i, 4:].tolist())
            row = known.pop((part, face), -1)
            if row >= 0:
                if distance < t.distance[row] - DEEPER:
                    self._move(row, face, weights, distance, normal)
                continue
            body = int(self._parts.body[part])
            closing = float(normal @ self._partners.twist[body, :3])
            if distance <= MEET + max(closing, 0.0) * dt:
                self._begin(part, face, weights, body, distance, normal)
        for row in known.values():
            self._end(row)

    def _begin(self, part: int, face: int, weights: Array, body: int, distance: float, normal: Array) -> None:
        t, grid = self._touching, self._block.elastic.grid
        piercer = self._piercers.get(self.listed[body - 1])
        if piercer is not None:
            at = weights @ self._block.elastic.x[grid.faces[face]]
            if ((at - piercer.tip) ** 2).sum() < TIP**2:
                return
        free = np.flatnonzero(t.used == 0)
        if not len(free) or not self._block.has_room():
            self.overflow = True
            return
        row = int(free[0])
        t.used[row], t.part[row], t.face[row], t.body[row] = 1, part, face, body
        t.point[row] = self._block.interface.add(grid.faces[face], weights)
        t.force[row] = 0.0
        own = self._scene.bodies[self._own].friction
        t.friction[row] = own * self._scene.bodies[self.listed[body - 1]].friction
        self._anchor(row, distance, normal)

    def _move(self, row: int, face: int, weights: Array, distance: float, normal: Array) -> None:
        """Move a point of contact to a deeper place of its face."""
        interface = self._block.interface
        i, p = int(self._touching.point[row]), interface.points
        interface.place(i, self._block.elastic.grid.faces[face], weights)
        p.at[i] = p.start[i] + (interface.tick / interface.ticks) * p.move[i]
        self._anchor(row, distance, normal)

    def _anchor(self, row: int, distance: float, normal: Array) -> None:
        """Let friction go on from where the point is, with the force that it has."""
        t, pose = self._touching, self._partners.pose[self._touching.body[row]]
        t.distance[row], t.normal[row] = distance, normal
        rubbing = t.force[row] - (t.force[row] @ normal) * normal
        at = self._block.interface.points.at[t.point[row]] + contact.SOFT * rubbing
        t.anchor[row] = quaternion_matrix(pose[3:]).T @ (at - pose[:3])

    def _end(self, row: int) -> None:
        self._block.interface.release(int(self._touching.point[row]))
        self._touching.used[row] = 0
        self._touching.force[row] = 0.0

    def _push(self, frame: Frame) -> None:
        """Push the bodies by what the tissue does to them."""
        t = self._touching
        rows = np.flatnonzero(t.used)
        for body in np.unique(t.body[rows]).tolist():
            mine = rows[t.body[rows] == body]
            forces = -t.force[mine]
            if not forces.any():
                continue
            x, y, z = (self._block.interface.points.at[t.point[mine]] - self._partners.pose[body, :3]).T
            fx, fy, fz = forces.T
            moments = np.array([(y * fz - z * fy).sum(), (z * fx - x * fz).sum(), (x * fy - y * fx).sum()])
            impulse = self._dt * (frame.R @ forces.sum(axis=0))
            moment = self._dt * (frame.R @ moments)
            self._bodies.apply_impulse(self.listed[body - 1], impulse, moment)

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
        self._due[:] = 0

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        rows = {name: array.copy() for name, array in zip(self._touching._fields, self._touching, strict=True)}
        return {"touching": rows, "due": self._due.copy()}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        for name, array in zip(self._touching._fields, self._touching, strict=True):
            array[:] = snapshot["touching"][name]
        self._due[:] = snapshot["due"]
