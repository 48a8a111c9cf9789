"""Writes the motion of all bodies and joints of a world into a state record."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.kernels import compiled
from ligature.model.poses import compose
from ligature.model.scene import JointType, Scene
from ligature.model.state import StateRecord
from ligature.physics.articulation import Tree
from ligature.physics.bodies import Placement
from ligature.physics.motions import Motions

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

_REPORTED = (JointType.REVOLUTE, JointType.PRISMATIC, JointType.LINEAR_SPRING, JointType.TORSION_SPRING)
"""Joints whose position is reported; all others report 0 (ADF specification §15.5)."""


@compiled
def _write_bodies(
    rows: Integers, bodies: Integers, local: Array, pose: Array, twist: Array, body_pose: Array, body_twist: Array
) -> None:
    """Write poses and twists of ``rows`` to rows ``bodies`` (n,), with the body frames ``local`` (n, 7)."""
    for i in range(rows.shape[0]):
        row, body = rows[i], bodies[i]
        compose(pose[row], local[i], body_pose[body])
        for a in range(6):
            body_twist[body, a] = twist[row, a]


@compiled
def _write_wrenches(measured: Integers, loaded: Integers, reaction: Array, wrench: Array) -> None:
    """Add up the reactions of the axes ``measured`` (n,) on the bodies ``loaded`` (n,)."""
    wrench[:] = 0.0
    for i in range(measured.shape[0]):
        for a in range(6):
            wrench[loaded[i], a] += reaction[measured[i], a]


@compiled
def _write_joints(
    joints: Integers, axes: Integers, turns: Flags, feedback: Flags, q: Array, qd: Array, tau: Array,
    position: Array, velocity: Array, effort: Array,
) -> None:  # fmt: skip
    """Write revolute positions within -pi … pi, and efforts of joints with feedback, to rows ``joints`` (n,)."""
    for i in range(joints.shape[0]):
        joint, axis = joints[i], axes[i]
        angle = q[axis]
        if turns[i] and abs(angle) > np.pi:
            angle = (angle + np.pi) % (2 * np.pi) - np.pi
        position[joint], velocity[joint] = angle, qd[axis]
        effort[joint] = tau[axis] if feedback[i] else 0.0


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
        self._bodies = np.array(list(place_of), dtype=np.int64)
        self._rows = np.array([place.row for place in place_of.values()], dtype=np.int64)
        self._local = np.array([place.inertial_to_body for place in place_of.values()]).reshape(-1, 7)
        axes = [
            (motions.slices[k].start + i, link, k, scene.joints[joint])
            for k, tree in enumerate(trees)
            for i, (link, joint, _, _) in enumerate(tree.axes)
        ]
        # of a joint with several axes, the last one carries the body
        reported = {joint.index: (row, joint) for row, _, _, joint in axes if joint.type in _REPORTED}
        self._joints = np.array(list(reported), dtype=np.int64)
        self._axes = np.array([row for row, _ in reported.values()], dtype=np.int64)
        self._turns = np.array([joint.type is JointType.REVOLUTE for _, joint in reported.values()], dtype=bool)
        self._feedback = np.array([joint.feedback for _, joint in reported.values()], dtype=bool)
        measured = {joint.index: (joint.child, row) for row, _, _, joint in axes if joint.feedback}
        self._loaded = np.array([child for child, _ in measured.values()], dtype=np.int64)
        self._measured = np.array([row for _, row in measured.values()], dtype=np.int64)
        for _, link, tree, joint in axes:
            if joint.feedback:
                motions.measure(tree)
                pybullet.enableJointForceTorqueSensor(trees[tree].uid, link, True, physicsClientId=client)

    def write(self, state: StateRecord) -> None:
        """Fill a state record."""
        motions = self._motions
        motions.everything()
        record = state[0]
        _write_bodies(
            self._rows, self._bodies, self._local, motions.pose, motions.twist, record["body_pose"],
            record["body_twist"],
        )  # fmt: skip
        _write_joints(
            self._joints, self._axes, self._turns, self._feedback, motions.position, motions.velocity, motions.effort,
            record["joint_position"], record["joint_velocity"], record["joint_effort"],
        )  # fmt: skip
        if len(self._loaded):
            _write_wrenches(self._measured, self._loaded, motions.reaction, record["body_wrench"])
