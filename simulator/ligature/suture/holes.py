"""Tissue holes: what passes through one is held there, sideways by the tissue and along by friction.

Where a needle or a thread first crosses the opening of a hole it marks a puncture, a point and axes fixed
in the hole's body. From then on the tissue pushes it back to the puncture like a spring, and rubs along
it: viscous friction F = -K v as in the paper of the challenge, and Coulomb friction that keeps a released
needle where it was left. Too hard a pull sideways tears the tissue: the puncture moves on. A
puncture anywhere else in tissue makes another such passage. World axes, SI units.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse
from ligature.model.piercing import Hole, Tissue
from ligature.model.scene import Scene
from ligature.model.state import MAX_INSERTIONS, StateRecord
from ligature.model.subsystem import kept, put_back
from ligature.suture import passages as arrays
from ligature.suture.bodies import HeldBodies
from ligature.suture.holding import hold_alone, react
from ligature.suture.rod import Rod
from ligature.suture.rods import Rods
from ligature.suture.tables import table_of
from ligature.suture.tracking import follow_needle, follow_rod, look_for_needle, look_for_rod

Array = NDArray[np.float64]

LEAST_FRICTION, LEAST_STRENGTH, LEAST_STIFFNESS = 0.3, 3.0, 4000.0
"""Friction (N), sideways strength (N) and stiffness (N/m) of tissue whose file states nothing.

Masses in scenes of AMBF are often a thousand times those of real needles and threads; such a needle would
fall out of real tissue. So its tissue bears its weight: the following multiples of it. A thread of a kilogram that
falls until it hangs from its needle shakes it with twice its weight along and five times aside.
"""

FRICTION_PER_WEIGHT, STRENGTH_PER_WEIGHT, SAG = 2.5, 15.0, 2e-5
"""Friction and strength over the weight of needle and thread; metres by which that weight pulls them aside."""

SETTLING = 0.002
"""Time in seconds in which a needle swings back to its puncture."""

NEAR = 0.01
"""Distance in metres within which a hole's pose is read at every look."""

SURPRISE = 0.5
"""Speed in m/s that a needle or thread may suddenly reach: how soon to look again."""

MOST_BLIND = 32
"""Most ticks between two looks."""

_KEPT = ("_blind", "_turn", "_near", "_gaps")
"""Attributes of `Holes` that last from tick to tick: when to look for new passages, and where."""


@dataclass(frozen=True, eq=False)
class Insertion:
    """A needle or thread in a hole.

    ``hole`` is the hole's index in the scene and ``body`` the needle or the element that passes;
    ``depth`` (m) the length of needle or thread beyond the hole, ``point`` (3,) where it passes and
    ``force`` (3,), ``moment`` (3,) what the tissue does to it there, in world axes.
    """

    hole: int
    body: int
    depth: float
    point: Array
    force: Array
    moment: Array


class Holes:
    """The holes of a scene and what is in them.

    Parameters
    ----------
    scene
        Its recognised holes, needles and rods.
    rods
        The running rods; they feel the holes in their own solve, with the needles tied to them.
    bodies
        The rigid bodies.
    dt
        Length of a tick in seconds.
    """

    def __init__(self, scene: Scene, rods: Rods, bodies: HeldBodies, dt: float) -> None:
        self._scene, self._rods, self._bodies, self._dt = scene, rods.rods, bodies, dt
        self._needles = [needle.body for needle in scene.needles]
        self._passages = arrays.passages()
        self._sites = _sites(scene, bodies)
        self._lines = _lines(scene, self._rods)
        self._before = [_lengths(rod) for rod in self._rods]
        self._p, self._s, self._l = (table_of(g) for g in (self._passages, self._sites, self._lines))
        self._rod_tables = [table_of(rod.nodes) for rod in self._rods]
        for owner, rod in enumerate(self._rods):
            rod.take_passages(self._passages, owner)
        self._scratch = (np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6))
        self._reaction = np.zeros(6)
        n = len(self._needles)
        self._twist, self._pull = np.zeros((n, 6)), np.zeros((n, 6))
        self._mass, self._inertia = np.zeros(n), np.zeros((n, 3))
        self._gaps = np.zeros((n + len(self._rods), len(scene.holes)))
        self._near = np.ones(len(scene.holes), dtype=bool)
        self._mobile = self._sites.recoil.any(axis=(1, 2))
        self._blind = 0
        self._turn = -1
        self._idle = not scene.holes or not (self._needles or self._rods)

    # --- the tick ---------------------------------------------------------------------------

    def begin(self) -> None:
        """Find and follow passages, before the rods advance."""
        if self._idle:
            return
        if self._blind > 0:
            self._blind -= 1
            if not self._passages.filled[0]:
                return
        else:
            self._look()
        if self._passages.filled[0]:
            self._follow()

    def end(self) -> None:
        """Hold needles that no rod solves for, and push the holes back; after the rods have advanced."""
        p = self._passages
        for c in range(p.filled[0]):
            line = int(p.line[c])
            if p.owner[c] < 0 and line not in p.line[:c]:
                self._hold_alone(line)
        for c in range(p.filled[0]):
            hole = self._scene.holes[p.hole[c]]
            react(self._p, self._sites.pose, c, self._reaction)
            if self._mobile[p.hole[c]]:
                self._bodies.apply_impulse(hole.body, self._reaction[:3], self._reaction[3:])

    def _look(self) -> None:
        """Find lines that have entered holes, and how long nothing else can."""
        for line, body in enumerate(self._needles):
            self._lines.pose[line] = self._bodies.motion(body)[0]
        self._turn = (self._turn + 1) % len(self._scene.holes)
        self._near[self._turn] = True
        self._read_holes(np.flatnonzero(self._near).tolist())
        for line in range(len(self._needles)):
            look_for_needle(self._p, self._l, self._s, line, self._gaps[line])
        for owner, rod in enumerate(self._rods):
            line = len(self._needles) + owner
            look_for_rod(
                self._p, self._s, self._rod_tables[owner], rod.first, self._before[owner], line, owner, self._gaps[line]
            )
        nearest = self._gaps.min(axis=0)
        self._near[:] = nearest < NEAR
        self._blind = int(min(max(float(nearest.min()), 0.0) / (SURPRISE * self._dt), MOST_BLIND))

    def _read_holes(self, holes: list[int]) -> None:
        sites = self._sites
        for hole in holes:
            sites.pose[hole], sites.twist[hole] = self._bodies.motion(self._scene.holes[hole].body)

    def _follow(self) -> None:
        """Bring all passages up to date and drop those that have ended."""
        p, n = self._passages, int(self._passages.filled[0])
        self._read_holes(sorted(set(p.hole[:n].tolist())))
        self._sites.shared[:] = np.bincount(p.hole[:n], minlength=len(self._sites.shared))
        for line in sorted(set(p.line[:n].tolist())):
            if line < len(self._needles):
                self._read_needle(line)
        lasting = [c for c in range(n) if self._follows(c)]
        if len(lasting) < n:
            self._keep(lasting)

    def _follows(self, c: int) -> bool:
        owner = int(self._passages.line[c]) - len(self._needles)
        if owner < 0:
            return bool(follow_needle(self._p, self._l, self._s, c))
        rod = self._rods[owner]
        return bool(follow_rod(self._p, self._l, self._s, self._rod_tables[owner], rod.first, self._before[owner], c))

    def _keep(self, rows: list[int]) -> None:
        """Close the ranks around the passages that last."""
        for name, array in zip(self._passages._fields, self._passages, strict=True):
            if name not in arrays.ALONE:
                array[: len(rows)] = array[rows]
        self._passages.filled[0] = len(rows)

    def _read_needle(self, line: int) -> None:
        """Motion of a needle, and what will pull at it in this tick, for whoever solves for it."""
        body, bodies = self._scene.bodies[self._needles[line]], self._bodies
        self._lines.pose[line], self._twist[line] = bodies.motion(body.index)
        mass, inertia, self._pull[line] = bodies.attached_load(body.index)
        self._mass[line], self._inertia[line] = body.mass + mass, body.inertia + inertia
        self._pull[line, :3] += body.mass * body.gravity
        owner = int(self._lines.owner[line])
        if owner >= 0:
            fall = self._pull[line, :3] / self._mass[line]
            self._rods[owner].pull_partner(body.index, fall, self._mass[line], self._inertia[line])

    def _hold_alone(self, line: int) -> None:
        hold_alone(
            self._p, line, self._lines.pose[line], self._twist[line], self._mass[line], self._inertia[line],
            self._pull[line], *self._scratch, self._dt,
        )  # fmt: skip
        p, n = self._passages, int(self._passages.filled[0])
        impulse = p.impulse[:n][p.line[:n] == line].sum(axis=0)
        self._bodies.apply_impulse(self._needles[line], impulse[:3], impulse[3:])

    # --- state ------------------------------------------------------------------------------

    @property
    def insertions(self) -> tuple[Insertion, ...]:
        """What is in the holes now."""
        p = self._passages
        return tuple(self._insertion(c) for c in range(int(p.filled[0])))

    def _insertion(self, c: int) -> Insertion:
        p = self._passages
        owner = int(p.line[c]) - len(self._needles)
        body = self._needles[p.line[c]] if owner < 0 else self._rods[owner].description.bodies[p.element[c]]
        force = p.force[c, :3] - np.array([p.bend[c] * p.force[c, 4], 0.0, 0.0])
        return Insertion(
            hole=int(p.hole[c]), body=body, depth=float(p.depth[c]), point=p.x[c] + p.lever[c],
            force=p.axes[c] @ force, moment=p.axes[c] @ p.force[c, 3:],
        )  # fmt: skip

    def write_state(self, state: StateRecord) -> None:
        """Write the insertions into a state record."""
        found = self.insertions[:MAX_INSERTIONS]
        if not found and not state["insertion_count"][0]:
            return
        state["insertion_count"] = len(found)
        for name in ("hole", "body", "depth", "point", "force"):
            state[f"insertion_{name}"] = 0
        for row, insertion in enumerate(found):
            for name in ("hole", "body", "depth", "point", "force"):
                state[f"insertion_{name}"][0, row] = getattr(insertion, name)

    def forget(self, body: int) -> None:
        """Take a needle out of its holes without a trace: it was put elsewhere."""
        p, n = self._passages, int(self._passages.filled[0])
        if body in self._needles:
            line = self._needles.index(body)
            self._keep([c for c in range(n) if p.line[c] != line and p.owner[c] != self._lines.owner[line]])
        self._blind = 0

    def reset(self) -> None:
        """Empty all holes, and look for new passages in the next tick."""
        self._clear()
        self._blind, self._turn = 0, -1
        self._near[:] = True
        self._gaps[:] = 0.0
        self._read_holes(list(range(len(self._scene.holes))))

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick."""
        n = int(self._passages.filled[0])
        rows = {name: np.array(getattr(self._passages, name)[:n]) for name in arrays.ROWS}
        return {"rows": rows, "pose": self._sites.pose, "twist": self._sites.twist, **kept(self, _KEPT)}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        self._clear()
        n = len(snapshot["rows"]["hole"])
        self._passages.filled[0] = n
        for name in arrays.ROWS:
            getattr(self._passages, name)[:n] = snapshot["rows"][name]
        self._sites.pose[:], self._sites.twist[:] = snapshot["pose"], snapshot["twist"]
        put_back(self, {name: snapshot[name] for name in _KEPT})

    def _clear(self) -> None:
        """No passages, and none of earlier ones left in the rows behind."""
        self._passages.filled[0] = 0
        for name in arrays.ROWS:
            getattr(self._passages, name)[:] = 0


def _sites(scene: Scene, bodies: HeldBodies) -> arrays.Sites:
    """The holes as arrays."""
    sites = arrays.sites(len(scene.holes))
    for hole in scene.holes:
        body = scene.bodies[hole.body]
        T = inverse(body.T_body_inertial) @ hole.T_body_hole
        sites.R[hole.index], sites.origin[hole.index], sites.half[hole.index] = T[:3, :3], T[:3, 3], hole.half
        sites.pose[hole.index], sites.twist[hole.index] = bodies.motion(hole.body)
        sites.recoil[hole.index] = bodies.mobility(hole.body)
    return sites


def _lines(scene: Scene, rods: list[Rod]) -> arrays.Lines:
    """Needles and rods as arrays, with the law that each hole has for each of them."""
    lines = arrays.lines(len(scene.needles) + len(rods), len(scene.holes))
    attached = {attachment.body: owner for owner, rod in enumerate(rods) for attachment in rod.description.attachments}
    for line, needle in enumerate(scene.needles):
        arc = needle.arc
        lines.centre[line], lines.x[line], lines.y[line] = arc.centre, arc.x, arc.y
        lines.radius[line], lines.begin[line], lines.end[line] = arc.radius, arc.begin, arc.end
        owner = attached.get(needle.body, -1)
        lines.owner[line] = owner
        lines.node[line] = rods[owner].node_of[needle.body] if owner >= 0 else 0
        weight = _weight(scene, [needle.body]) + (_rod_weight(rods[owner]) if owner >= 0 else 0.0)
        for hole in scene.holes:
            _set_law(lines, line, hole, weight, arc.radius)
    for owner, rod in enumerate(rods):
        line = len(scene.needles) + owner
        attached_needles = [needle.body for needle in scene.needles if attached.get(needle.body) == owner]
        weight = _rod_weight(rod) + _weight(scene, attached_needles)
        for hole in scene.holes:
            _set_law(lines, line, hole, weight, 0.0)
    return lines


def _weight(scene: Scene, bodies: list[int]) -> float:
    return sum(scene.bodies[b].mass * float(np.linalg.norm(scene.bodies[b].gravity)) for b in bodies)


def _rod_weight(rod: Rod) -> float:
    d = rod.description
    return float(d.mass @ np.linalg.norm(d.gravity, axis=1))


def settled_tissue(tissue: Tissue, weight: float) -> Tissue:
    """Tissue with every value given, for a needle and thread of ``weight`` newtons."""
    return Tissue(
        stiffness=max(LEAST_STIFFNESS, weight / SAG) if tissue.stiffness is None else tissue.stiffness,
        strength=max(LEAST_STRENGTH, STRENGTH_PER_WEIGHT * weight) if tissue.strength is None else tissue.strength,
        friction=max(LEAST_FRICTION, FRICTION_PER_WEIGHT * weight) if tissue.friction is None else tissue.friction,
        drag=tissue.drag,
    )


def _set_law(lines: arrays.Lines, line: int, hole: Hole, weight: float, arm: float) -> None:
    """Springs, dampers and limits of a line in a hole; what they do at an arm they do against turning.

    That arm is half the opening, at whose rim tissue touches a needle; more, up to ``arm`` metres, for needles so heavy
    that the tissue bears their weight. A thread has no arm: it turns freely.
    """
    tissue = settled_tissue(hole.tissue, weight)
    if arm > 0.0:
        bears = min(1.0, FRICTION_PER_WEIGHT * weight / max(tissue.friction or 0.0, 1e-9))
        arm = max(arm * bears, float(hole.half.min()))
    scale = np.array([1.0, 1.0, 1.0, arm**2, arm**2, arm**2])
    stiffness = (tissue.stiffness or 0.0) * scale
    damping = SETTLING * stiffness
    damping[0] = tissue.drag
    friction, strength = tissue.friction or 0.0, tissue.strength or 0.0
    lines.stiffness[line, hole.index], lines.damping[line, hole.index] = stiffness, damping
    lines.limit[line, hole.index] = [friction, strength, strength, arm * friction, arm * strength, arm * strength]


def _lengths(rod: Rod) -> Array:
    """Length of a rod up to each of its elements, (n + 1,)."""
    ends = rod.description.ends
    return np.append(0.0, np.cumsum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
