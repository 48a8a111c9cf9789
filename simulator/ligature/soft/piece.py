"""One body of tissue among needles, threads and rigid bodies, in the frame of its own rigid body; SI units."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Scene
from ligature.model.soft import TissueBody
from ligature.model.state import MAX_INSERTIONS, MAX_PUNCTURES, StateRecord
from ligature.soft.contacts import BodyContacts
from ligature.soft.frame import Frame
from ligature.soft.needle import ScenePiercer
from ligature.soft.thread import SceneThread
from ligature.suture.bodies import SutureBodies
from ligature.suture.rod import Rod
from ligature.tissue.block import TissueBlock

Array = NDArray[np.float64]


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
        self.block = TissueBlock(form.grid, form.materials, form.fixed, dt=dt)
        self.frame = Frame(self._body)
        carrier = {a.body: rod for rod in rods for a in rod.description.attachments}
        self.piercers = [
            ScenePiercer(scene, needle, self.block, carrier.get(needle.body), dt) for needle in scene.needles
        ]
        self._carried = [p for p in self.piercers if p.rod is not None]
        self._alone = [p for p in self.piercers if p.rod is None]
        self.threads = [SceneThread(p.rod, p, self.block) for p in self._carried if p.rod is not None]
        self.contacts = BodyContacts(scene, tissue.body, self.block, bodies, self.piercers, dt)
        self._box = np.zeros((2, 3))
        self.wrench, self.peak = np.zeros(6), np.zeros(1)
        self._measure()
        self._read()
        self.frame.restart()

    def _read(self) -> None:
        self.frame.read(*self._bodies.motion(self._body.index))

    def _measure(self) -> None:
        x = self.block.positions
        self._box[0], self._box[1] = x.min(axis=0), x.max(axis=0)

    # --- the tick -----------------------------------------------------------------------------

    def begin(self) -> None:
        """What comes before the rods' own step: bodies push the tissue, rods get its springs."""
        self._read()
        self.contacts.step(self.frame, self._box)
        for piercer in self._carried:
            piercer.begin(self._bodies, self.frame, self._box)
        for thread in self.threads:
            thread.begin(self.frame, self._dt)

    def end(self) -> None:
        """What comes after: forces of needles and threads, the reaction on the rigid body, the tissue's own motion."""
        for piercer in self._carried:
            piercer.end(self.frame)
        for thread in self.threads:
            thread.end(self.frame, self._dt)
        for piercer in self._alone:
            piercer.couple(self._bodies, self.frame, self._box)
        self._react()
        frame, block = self.frame, self.block
        if block.interface.tick + 1 == block.interface.ticks:
            frame.end_step(block.elastic.h)
            block.elastic.gravity[:] = (self._body.gravity - frame.acceleration) @ frame.R
        block.step()
        if block.interface.tick == 0:
            self._measure()

    def _react(self) -> None:
        """Add up what acts on the tissue; its rigid body moves by that."""
        p = self.block.interface.points
        f, at = p.force, p.at
        if not f.any():
            self.wrench[:], self.peak[:] = 0.0, 0.0
            return
        (x, y, z), (fx, fy, fz) = at.T, f.T
        about = [(y * fz - z * fy).sum(), (z * fx - x * fz).sum(), (x * fy - y * fx).sum()]
        self.wrench[:] = self.frame.turned(np.array([*f.sum(axis=0), *about]))
        self.peak[0] = np.sqrt((f**2).sum(axis=1).max())
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
        self._write_punctures(state, k, R, p)
        self._write_insertions(state, k, R, p)

    def _write_punctures(self, state: StateRecord, k: int, R: Array, p: Array) -> None:
        paths, points, x = self.block.paths, self.block.interface.points, self.block.positions
        count = 0
        for path in np.flatnonzero(paths.count).tolist():
            ends = [0, int(paths.count[path]) - 1] if np.isfinite(paths.length[path]) else [0]
            for end in ends:
                if count == MAX_PUNCTURES:
                    break
                i = int(paths.node[path, end])
                at = points.weights[i] @ x[points.nodes[i]]
                corners = x[self._face_at(points.nodes[i], points.weights[i], at)]
                across = np.cross(corners[2] - corners[0], corners[3] - corners[1])
                state["puncture_point"][0, k, count] = R @ at + p
                state["puncture_normal"][0, k, count] = R @ across / max(float(np.linalg.norm(across)), 1e-12)
                count += 1
        state["puncture_point"][0, k, count:] = 0.0
        state["puncture_normal"][0, k, count:] = 0.0
        state["puncture_count"][0, k] = count

    def _face_at(self, nodes: NDArray[np.int64], weights: Array, at: Array) -> NDArray[np.int64]:
        """Corners (4,) of the face that a point lies on, the nearest one for a point just below the surface."""
        if not weights[4:].any():
            return nodes[:4]
        faces = self.block.elastic.grid.faces
        away = ((self.block.positions[faces].mean(axis=1) - at) ** 2).sum(axis=1)
        return np.asarray(faces[int(np.argmin(away))])

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
        self.block.reset()
        self.contacts.reset()
        for piercer in self.piercers:
            piercer.reset()
        self.wrench[:], self.peak[:] = 0.0, 0.0
        self._measure()
        self._read()
        self.frame.restart()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        return {
            "block": self.block.snapshot(), "frame": self.frame.snapshot(), "contacts": self.contacts.snapshot(),
            "piercers": [piercer.snapshot() for piercer in self.piercers],
            "gravity": self.block.elastic.gravity.copy(), "wrench": self.wrench.copy(), "peak": self.peak.copy(),
        }  # fmt: skip

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        self.block.restore(snapshot["block"])
        self.frame.restore(snapshot["frame"])
        self.contacts.restore(snapshot["contacts"])
        for piercer, kept in zip(self.piercers, snapshot["piercers"], strict=True):
            piercer.restore(kept)
        self.block.elastic.gravity[:] = snapshot["gravity"]
        self.wrench[:], self.peak[:] = snapshot["wrench"], snapshot["peak"]
        self._measure()
        self._read()
