"""How easily bodies move, for solvers beside Bullet that push them; world axes, SI units."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ligature.model.scene import Scene
from ligature.physics.articulation import MOST_DAMPED, STIFFEST, Tree
from ligature.physics.inertias import inertia_of

Array = NDArray[np.float64]


def mobility(scene: Scene, tree: Tree, body: int, dt: float) -> Array:
    """Change (6, 6) of the twist of ``body`` for a unit of impulse and moment at its centre of mass.

    At the initial pose. A body on one joint of a static one moves along the free axes of the joint, whose
    springs and dampers resist over a tick of ``dt``; any other movable body as if it were free.
    """
    description = scene.bodies[body]
    if description.static:
        return np.zeros((6, 6))
    T = description.T_world_body @ description.T_body_inertial
    own = [entry for entry in tree.axes if body in (scene.joints[entry[1]].parent, scene.joints[entry[1]].child)]
    joint = scene.joints[own[0][1]] if own else None
    on_static = joint is not None and scene.bodies[joint.parent].static and all(e[1] == joint.index for e in own)
    if joint is None or not on_static:
        R = T[:3, :3]
        free = np.zeros((6, 6))
        free[:3, :3] = np.eye(3) / description.mass
        free[3:, 3:] = (R / inertia_of(description)) @ R.T
        return free
    parent = scene.bodies[joint.parent]
    T_world_frame = parent.T_world_body @ parent.T_body_inertial @ joint.T_parent_a
    arm = T[:3, 3] - T_world_frame[:3, 3]
    moves = np.zeros((6, 6))
    for _, _, axis, moved in own:
        direction = T_world_frame[:3, :3] @ axis.direction
        row = np.r_[direction, np.zeros(3)] if axis.prismatic else np.r_[np.cross(direction, arm), direction]
        damping = min(dt * axis.damping, MOST_DAMPED * moved)
        stiffness = min(dt * dt * axis.stiffness, moved / STIFFEST)
        moves += np.outer(row, row) / (moved + damping + stiffness)
    return moves
