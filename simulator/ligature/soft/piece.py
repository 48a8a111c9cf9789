"""One body of tissue among needles, threads and rigid bodies, in the frame of its own rigid body; SI units."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.model.frames import inverse
from ligature.model.scene import Scene
from ligature.model.soft import TissueBody
from ligature.model.state import MAX_INSERTIONS, MAX_PUNCTURES, StateRecord
from ligature.rotations import cross, rotate
from ligature.soft.contacts import BodyContacts
from ligature.soft.floating import Floating
from ligature.soft.frame import Frame, open_frame
from ligature.soft.lying import LyingThread
from ligature.soft.needle import ScenePiercer
from ligature.soft.thread import SceneThread
from ligature.suture.bodies import SutureBodies
from ligature.suture.rod import Rod
from ligature.tissue.block import TissueBlock
from ligature.tissue.layout import open_tissue

Array = NDArray[np.float64]
Integers = NDArray[np.int64]


TICKS, FREE_TICKS = 4, 1
"""Ticks of a tissue step; in four of them tissue that nothing holds would sink into what it hits before it yields."""


class Piece:
    """A running body of tissue.

    Parameters
    ----------
    scene, tissue
        The scene, and which of its bodies of tissue.
    bodies
        The rigid bodies.
    rods
        The running rods; needles on a thread move by their solve.
    dt
        Length of a tick, s.
    """

    def __init__(self, scene: Scene, tissue: TissueBody, bodies: SutureBodies, rods: list[Rod], dt: float) -> None:
        form, self.tissue, self._bodies, self._dt = tissue.form, tissue, bodies, dt
        self._body = scene.bodies[tissue.body]
        ticks = TICKS if form.fixed.any() else FREE_TICKS
        self.block = TissueBlock(form.grid, form.materials, form.fixed, dt=dt, ticks=ticks)
        self.frame = Frame(self._body)
        carrier = {a.body: rod for rod in rods for a in rod.description.attachments}
        self.piercers = [
            ScenePiercer(scene, needle, self.block, carrier.get(needle.body), dt) for needle in scene.needles
        ]
        self._carried = [p for p in self.piercers if p.rod is not None]
        self._alone = [p for p in self.piercers if p.rod is None]
        self.threads = [SceneThread(p.rod, p, self.block, self.frame) for p in self._carried if p.rod is not None]
        self._sewn = [SceneThread(rod, None, self.block, self.frame) for rod in rods if self._is_stitched(rod)]
        self.threads += self._sewn
        self.lying = [self._lay(rod) for rod in rods]
        self.contacts = BodyContacts(scene, tissue.body, self.block, bodies, self.piercers, dt)
        self._floating = Floating(self._body, self.block) if self.block.elastic.floats else None
        self.wrench, self.peak = np.zeros(6), np.zeros(1)
        self._index, self._motion = np.array([tissue.body]), np.zeros((1, 13))
        self._read()
        self.frame.restart()
        self._sew()

    def _is_stitched(self, rod: Rod) -> bool:
        """Whether a rod without a needle starts in the tissue."""
        if any(thread.rod is rod for thread in self.threads):
            return False
        T = inverse(self._body.T_world_body)
        places = (T @ start for start in rod.description.T_world_inertial)
        return any(self.block.contains(np.ascontiguousarray(place[:3, 3])) for place in places)

    def _sew(self) -> None:
        """Have the threads that start in the tissue pass through it."""
        for thread in self._sewn:
            thread.sew(self.block, self._body.T_world_body)

    def _lay(self, rod: Rod) -> LyingThread:
        """The rod on the surface of the tissue."""
        inside = next((thread for thread in self.threads if thread.rod is rod), None)
        return LyingThread(rod, self.block, self.frame, self._body.friction, inside)

    def _read(self) -> None:
        self._bodies.read_motions(self._index, self._motion)
        self.frame.read(self._motion[0, :7], self._motion[0, 7:])

    # --- the tick -----------------------------------------------------------------------------

    def begin(self) -> None:
        """What comes before the rods' own step: bodies push the tissue, rods get its springs."""
        self._read()
        self.contacts.step(self.frame)
        for piercer in self._carried:
            piercer.begin(self._bodies, self.frame)
        for thread in self.threads:
            thread.begin(self._dt)
        for lying in self.lying:
            lying.begin(self._dt)

    def end(self) -> None:
        """What comes after: forces of needles and threads, the reaction on the rigid body, the tissue's own motion."""
        for piercer in self._carried:
            piercer.end(self.frame)
        for thread in self.threads:
            thread.end(self._dt)
        for lying in self.lying:
            lying.end(self._dt)
        for piercer in self._alone:
            piercer.couple(self._bodies, self.frame)
        self._react()
        frame, block = self.frame, self.block
        moves = block.interface.tick + 1 == block.interface.ticks
        if self._floating is not None:
            self._floating.step(frame, moves, self._bodies)
            return
        if moves:
            frame.end_step(block.elastic.h)
            block.elastic.gravity[:] = (self._body.gravity - frame.acceleration) @ frame.R
        block.step()

    def _react(self) -> None:
        """Add up what acts on the tissue; its rigid body moves by that."""
        add_up(self.block.interface.table, self.frame.table, self.wrench, self.peak)
        if self._body.static or not self.wrench.any():
            return
        centre = self._bodies.motion(self._body.index)[0][:3] - self.frame.p
        moment = self.wrench[3:] - np.cross(centre, self.wrench[:3])
        self._bodies.apply_impulse(self._body.index, self._dt * self.wrench[:3], self._dt * moment)

    # --- state --------------------------------------------------------------------------------

    def write_state(self, state: StateRecord) -> None:
        """Write nodes, forces, punctures and insertions."""
        self._read()
        R, p, k = self.frame.R, self.frame.p, self.tissue.index
        state["tissue_node"][0, self.tissue.rows] = self.block.positions @ R.T + p
        state["tissue_wrench"][0, k], state["tissue_peak"][0, k] = self.wrench, self.peak[0]
        self._write_punctures(state, k)
        self._write_insertions(state, k, R, p)

    def _write_punctures(self, state: StateRecord, k: int) -> None:
        paths, place = self.block.paths, np.zeros((2, 3))
        count = 0
        point, normal = state["puncture_point"][0, k], state["puncture_normal"][0, k]
        for path in np.flatnonzero(paths.count).tolist():
            ends = [0, int(paths.count[path]) - 1] if np.isfinite(paths.length[path]) else [0]
            for end in ends[: MAX_PUNCTURES - count]:
                see_puncture(self.block.interface.table, self.frame.table, int(paths.node[path, end]), place)
                point[count], normal[count] = place
                count += 1
        point[count:] = 0.0
        normal[count:] = 0.0
        state["puncture_count"][0, k] = count

    def _write_insertions(self, state: StateRecord, k: int, R: Array, p: Array) -> None:
        points, paths = self.block.interface.points, self.block.paths
        rows: list[tuple[int, float, Array, Array]] = []
        for piercer in self.piercers:
            if piercer.engaged:
                entry = piercer.inside.first_point
                rows.append((piercer.body.index, piercer.inside.depth, points.at[entry], piercer.wrench[:3]))
        for thread in self.threads:
            for path in np.flatnonzero(paths.count).tolist():
                nodes = paths.node[path, : paths.count[path]]
                nodes = nodes[thread.inside.engaged[nodes] == 1]
                if len(nodes):
                    segment = thread.inside.segment_of(int(nodes[0]))
                    body = thread.rod.description.bodies[thread.element(segment)]
                    force = -R @ points.force[nodes].sum(axis=0)
                    rows.append((body, float(thread.inside.shares[nodes].sum()), points.at[nodes[0]], force))
        for body, depth, at, force in rows:
            row = int(state["insertion_count"][0])
            if row == MAX_INSERTIONS:
                return
            state["insertion_hole"][0, row], state["insertion_body"][0, row] = -1 - k, body
            state["insertion_depth"][0, row] = depth
            state["insertion_point"][0, row], state["insertion_force"][0, row] = R @ at + p, force
            state["insertion_count"] = row + 1

    def forget(self, body: int) -> None:
        """Take out a needle that was put elsewhere, and start anew when the tissue's own body was."""
        if body == self._body.index:
            self.reset()
        for piercer in self.piercers:
            if piercer.body.index == body:
                piercer.inside.withdraw()
                piercer.reset()

    def reset(self) -> None:
        """As at the start."""
        self.block.elastic.gravity[:] = 0.0
        if self._floating is not None:
            self._floating.reset()
        self.block.reset()
        self.contacts.reset()
        for piercer in self.piercers:
            piercer.reset()
        for lying in self.lying:
            lying.reset()
        self.wrench[:], self.peak[:] = 0.0, 0.0
        self._read()
        self.frame.restart()
        self._sew()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return {
            "block": self.block.snapshot(), "frame": self.frame.snapshot(), "contacts": self.contacts.snapshot(),
            "piercers": [piercer.snapshot() for piercer in self.piercers],
            "lying": [lying.snapshot() for lying in self.lying],
            "gravity": self.block.elastic.gravity.copy(), "wrench": self.wrench.copy(), "peak": self.peak.copy(),
            "floating": {} if self._floating is None else self._floating.snapshot(),
        }  # fmt: skip

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        self.block.restore(snapshot["block"])
        self.frame.restore(snapshot["frame"])
        self.contacts.restore(snapshot["contacts"])
        for piercer, kept in zip(self.piercers, snapshot["piercers"], strict=True):
            piercer.restore(kept)
        for lying, kept in zip(self.lying, snapshot["lying"], strict=True):
            lying.restore(kept)
        self.block.elastic.gravity[:] = snapshot["gravity"]
        self.wrench[:], self.peak[:] = snapshot["wrench"], snapshot["peak"]
        if self._floating is not None:
            self._floating.restore(snapshot["floating"])
        self._read()


@kernel
def add_up(tissue: Integers, frame: Integers, wrench: Array, peak: Array) -> None:
    """Force and moment (6,) on the tissue in world axes, about the origin of its frame, and the largest force (1,)."""
    points, f = open_tissue(tissue).points, open_frame(frame)
    x, y, z, mx, my, mz, most = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for u in range(points.filled[0]):
        i = points.used[u]
        fx, fy, fz = points.force[i, 0], points.force[i, 1], points.force[i, 2]
        lx, ly, lz = cross(points.at[i, 0], points.at[i, 1], points.at[i, 2], fx, fy, fz)
        x, y, z, mx, my, mz = x + fx, y + fy, z + fz, mx + lx, my + ly, mz + lz
        most = max(most, fx * fx + fy * fy + fz * fz)
    wrench[0], wrench[1], wrench[2] = rotate(f.R, x, y, z)
    wrench[3], wrench[4], wrench[5] = rotate(f.R, mx, my, mz)
    peak[0] = math.sqrt(most)


@kernel
def see_puncture(tissue: Integers, frame: Integers, i: int, out: Array) -> None:
    """Place of a point in world axes, and the normal of the surface there, (2, 3).

    It lies on the face of its nodes, or just below the surface: then the nearest face counts.
    """
    t, f = open_tissue(tissue), open_frame(frame)
    x, nodes, weights = t.field.x, t.points.nodes[i], t.points.weights[i]
    px, py, pz = 0.0, 0.0, 0.0
    for n in range(8):
        w, k = weights[n], nodes[n]
        px, py, pz = px + w * x[k, 0], py + w * x[k, 1], pz + w * x[k, 2]
    a, b, c, d = nodes[0], nodes[1], nodes[2], nodes[3]
    if weights[4] != 0.0 or weights[5] != 0.0 or weights[6] != 0.0 or weights[7] != 0.0:
        nearest = math.inf
        for q in range(t.field.faces.shape[0] - t.field.around.shape[0]):
            corner, away = t.field.faces[q], 0.0
            for m in range(3):
                middle = x[corner[0], m] + x[corner[1], m] + x[corner[2], m] + x[corner[3], m]
                away += (0.25 * middle - (px if m == 0 else (py if m == 1 else pz))) ** 2
            if away < nearest:
                nearest, a, b, c, d = away, corner[0], corner[1], corner[2], corner[3]
    nx, ny, nz = cross(
        x[c, 0] - x[a, 0], x[c, 1] - x[a, 1], x[c, 2] - x[a, 2], x[d, 0] - x[b, 0], x[d, 1] - x[b, 1],
        x[d, 2] - x[b, 2],
    )  # fmt: skip
    size = max(math.sqrt(nx * nx + ny * ny + nz * nz), 1e-12)
    nx, ny, nz = rotate(f.R, nx / size, ny / size, nz / size)
    out[1, 0], out[1, 1], out[1, 2] = nx, ny, nz
    px, py, pz = rotate(f.R, px, py, pz)
    out[0, 0], out[0, 1], out[0, 2] = px + f.p[0], py + f.p[1], pz + f.p[2]
