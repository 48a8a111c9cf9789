"""Where the bodies of a world are and how they move, read from Bullet after each tick.

Bases and joints are read; the links follow from both by forward kinematics, when somebody asks, which costs a tenth of
asking Bullet. Poses are x y z qx qy qz qw of inertial frames I in world axes, twists linear at the centre of mass, then
angular; joints in radians or metres.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.physics import trees as kernels
from ligature.physics.articulation import Tree
from ligature.physics.parking import Boxes
from ligature.tables import table_of

Array = NDArray[np.float64]


class Motions:
    """Motion of everything in one Bullet world.

    Every tree has one row for its base and one for each link, in order; call `base`, `joints` or `links` with the
    index of a tree before its rows are used.

    Attributes
    ----------
    trees, table
        All arrays, and their addresses for compiled code.
    pose, twist
        (r, 7) and (r, 6) of all rows.
    position, velocity, effort
        (a,) of all single axes of all trees.
    push
        (a,) efforts that the controllers apply in the coming tick.
    force
        (r, 3) forces at the centres of mass, for `apply_gravity`.
    """

    def __init__(
        self, client: int, handle: int, trees: Sequence[Tree], sleepers: Sequence[Sequence[int]], compared: Boxes
    ) -> None:
        self._client, self.handle = client, handle
        rows = np.cumsum([0, *(1 + len(tree.frames) for tree in trees)])
        axes = np.cumsum([0, *(len(tree.axes) for tree in trees)])
        arrays = self.trees = kernels.trees(len(trees), int(rows[-1]), int(axes[-1]), sum(map(len, sleepers)), compared)
        arrays.sleepers[:] = [sleeper for found in sleepers for sleeper in found]
        arrays.sleepers_begin[1:] = np.cumsum([len(found) for found in sleepers])
        arrays.uid[:] = [tree.uid for tree in trees]
        arrays.begin[:], arrays.first[:] = rows, axes
        arrays.going[:], arrays.turning[:] = [not tree.static for tree in trees], [bool(tree.axes) for tree in trees]
        arrays.link[:] = [link for tree in trees for link, *_ in tree.axes]
        arrays.middle[:] = [way for tree in trees for way in tree.ways_to_middle]
        self._begin = rows.tolist()
        self.slices = [slice(a, b) for a, b in zip(axes[:-1].tolist(), axes[1:].tolist(), strict=True)]
        for k, tree in enumerate(trees):
            self._lay_out(k, tree)
        self.table = table_of(arrays)
        self.pose, self.twist, self.force, self.push = arrays.pose, arrays.twist, arrays.force, arrays.push
        self.position, self.velocity, self.effort = arrays.joints
        self._links = [[link for link, *_ in tree.axes] for tree in trees]
        self._uids = [tree.uid for tree in trees]
        self._tree_of = [k for k, tree in enumerate(trees) for _ in tree.axes]

    def _lay_out(self, tree_index: int, tree: Tree) -> None:
        """Fill the rows of one tree."""
        begin, end = self._begin[tree_index], self._begin[tree_index + 1]
        self.trees.mass[begin:end], self.trees.inertia[begin:end] = tree.masses, tree.inertias
        first = self.slices[tree_index].start
        joint_of = {link: first + i for i, (link, *_) in enumerate(tree.axes)}
        for link, frame in enumerate(tree.frames):
            row = begin + 1 + link
            self.trees.rows[row] = begin + frame.parent, frame.type, joint_of.get(link, -1)
            self.trees.fixed[row] = np.concatenate([frame.axis, frame.parent_link, frame.link_inertial])

    def row(self, tree: int, link: int) -> int:
        """Row of a link; -1 is the base."""
        return int(self._begin[tree] + 1 + link)

    def apply_gravity(self, tree: int) -> None:
        """Add what `force` does to the joints of a tree to `push`."""
        self.links(tree)
        kernels.load_one(self.table, tree)

    def drive(self, tree: int, driven: NDArray[np.bool_]) -> None:
        """From now on motors drive the axes of a tree that are ``driven``: Bullet keeps the last effort of a motor."""
        self.trees.limp[self.slices[tree]] = ~driven
        for beside in (self.trees.foreseen, self.trees.pressed):
            beside[self.slices[tree]] *= driven
        self.rouse(tree)

    def send(self, axis: int, effort: float | None) -> None:
        """From now on an axis of the world reports another effort than its motor's; None ends that."""
        self.trees.sent[axis], self.trees.sent_effort[axis] = effort is not None, effort or 0.0
        self.rouse(self._tree_of[axis])

    def measure(self, tree: int) -> None:
        """Fill `Trees.reaction` for the axes of a tree from now on."""
        self.trees.measured[tree] = True
        self.rouse(tree)

    def rouse(self, tree: int) -> None:
        """Something acts on a tree: Bullet is not to pass over it in the coming tick."""
        self.trees.quiet[tree] = False

    def rouse_all(self) -> None:
        """Something that is not a tree's own changes, as what collides or is welded."""
        self.trees.quiet[:] = False

    # --- the tick ---------------------------------------------------------------------------

    def step(self, limit: float) -> bool:
        """Advance Bullet by a tick; whether all velocities are finite and no larger than bodies may have.

        That is ``limit`` for bodies without joints, `MAX_RATE` or less for coordinates of trees that have some.
        """
        if self.handle:
            return bool(kernels.step_world(self.handle, self.table, limit))
        pybullet.stepSimulation(physicsClientId=self._client)
        kernels.expire(self.table)
        self.read_all()
        for tree in range(len(self._uids)):
            if kernels.creeps_one(self.table, tree):
                self.halt(tree)
        self.trees.quiet[:] = True
        return bool(kernels.sound(self.table, limit))

    def halt(self, tree: int) -> None:
        """Let the joints of a tree, which was read, stand where they are."""
        rows = self.slices[tree]
        self.velocity[rows] = 0.0
        for link, position in zip(self._links[tree], self.position[rows].tolist(), strict=True):
            pybullet.resetJointState(self._uids[tree], link, position, 0.0, physicsClientId=self._client)

    def begin(self) -> None:
        """No tick is over yet, so that no motor has an effort and no joint a reaction: Bullet has those of before."""
        self.trees.ticks[0] = 0
        self.trees.last_motor[:] = np.nan
        self.forget_all()

    def forget(self, tree: int) -> None:
        """A tree was put elsewhere; what rests on one that stands is to notice it."""
        self.trees.read[tree] = self.trees.linked[tree] = False
        self.trees.boxes.moved[tree] = np.inf
        self.rouse(tree)
        if not self.trees.going[tree]:
            self._read_base(tree)
            self.rouse_all()

    def forget_all(self) -> None:
        """Everything was put elsewhere."""
        for tree in range(len(self._uids)):
            self.forget(tree)

    # --- reading ----------------------------------------------------------------------------

    def base(self, tree: int) -> None:
        """Bring pose and twist of the base up to date."""
        if not self.trees.read[tree]:
            self._read(tree)

    def joints(self, tree: int) -> Array:
        """Bring the joints of a tree up to date; returns position, velocity and effort (3, k) of its axes."""
        if not self.trees.read[tree]:
            self._read(tree)
        return self.trees.joints[:, self.slices[tree]]

    def links(self, tree: int) -> None:
        """Bring all rows of a tree up to date."""
        if not self.trees.linked[tree]:
            self.base(tree)
            kernels.link_one(self.table, tree)

    def everything(self) -> None:
        """Bring all rows up to date."""
        self.read_all()
        kernels.link_trees(self.table)

    def prepare(self) -> None:
        """Read for compiled code what it cannot read itself: that takes a handle."""
        if not self.handle:
            self.read_all()

    def read_all(self) -> None:
        """Bring all bases and joints up to date."""
        if not self.trees.read.all():
            for tree in np.flatnonzero(~self.trees.read).tolist():
                self._read(tree)

    def _read(self, tree: int) -> None:
        """Read base and joints of a tree; a static base was read when it was placed."""
        if self.handle:
            kernels.read_one(self.handle, self.table, tree)
            return
        arrays = self.trees
        if arrays.going[tree]:
            self._read_base(tree)
        links, rows = self._links[tree], self.slices[tree]
        if links:
            states = pybullet.getJointStates(self._uids[tree], links, physicsClientId=self._client)
            self.position[rows], self.velocity[rows], reaction, effort = zip(*states, strict=True)
            silent = (arrays.ticks[0] == 0) | arrays.limp[rows]
            whole = np.where(silent, 0.0, effort + arrays.foreseen[rows] + arrays.pressed[rows])
            self.effort[rows] = np.where(arrays.sent[rows], arrays.sent_effort[rows], whole)
            if arrays.measured[tree]:
                arrays.reaction[rows] = np.zeros(6) if arrays.ticks[0] == 0 else reaction
        arrays.read[tree] = True

    def _read_base(self, tree: int) -> None:
        """Read the base. A static one is read only when it is placed: Bullet changes its last bits in each tick."""
        at, around = pybullet.getBasePositionAndOrientation(self._uids[tree], physicsClientId=self._client)
        linear, angular = pybullet.getBaseVelocity(self._uids[tree], physicsClientId=self._client)
        self.pose[self._begin[tree]], self.twist[self._begin[tree]] = at + around, linear + angular

    def speeds(self, tree: int) -> list[float]:
        """Velocities of a tree's base and joints."""
        found: list[float] = self.twist[self._begin[tree]].tolist() + self.velocity[self.slices[tree]].tolist()
        return found
