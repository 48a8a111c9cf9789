"""Reads the whole state out of Bullet with as few calls as there are trees that can move."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.model.poses import compose_rows
from ligature.model.scene import JointType, Scene
from ligature.model.state import StateRecord
from ligature.physics.articulation import Tree
from ligature.physics.bodies import Placement
from ligature.physics.control import TreeControl

Array = NDArray[np.float64]

_REPORTED = (JointType.REVOLUTE, JointType.PRISMATIC, JointType.LINEAR_SPRING, JointType.TORSION_SPRING)
"""Joints whose position is reported; all others report 0 (ADF specification §15.5)."""


class _Links:
    """The links of one tree: which bodies they carry and how their body frames sit."""

    def __init__(self, client: int, tree: Tree, place_of: Mapping[int, Placement]) -> None:
        self._client, self._uid = client, tree.uid
        pairs = [(body, link) for body, link in tree.link_of.items() if link >= 0]
        self._links = [link for _, link in pairs]
        self._bodies = np.array([body for body, _ in pairs], dtype=np.int64)
        self._local = np.array([place_of[body].inertial_to_body for body, _ in pairs]).reshape(-1, 7)

    def write(self, poses: Array, twists: Array) -> None:
        """Write poses (bodies, 7) and twists (bodies, 6)."""
        states = pybullet.getLinkStates(
            self._uid, self._links, computeLinkVelocity=1, computeForwardKinematics=1, physicsClientId=self._client
        )
        compose_rows(np.array([s[0] + s[1] for s in states]), self._local, self._bodies, poses)
        twists[self._bodies] = [s[6] + s[7] for s in states]


class _Joints:
    """The reported joints of one tree."""

    def __init__(self, scene: Scene, control: TreeControl) -> None:
        self._control = control
        rows = [(joint, row) for joint, row in control.row.items() if scene.joints[joint].type in _REPORTED]
        self._joints = np.array([joint for joint, _ in rows], dtype=np.int64)
        self._rows = np.array([row for _, row in rows], dtype=np.int64)
        self._turns = np.array([scene.joints[j].type is JointType.REVOLUTE for j in self._joints], dtype=bool)
        self._feedback = np.array([scene.joints[j].feedback for j in self._joints], dtype=bool)

    def write(self, position: Array, velocity: Array, effort: Array) -> None:
        """Write positions (revolute ones within -pi … pi), velocities and efforts of all joints of the scene."""
        control = self._control
        control.read()
        q = control.position[self._rows]
        around = self._turns & (np.abs(q) > np.pi)
        position[self._joints] = np.where(around, (q + np.pi) % (2 * np.pi) - np.pi, q)
        velocity[self._joints] = control.velocity[self._rows]
        effort[self._joints] = np.where(self._feedback, control.motor_effort[self._rows], 0.0)


class Readout:
    """The state of all trees of a world."""

    def __init__(
        self,
        client: int,
        scene: Scene,
        trees: Sequence[Tree],
        controls: Sequence[TreeControl],
        place_of: Mapping[int, Placement],
    ) -> None:
        self._client = client
        self._roots = [(tree.root, place_of[tree.root]) for tree in trees]
        self._links = [_Links(client, tree, place_of) for tree in trees if tree.moving_links]
        self._joints = [_Joints(scene, control) for control in controls if control.links]
        self._feedback = [
            (scene.joints[joint].child, tree.uid, link)
            for tree in trees
            for link, joint, _, _ in tree.axes
            if scene.joints[joint].feedback
        ]
        for _, uid, link in self._feedback:
            pybullet.enableJointForceTorqueSensor(uid, link, True, physicsClientId=client)

    def write(self, state: StateRecord) -> None:
        """Fill a state record; static bodies only when they were put elsewhere."""
        poses, twists = state["body_pose"][0], state["body_twist"][0]
        for body, place in self._roots:
            if place.moved or not place.body.static:
                place.read(poses[body], twists[body])
                place.moved = False
        for links in self._links:
            links.write(poses, twists)
        for joints in self._joints:
            joints.write(state["joint_position"][0], state["joint_velocity"][0], state["joint_effort"][0])
        if self._feedback:
            wrench = state["body_wrench"][0]
            wrench[:] = 0.0
            for child, uid, link in self._feedback:
                wrench[child] += pybullet.getJointState(uid, link, physicsClientId=self._client)[2]
