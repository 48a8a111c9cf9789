"""Writes the motion of all bodies and joints of a world into a state record."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.kernels import kernel
from ligature.model.poses import compose
from ligature.model.scene import JointType, Scene
from ligature.model.state import StateRecord
from ligature.physics.articulation import Tree
from ligature.physics.bodies import Placement
from ligature.physics.motions import Motions
from ligature.physics.trees import follow, open_trees, read_tree
from ligature.tables import opener, table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

_REPORTED = (JointType.REVOLUTE, JointType.PRISMATIC, JointType.LINEAR_SPRING, JointType.TORSION_SPRING)
"""Joints whose position is reported; all others report 0 (as in AMBF)."""


class Rows(NamedTuple):
    """Where each row of the state comes from: n bodies, m joints, l reactions."""

    body: Integers  # (n,)
    body_row: Integers  # (n,) its row among the trees
    local: Array  # (n, 7) its body frame in the inertial one
    joint: Integers  # (m,)
    axis: Integers  # (m,) its axis among the trees
    turns: Flags  # (m,)
    feedback: Flags  # (m,)
    loaded: Integers  # (l,) body that bears a reaction
    measured: Integers  # (l,) axis that carries it


class Written(NamedTuple):
    """The fields of a state record that are written here."""

    body_pose: Array
    body_twist: Array
    body_wrench: Array
    joint_position: Array
    joint_velocity: Array
    joint_effort: Array


def _example(kind: type[Any], **shapes: tuple[int, ...]) -> Any:
    """A group with real arrays of these shapes, and with whole numbers (1,) otherwise."""
    return kind(**{name: np.zeros(shapes[name]) if name in shapes else np.zeros(1, np.int64) for name in kind._fields})


_rows = _example(Rows, local=(1, 7))._replace(turns=np.zeros(1, np.bool_), feedback=np.zeros(1, np.bool_))
open_rows = opener(_rows)
open_written = opener(Written(*(np.zeros(shape) for shape in ((1, 7), (1, 6), (1, 6), 1, 1, 1))))


@kernel
def write_state(handle: int, tree_table: Integers, row_table: Integers, state_table: Integers) -> None:
    """Write poses, twists, joints and wrenches; without a handle, bases and joints are up to date."""
    trees, rows, out = open_trees(tree_table), open_rows(row_table), open_written(state_table)
    for k in range(trees.uid.shape[0]):
        if handle != 0 and not trees.read[k]:
            read_tree(handle, trees, k)
        if not trees.linked[k]:
            follow(trees, k)
    for i in range(rows.body.shape[0]):
        row, body = rows.body_row[i], rows.body[i]
        compose(trees.pose[row], rows.local[i], out.body_pose[body])
        for a in range(6):
            out.body_twist[body, a] = trees.twist[row, a]
    for i in range(rows.joint.shape[0]):
        joint, axis = rows.joint[i], rows.axis[i]
        angle = trees.joints[0, axis]
        if rows.turns[i] and abs(angle) > np.pi:
            angle = (angle + np.pi) % (2 * np.pi) - np.pi
        out.joint_position[joint], out.joint_velocity[joint] = angle, trees.joints[1, axis]
        out.joint_effort[joint] = trees.joints[2, axis] if rows.feedback[i] else 0.0
    for i in range(rows.loaded.shape[0]):
        for a in range(6):
            out.body_wrench[rows.loaded[i], a] = 0.0
    for i in range(rows.loaded.shape[0]):
        for a in range(6):
            out.body_wrench[rows.loaded[i], a] += trees.reaction[rows.measured[i], a]


class Readout:
    """The state of all trees of a world."""

    def __init__(
        self,
        client: int,
        scene: Scene,
        trees: Sequence[Tree],
        motions: Motions,
        place_of: Mapping[int, Placement],
    ) -> None:
        self._motions = motions
        axes = [
            (motions.slices[k].start + i, link, k, scene.joints[joint])
            for k, tree in enumerate(trees)
            for i, (link, joint, _, _) in enumerate(tree.axes)
        ]
        # of a joint with several axes, the last one carries the body
        reported = {joint.index: (row, joint) for row, _, _, joint in axes if joint.type in _REPORTED}
        measured = {joint.index: (joint.child, row) for row, _, _, joint in axes if joint.feedback}
        places = list(place_of.values())
        self._rows = Rows(
            body=_whole(place_of),
            body_row=_whole(place.row for place in places),
            local=np.array([place.inertial_to_body for place in places]).reshape(-1, 7),
            joint=_whole(reported),
            axis=_whole(row for row, _ in reported.values()),
            turns=np.array([joint.type is JointType.REVOLUTE for _, joint in reported.values()], dtype=bool),
            feedback=np.array([joint.feedback for _, joint in reported.values()], dtype=bool),
            loaded=_whole(child for child, _ in measured.values()),
            measured=_whole(row for _, row in measured.values()),
        )
        self._table = table_of(self._rows)
        self._state: StateRecord | None = None
        self._state_table = np.zeros(0, np.int64)
        for _, link, tree, joint in axes:
            if joint.feedback:
                motions.measure(tree)
                pybullet.enableJointForceTorqueSensor(trees[tree].uid, link, True, physicsClientId=client)

    def write(self, state: StateRecord) -> None:
        """Fill a state record."""
        if state is not self._state:
            self._state = state
            self._state_table = table_of(Written(*(state[name][0] for name in Written._fields)))
        self._motions.prepare()
        write_state(self._motions.handle, self._motions.table, self._table, self._state_table)


def _whole(numbers: Iterable[int]) -> Integers:
    """Whole numbers as an array."""
    return np.array(list(numbers), dtype=np.int64)
