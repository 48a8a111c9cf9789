"""Tissue holes: the tissue holds what passes through them, sideways by springs and along by friction.

A needle or a thread that first crosses the opening of a hole marks a puncture, a point and axes fixed in the hole's
body. From then on the tissue pushes it back to the puncture like a spring, with friction along the path: viscous
F = -K v as in the suturing challenge (Munawar and others 2022), and Coulomb friction that keeps a released needle in
place. A sideways force above the strength tears the tissue: the puncture moves on. World axes, SI units.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.model.frames import inverse
from ligature.model.piercing import Hole, Tissue
from ligature.model.scene import Scene
from ligature.model.state import MAX_INSERTIONS, FieldViews, StateRecord
from ligature.model.subsystem import kept, put_back
from ligature.suture import passages as arrays
from ligature.suture.bodies import HeldBodies
from ligature.suture.passage_forces import react, solve_needle
from ligature.suture.rod import Rod
from ligature.suture.rods import Rods
from ligature.suture.searching import Search, follow, search
from ligature.tables import table_of

Array = NDArray[np.float64]

LEAST_FRICTION, LEAST_STRENGTH, LEAST_STIFFNESS = 0.3, 3.0, 4000.0
"""Friction (N), sideways strength (N) and stiffness (N/m) of tissue whose file gives none.

Masses in scenes of AMBF are often a thousand times those of real needles and threads; such a needle would
fall out of real tissue. Its tissue therefore scales with its weight by the factors below. A thread of a kilogram that
falls until it hangs from its needle loads it with twice its weight along and five times sideways.
"""

FRICTION_PER_WEIGHT, STRENGTH_PER_WEIGHT, SAG = 2.5, 15.0, 2e-5
"""Friction and strength over the weight of needle and thread; sideways deflection in metres under that weight."""

SETTLING = 0.002
"""Time constant in seconds in which a needle returns to its puncture."""

_KEPT = ("_countdown", "_turn", "_near", "_gaps")
"""Attributes of `Holes` that last from tick to tick: when to search for new passages, and where."""


@dataclass(frozen=True, eq=False)
class Insertion:
    """A needle or thread in a hole.

    ``hole`` is the hole's index in the scene and ``body`` the needle or the element that passes;
    ``depth`` (m) the length of needle or thread beyond the hole, ``point`` (3,) the crossing and
    ``force`` (3,), ``moment`` (3,) the wrench of the tissue there, in world axes.
    """

    hole: int
    body: int
    depth: float
    point: Array
    force: Array
    moment: Array


class Holes:
    """The holes of a scene and the passages through them.

    Parameters
    ----------
    scene
        Its recognised holes, needles and rods.
    rods
        The running rods; their own solve includes the passages of them and of the needles attached to them.
    bodies
        The rigid bodies.
    dt
        Length of a tick in seconds.
    """

    def __init__(self, scene: Scene, rods: Rods, bodies: HeldBodies, dt: float) -> None:
        self._scene, self._rods, self._bodies = scene, rods.rods, bodies
        self._needles = [needle.body for needle in scene.needles]
        self._passages = arrays.passages()
        self._sites = _sites(scene, bodies)
        self._paths = _paths(scene, self._rods)
        self._before = [_lengths(rod) for rod in self._rods]
        self._passage_table, self._site_table, self._path_table = (
            table_of(g) for g in (self._passages, self._sites, self._paths)
        )
        self._rod_tables = [table_of(rod.nodes) for rod in self._rods]
        for owner, rod in enumerate(self._rods):
            rod.take_passages(self._passages, owner)
        self._scratch = (np.zeros((6, 6)), np.zeros((6, 6)), np.zeros(6))
        self._reaction = np.zeros(6)
        n = len(self._needles)
        self._twist, self._pull = np.zeros((n, 6)), np.zeros((n, 6))
        self._mass, self._inertia = np.zeros(n), np.zeros((n, 3))
        self._mobile = self._sites.recoil.any(axis=(1, 2))
        self._search = self._search_of(dt)
        self._countdown, self._turn, self._near, self._gaps = self._search[:4]
        self.idle = not scene.holes or not (self._needles or self._rods)
        """Whether nothing can ever be in a hole."""
        self.search_table = np.zeros(0, np.int64) if self.idle else table_of(self._search)
        """The table of a `Search`, empty where nothing can ever be in a hole."""
        self._fields = FieldViews("insertion_count")
        self._looked = self._followed = False
        """Whether compiled code did in this tick what `begin` does until passages are followed; and that, too."""

    def _search_of(self, dt: float) -> Search:
        """What `search` takes; at first it looks at once, at all holes."""
        rods, holes, lengths = self._rods, self._scene.holes, self._before
        before = np.zeros((len(rods), max(map(len, lengths), default=1)))
        for row, length in zip(before, lengths, strict=True):
            row[: len(length)] = length
        watched = [*self._needles, *(hole.body for hole in holes)]
        return Search(
            countdown=np.zeros(1, np.int64), turn=np.full(1, -1), near=np.ones(len(holes), dtype=bool),
            gaps=np.zeros((len(self._needles) + len(rods), len(holes))), watched=np.array(watched, dtype=np.int64),
            motion=np.zeros((len(watched), 13)), passages=self._passage_table, paths=self._path_table,
            sites=self._site_table, rods=np.array(self._rod_tables or np.zeros((0, 1)), dtype=np.int64),
            first=np.array([rod.first for rod in rods], dtype=np.int64),
            elements=np.array([len(length) - 1 for length in lengths], dtype=np.int64), before=before,
            dt=np.array([dt]), mobile=self._mobile, lasting=np.zeros(arrays.CAPACITY, np.bool_),
            reaction=self._reaction,
        )  # fmt: skip

    # --- the tick ---------------------------------------------------------------------------

    def begin(self) -> None:
        """Find and follow passages, before the rods advance."""
        if self.idle:
            return
        if self._looked:
            self._looked = False
        elif self._countdown[0] > 0:
            self._countdown[0] -= 1
        else:
            self._bodies.read_motions(self._search.watched, self._search.motion)
            search(self.search_table)
        followed, self._followed = self._followed, False
        if self._passages.filled[0]:
            self._follow(followed)

    @property
    def coasts(self) -> bool:
        """Whether rods solve whatever is in a hole now, so that `begin` and `end` are what compiled code does."""
        n = self._passages.filled[0]
        return not n or bool((self._passages.owner[:n] >= 0).all())

    def load_ahead(self) -> None:
        """Have rods solve needles in the coming ticks of compiled code, until a command comes or a jaw grasps."""
        for path in self._inserted() if self._passages.filled[0] else ():
            self._load_needle(path)

    def look_ahead(self, followed: bool) -> None:
        """Compiled code has searched, or counted a tick, for the coming `begin`; and ``followed`` passages."""
        self._looked, self._followed = True, followed

    def end(self) -> None:
        """Solve needles without a rod and apply the reactions to the holes, after the rods have advanced."""
        p = self._passages
        if not p.filled[0]:
            return
        for c in range(p.filled[0]):
            path = int(p.path[c])
            if p.owner[c] < 0 and path not in p.path[:c]:
                self._solve_needle(path)
        for c in range(p.filled[0]):
            hole = self._scene.holes[p.hole[c]]
            react(self._passage_table, self._sites.pose, c, self._reaction)
            if self._mobile[p.hole[c]]:
                self._bodies.apply_impulse(hole.body, self._reaction[:3], self._reaction[3:])

    def _place_holes(self, holes: Iterable[int]) -> None:
        """Put holes where their bodies were as all were read last."""
        sites = self._sites
        for hole in holes:
            motion = self._search.motion[len(self._needles) + hole]
            sites.pose[hole], sites.twist[hole] = motion[:7], motion[7:]

    def _follow(self, followed: bool) -> None:
        """Update all passages, unless compiled code has ``followed`` them, and drop those that have ended."""
        n = int(self._passages.filled[0])
        if not followed:
            self._bodies.read_motions(self._search.watched, self._search.motion)
            follow(self.search_table)
        for path in self._inserted():
            self._twist[path] = self._search.motion[path, 7:]
            self._load_needle(path)
        lasting = self._search.lasting[:n]
        if not lasting.all():
            self._keep(lasting.nonzero()[0].tolist())

    def _inserted(self) -> list[int]:
        """The paths of needles that are in holes."""
        paths = self._passages.path[: self._passages.filled[0]].tolist()
        return sorted({path for path in paths if path < len(self._needles)})

    def _keep(self, rows: list[int]) -> None:
        """Move the passages ``rows`` to the front, and drop the others."""
        for name, array in zip(self._passages._fields, self._passages, strict=True):
            if name not in arrays.NOT_ROWS:
                array[: len(rows)] = array[rows]
        self._passages.filled[0] = len(rows)

    def _load_needle(self, path: int) -> None:
        """Take the mass of a needle and the forces on it in this tick, for the solve that moves it."""
        body, bodies = self._scene.bodies[self._needles[path]], self._bodies
        mass, inertia, self._pull[path] = bodies.attached_load(body.index)
        self._mass[path], self._inertia[path] = body.mass + mass, body.inertia + inertia
        self._pull[path, :3] += body.mass * body.gravity
        owner = int(self._paths.owner[path])
        if owner >= 0:
            fall = self._pull[path, :3] / self._mass[path]
            self._rods[owner].pull_partner(body.index, fall, self._mass[path], self._inertia[path])

    def _solve_needle(self, path: int) -> None:
        solve_needle(
            self._passage_table, path, self._paths.pose[path], self._twist[path], self._mass[path], self._inertia[path],
            self._pull[path], *self._scratch, self._search.dt[0],
        )  # fmt: skip
        p, n = self._passages, int(self._passages.filled[0])
        impulse = p.impulse[:n][p.path[:n] == path].sum(axis=0)
        self._bodies.apply_impulse(self._needles[path], impulse[:3], impulse[3:])

    # --- state ------------------------------------------------------------------------------

    @property
    def insertions(self) -> tuple[Insertion, ...]:
        """The needles and elements in holes now."""
        p = self._passages
        return tuple(self._insertion(c) for c in range(int(p.filled[0])))

    def _insertion(self, c: int) -> Insertion:
        p = self._passages
        owner = int(p.path[c]) - len(self._needles)
        body = self._needles[p.path[c]] if owner < 0 else self._rods[owner].description.bodies[p.element[c]]
        force = p.force[c, :3] - np.array([p.bend[c] * p.force[c, 4], 0.0, 0.0])
        return Insertion(
            hole=int(p.hole[c]), body=body, depth=float(p.depth[c]), point=p.x[c] + p.lever[c],
            force=p.axes[c] @ force, moment=p.axes[c] @ p.force[c, 3:],
        )  # fmt: skip

    def write_state(self, state: StateRecord) -> None:
        """Write the insertions into a state record."""
        (count,) = self._fields.of(state)
        if not self._passages.filled[0] and not count[0]:
            return
        found = self.insertions[:MAX_INSERTIONS]
        count[0] = len(found)
        for name in ("hole", "body", "depth", "point", "force"):
            state[f"insertion_{name}"] = 0
        for row, insertion in enumerate(found):
            for name in ("hole", "body", "depth", "point", "force"):
                state[f"insertion_{name}"][0, row] = getattr(insertion, name)

    def forget(self, body: int) -> None:
        """Drop the passages of a needle that was put elsewhere."""
        p, n = self._passages, int(self._passages.filled[0])
        if body in self._needles:
            path = self._needles.index(body)
            self._keep([c for c in range(n) if p.path[c] != path and p.owner[c] != self._paths.owner[path]])
        self._countdown[0] = 0

    def reset(self) -> None:
        """Empty all holes, and search for new passages in the next tick."""
        self._clear()
        self._countdown[0], self._turn[0], self._looked, self._followed = 0, -1, False, False
        self._near[:] = True
        self._gaps[:] = 0.0
        self._bodies.read_motions(self._search.watched, self._search.motion)
        self._place_holes(range(len(self._scene.holes)))

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
        self._looked = self._followed = False

    def _clear(self) -> None:
        """Clear the passages, and the rows of earlier ones."""
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


def _paths(scene: Scene, rods: list[Rod]) -> arrays.Paths:
    """Needles and rods as arrays, with the tissue law of each hole for each of them."""
    paths = arrays.paths(len(scene.needles) + len(rods), len(scene.holes))
    attached = {attachment.body: owner for owner, rod in enumerate(rods) for attachment in rod.description.attachments}
    for path, needle in enumerate(scene.needles):
        arc = needle.arc
        paths.centre[path], paths.x[path], paths.y[path] = arc.centre, arc.x, arc.y
        paths.radius[path], paths.begin[path], paths.end[path] = arc.radius, arc.begin, arc.end
        owner = attached.get(needle.body, -1)
        paths.owner[path] = owner
        paths.node[path] = rods[owner].node_of[needle.body] if owner >= 0 else 0
        weight = _weight(scene, [needle.body]) + (_rod_weight(rods[owner]) if owner >= 0 else 0.0)
        for hole in scene.holes:
            _set_law(paths, path, hole, weight, arc.radius)
    for owner, rod in enumerate(rods):
        path = len(scene.needles) + owner
        attached_needles = [needle.body for needle in scene.needles if attached.get(needle.body) == owner]
        weight = _rod_weight(rod) + _weight(scene, attached_needles)
        for hole in scene.holes:
            _set_law(paths, path, hole, weight, 0.0)
    return paths


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


def _set_law(paths: arrays.Paths, path: int, hole: Hole, weight: float, arm: float) -> None:
    """Springs, dampers and limits of a path in a hole; those of rotation act at an arm.

    The arm is half the opening, at whose rim tissue touches a needle; longer, up to ``arm`` metres, for heavy needles
    whose tissue scales with their weight. A thread has no arm: it turns freely.
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
    paths.stiffness[path, hole.index], paths.damping[path, hole.index] = stiffness, damping
    paths.limit[path, hole.index] = [friction, strength, strength, arm * friction, arm * strength, arm * strength]


def _lengths(rod: Rod) -> Array:
    """Length of a rod up to each of its elements, (n + 1,)."""
    ends = rod.description.ends
    return np.append(0.0, np.cumsum(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)))
