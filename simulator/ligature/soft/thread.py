"""A thread of the scene in a body of tissue: it follows its needle through the path; SI units."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined, kernel
from ligature.rotations import matrix_of, rotate, rotate_back
from ligature.soft.frame import Frame, FrameArrays, into, open_frame, turn_six, velocity_at
from ligature.soft.needle import ScenePiercer
from ligature.suture.layout import Nodes
from ligature.suture.rod import Rod
from ligature.suture.springs import CAPACITY, Springs, open_springs
from ligature.suture.tracking import open_nodes
from ligature.tables import opener, table_of
from ligature.tissue.block import TissueBlock
from ligature.tissue.layout import Tissue, open_tissue
from ligature.tissue.strand import Strand, finish, open_strand, prepare

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Tables = tuple[Integers, Integers, Integers, Integers, Integers, Integers]
"""Of the tissue, its strand, the run, the rod's nodes and springs, and the frame."""


FINE = 10
"""Places of an element at which it is seen whether it starts in tissue."""


class Run(NamedTuple):
    """A rod of n elements as a chain of points from the needle on."""

    line: Array  # (n + 1, 3) in B
    springs: Integers  # (S + 1,) how many nodes hold it, and their springs of the rod, -1 for those without room
    chain: Integers  # (2,) node of the first element, and 1 where the needle is at the last
    K: Array  # (6, 6) scratch, and so on
    turn: Array  # (3, 3)


def _run(elements: int, first: int, turned: bool) -> Run:
    z = np.zeros
    return Run(
        z((elements + 1, 3)), np.zeros(CAPACITY + 1, np.int64), np.array([first, int(turned)]), z((6, 6)), z((3, 3))
    )


open_run = opener(_run(1, 0, False))


class SceneThread:
    """One rod and one body of tissue in its ``frame``; ``piercer`` is the needle whose path it follows, if any."""

    def __init__(self, rod: Rod, piercer: ScenePiercer | None, block: TissueBlock, frame: Frame) -> None:
        self.rod, self._piercer = rod, piercer
        self.inside = block.add_thread(float(rod.description.radius.min()))
        # The thread's first point is at the needle's tail.
        self.turned = False
        if piercer is not None:
            self.turned = next(a for a in rod.description.attachments if a.body == piercer.body.index).element > 0
        self._run = _run(len(rod.description.mass), rod.first, self.turned)
        self._tables = (
            block.interface.table, self.inside.table, table_of(self._run), table_of(rod.nodes), rod.spring_table,
            frame.table,
        )  # fmt: skip
        self._holds = False

    @property
    def engaged(self) -> bool:
        """Whether the thread is in the tissue."""
        return bool(self.inside.engaged.any())

    def element(self, segment: int) -> int:
        """Element of the rod that a segment of the thread is."""
        return len(self.rod.description.mass) - 1 - segment if self.turned else segment

    def sew(self, block: TissueBlock, T_world_body: Array) -> None:
        """Make a path through the tissue, at rest at a pose (4, 4), wherever the rod starts in it."""
        made, radius = self.rod.description, self.inside.radius
        ends, frames = [*made.ends[:, 0], made.ends[-1, 1]], [*made.T_world_inertial, made.T_world_inertial[-1]]
        line = np.array([T[:3, :3] @ end + T[:3, 3] for T, end in zip(frames, ends, strict=True)])
        line = (line - T_world_body[:3, 3]) @ T_world_body[:3, :3]
        at = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))]
        fine = np.linspace(0.0, at[-1], FINE * len(line))
        points = np.column_stack([np.interp(fine, at, column) for column in line.T])
        within = np.array([block.contains(point) for point in points])
        for run in np.split(np.arange(len(fine)), np.flatnonzero(np.diff(within)) + 1):
            if within[run[0]]:
                nodes = run[np.linspace(0, len(run) - 1, max(2, round(len(run) / FINE) + 1)).round().astype(int)]
                # A path leads to its exit; the thread's first point has left there.
                self.inside.insert(block.lay_path(points[nodes[::-1]], radius), fine[nodes[0]])

    def begin(self, dt: float) -> None:
        """Hand the rod what the tissue does to it."""
        if self._piercer is not None and self._piercer.met:
            self.inside.draw_in(self._piercer.inside)
        self._holds = bool(hold(self._tables, dt))

    def end(self, dt: float) -> None:
        """Conclude with the motion that the rod's solve found."""
        if self._holds:
            let_settle(self._tables, dt)


@inlined
def _open(tables: Tables) -> tuple[Tissue, Strand, Run, Nodes, Springs, FrameArrays]:
    return (
        open_tissue(tables[0]), open_strand(tables[1]), open_run(tables[2]), open_nodes(tables[3]),
        open_springs(tables[4]), open_frame(tables[5]),
    )  # fmt: skip


@inlined
def _lay_out(run: Run, nodes: Nodes, f: FrameArrays) -> None:
    """Ends of the elements from the needle on; between two elements the middle of both."""
    line, R, n = run.line, run.turn, run.line.shape[0] - 1
    for k in range(n + 1):
        line[k, 0], line[k, 1], line[k, 2] = 0.0, 0.0, 0.0
    for e in range(n):
        i = run.chain[0] + e
        x, q = nodes.x[i], nodes.q[i]
        matrix_of(q[0], q[1], q[2], q[3], R)
        for side in range(2):
            k = n - e - side if run.chain[1] else e + side
            weight = 1.0 if e + side == 0 or e + side == n else 0.5
            end = nodes.axis[i, side]
            ax, ay, az = rotate(R, end[0], end[1], end[2])
            ax, ay, az = into(f, x[0] + ax, x[1] + ay, x[2] + az)
            line[k, 0] += weight * ax
            line[k, 1] += weight * ay
            line[k, 2] += weight * az


@kernel
def hold(tables: Tables, dt: float) -> bool:
    """Find the nodes that hold a rod as its tick begins, and make springs of them; whether there are any."""
    t, strand, run, nodes, s, f = _open(tables)
    holds = False
    for i in range(strand.held.engaged.shape[0]):
        holds = holds or strand.held.engaged[i] != 0
    if not holds:
        return False
    _lay_out(run, nodes, f)
    prepare(t.points, t.paths, strand, run.line, (t.field.clock[0] + 1) / t.field.clock[1])
    rows, K = strand.rows, run.K
    count = min(rows.filled[0], run.springs.shape[0] - 1)
    run.springs[0] = count
    n = run.line.shape[0] - 1
    for r in range(count):
        row = s.filled[0]
        if row == s.node.shape[0]:
            run.springs[1 + r] = -1
            continue
        e = n - 1 - rows.segment[r] if run.chain[1] else rows.segment[r]
        node = run.chain[0] + e
        s.filled[0], s.node[row], run.springs[1 + r] = row + 1, node, row
        start, k = rows.start[r], rows.stiffness[r]
        vx, vy, vz = velocity_at(f, start[0], start[1], start[2])
        vx, vy, vz = dt * vx, dt * vy, dt * vz
        fx = rows.bias[r, 0] + k[0, 0] * vx + k[0, 1] * vy + k[0, 2] * vz
        fy = rows.bias[r, 1] + k[1, 0] * vx + k[1, 1] * vy + k[1, 2] * vz
        fz = rows.bias[r, 2] + k[2, 0] * vx + k[2, 1] * vy + k[2, 2] * vz
        # About the centre of the element: J = [1, -arm ×], all in B.
        cx, cy, cz = into(f, nodes.x[node, 0], nodes.x[node, 1], nodes.x[node, 2])
        x, y, z = start[0] - cx, start[1] - cy, start[2] - cz
        _spread(k, x, y, z, K)
        turn_six(f.R, K, s.K[row])
        load = s.load[row]
        load[0], load[1], load[2] = rotate(f.R, fx, fy, fz)
        load[3], load[4], load[5] = rotate(f.R, y * fz - z * fy, z * fx - x * fz, x * fy - y * fx)
    return True


@inlined
def _spread(k: Array, x: float, y: float, z: float, K: Array) -> None:
    """K (6, 6) = Jᵀ k J for J = [1, -arm ×] with the arm (x, y, z)."""
    for a in range(3):
        p, q, r = k[a, 0], k[a, 1], k[a, 2]
        K[a, 0], K[a, 1], K[a, 2] = p, q, r
        # Rows of k times -arm ×.
        K[a, 3], K[a, 4], K[a, 5] = y * r - z * q, z * p - x * r, x * q - y * p
    for b in range(6):
        p, q, r = K[0, b], K[1, b], K[2, b]
        K[3, b], K[4, b], K[5, b] = y * r - z * q, z * p - x * r, x * q - y * p


@kernel
def let_settle(tables: Tables, dt: float) -> None:
    """End a tick with the forces of the springs as the rod's solve found them."""
    t, strand, run, nodes, s, f = _open(tables)
    rows, line = strand.rows, run.line
    for r in range(rows.filled[0]):
        row = run.springs[1 + r] if r < run.springs[0] else -1
        force = rows.force[r]
        force[0], force[1], force[2] = 0.0, 0.0, 0.0
        if row >= 0:
            push = s.impulse[row]
            x, y, z = rotate_back(f.R, push[0], push[1], push[2])
            force[0], force[1], force[2] = -x / dt, -y / dt, -z / dt
    _lay_out(run, nodes, f)
    for k in range(line.shape[0]):
        x, y, z = velocity_at(f, line[k, 0], line[k, 1], line[k, 2])
        line[k, 0], line[k, 1], line[k, 2] = line[k, 0] - dt * x, line[k, 1] - dt * y, line[k, 2] - dt * z
    finish(t.points, strand, line)
