"""A thread of the scene in a body of tissue: it follows its needle through the path; SI units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import quaternion_matrix
from ligature.soft.frame import Frame
from ligature.soft.needle import ScenePiercer
from ligature.suture.rod import Rod
from ligature.tissue.block import TissueBlock

Array = NDArray[np.float64]


class SceneThread:
    """One rod and one body of tissue; ``piercer`` is the needle whose path it follows."""

    def __init__(self, rod: Rod, piercer: ScenePiercer, block: TissueBlock) -> None:
        self.rod, self._piercer = rod, piercer
        self.inside = block.add_thread(float(rod.description.radius.min()))
        first = next(a for a in rod.description.attachments if a.body == piercer.body.index)
        # The thread's first point is at the needle's tail.
        self._turned = first.element > 0
        self._springs: list[int] = []
        self._moves = np.zeros((0, 3))

    @property
    def engaged(self) -> bool:
        """Whether the thread is in the tissue."""
        return bool(self.inside.engaged.any())

    def element(self, segment: int) -> int:
        """Element of the rod that a segment of the thread is."""
        return len(self.rod.description.mass) - 1 - segment if self._turned else segment

    def _points(self, frame: Frame) -> Array:
        """Ends of the elements from the needle on, (n + 1, 3) in B."""
        rod = self.rod
        ends = np.array([
            x + e @ quaternion_matrix(q).T
            for x, q, e in zip(rod.positions, rod.orientations, rod.description.ends, strict=True)
        ])  # fmt: skip
        points = np.concatenate([ends[:1, 0], 0.5 * (ends[:-1, 1] + ends[1:, 0]), ends[-1:, 1]])
        points = (points - frame.p) @ frame.R
        return np.ascontiguousarray(points[::-1] if self._turned else points)

    def begin(self, frame: Frame, dt: float) -> None:
        """Hand the rod what the tissue does to it."""
        self.inside.draw_in(self._piercer.inside)
        self._springs = []
        if not self.engaged:
            return
        springs = self.inside.springs(self._points(frame))
        rod, R = self.rod, frame.R
        self._moves = np.zeros((len(springs.segment), 3))
        for row, (segment, k, bias, start) in enumerate(
            zip(springs.segment.tolist(), springs.stiffness, springs.bias, springs.start, strict=True)
        ):
            node = rod.first + self.element(segment)
            if frame.moves:
                self._moves[row] = frame.drift(start, dt)[:3]
            arm = R @ start + frame.p - rod.nodes.x[node]
            cross = np.array([[0.0, -arm[2], arm[1]], [arm[2], 0.0, -arm[0]], [-arm[1], arm[0], 0.0]])
            J = np.concatenate([np.eye(3), -cross], axis=1)
            K = R @ k @ R.T
            self._springs.append(rod.add_spring(node, J.T @ K @ J, J.T @ (R @ (bias + k @ self._moves[row]))))

    def end(self, frame: Frame, dt: float) -> None:
        """Conclude with the motion that the rod's solve found."""
        kept = [s for s in self._springs if s >= 0]
        if not kept:
            return
        forces = np.zeros((len(self._springs), 3))
        for row, spring in enumerate(self._springs):
            if spring >= 0:
                forces[row] = -frame.R.T @ (self.rod.springs.impulse[spring, :3] / dt)
        points = self._points(frame)
        if frame.moves:
            points = points - dt * (frame.v + np.cross(frame.w, points))
        self.inside.conclude(points, forces)
