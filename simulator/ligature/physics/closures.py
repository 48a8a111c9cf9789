"""Joints that no tree holds: loops and point-to-point joints, as Bullet constraints.

A revolute loop is held by two points on its axis; pivots are given in the inertial frames.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.frames import matrix_quaternion
from ligature.model.scene import Joint, JointType, Scene
from ligature.physics.bodies import Placement

Array = NDArray[np.float64]

MAX_FORCE = 1e5
"""Force in newtons that a closure may use; enough for any arm, finite so that a jam does not explode."""

HALF_AXIS = 0.05
"""Distance in metres from the pivot of the two points that hold an axis."""


class Closures:
    """The constraints of a scene's loops."""

    def __init__(
        self,
        client: int,
        scene: Scene,
        place_of: Mapping[int, Placement],
        report: Callable[[Diagnostic], None],
    ) -> None:
        self._client = client
        self._place_of = place_of
        self._report = report
        self.ids: list[int] = []
        for index in scene.loops:
            joint = scene.joints[index]
            if joint.parent in place_of and joint.child in place_of:
                self._hold(joint)

    def _hold(self, joint: Joint) -> None:
        T_a, T_b = joint.T_parent_a, joint.T_child_b
        if joint.type is JointType.P2P:
            self._point(joint, T_a[:3, 3], T_b[:3, 3])
        elif joint.type is JointType.REVOLUTE:
            for side in (HALF_AXIS, -HALF_AXIS):
                self._point(joint, T_a[:3, 3] + side * T_a[:3, 2], T_b[:3, 3] + side * T_b[:3, 2])
        elif joint.type is JointType.FIXED:
            self._frames(joint, pybullet.JOINT_FIXED, np.zeros(3))
        elif joint.type is JointType.PRISMATIC:
            self._frames(joint, pybullet.JOINT_PRISMATIC, np.array([1.0, 0.0, 0.0]))
        else:
            message = f"joint '{joint.identity.key}' closes a loop; a '{joint.type.value}' joint cannot do that here"
            self._report(
                Diagnostic(
                    Severity.WARNING,
                    message,
                    joint.identity.mark,
                    "its bodies stay apart; use revolute or p2p",
                    "loop",
                )
            )

    def _point(self, joint: Joint, on_parent: Array, on_child: Array) -> None:
        self._create(joint, pybullet.JOINT_POINT2POINT, np.zeros(3), on_parent, on_child, {})

    def _frames(self, joint: Joint, type_: int, axis: Array) -> None:
        orientations = {
            "parentFrameOrientation": matrix_quaternion(joint.T_parent_a[:3, :3]).tolist(),
            "childFrameOrientation": matrix_quaternion(joint.T_child_b[:3, :3]).tolist(),
        }
        self._create(joint, type_, axis, joint.T_parent_a[:3, 3], joint.T_child_b[:3, 3], orientations)

    def _create(
        self,
        joint: Joint,
        type_: int,
        axis: Array,
        on_parent: Array,
        on_child: Array,
        more: dict[str, list[float]],
    ) -> None:
        parent, child = self._place_of[joint.parent], self._place_of[joint.child]
        constraint = pybullet.createConstraint(
            parent.uid, parent.link, child.uid, child.link, type_, axis.tolist(), on_parent.tolist(),
            on_child.tolist(), physicsClientId=self._client, **more,
        )  # fmt: skip
        pybullet.changeConstraint(constraint, maxForce=MAX_FORCE, physicsClientId=self._client)
        self.ids.append(int(constraint))
