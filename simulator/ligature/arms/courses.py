"""Whether arms are where their set-points are, for compiled code that passes many ticks. Radians, metres."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.kernels import inlined
from ligature.model.state import ARM_JOINTS
from ligature.physics.bullet import real_at
from ligature.physics.trees import bring_up, open_trees
from ligature.robots.arm import Arm
from ligature.tables import opener, table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]
Flags = NDArray[np.bool_]

WATCH_PERIOD = 5
"""Ticks between two checks of following errors."""


class CourseArrays(NamedTuple):
    """The arms of a scene, m of them."""

    due: Integers  # (1,) ticks until the next check of following errors
    watched: Flags  # (m,) whether there is anything to check
    joints: Integers  # (m,) number of joints
    own: Integers  # (m,) address of the state of the joints, 0 where trees have it
    axes: Integers  # (m, 7) their axes among the trees
    aim: Integers  # (m,) address of their set-points
    bounds: Array  # (m, 7) of following errors


def _arrays(m: int) -> CourseArrays:
    z, whole = np.zeros, np.int64
    return CourseArrays(
        due=z(1, whole), watched=z(m, np.bool_), joints=z(m, whole), own=z(m, whole), axes=z((m, ARM_JOINTS), whole),
        aim=z(m, whole), bounds=z((m, ARM_JOINTS)),
    )  # fmt: skip


_open_courses = opener(_arrays(1))


@inlined
def strays(handle: int, tree_table: Integers, table: Integers, passed: int) -> bool:
    """Whether following errors are to be checked after ``passed`` ticks, and one is beyond its bound.

    ``table`` is that of `Courses`, empty without arms.
    """
    if table.shape[0] == 0:
        return False
    c = _open_courses(table)
    if passed < c.due[0] or (passed - c.due[0]) % WATCH_PERIOD != 0:
        return False
    trees, follows = open_trees(tree_table), True
    for k in range(trees.uid.shape[0]):
        bring_up(handle, trees, k, False)
    for m in range(c.joints.shape[0]):
        if c.watched[m]:
            for j in range(c.joints[m]):
                now = real_at(c.own[m], j) if c.own[m] != 0 else trees.joints[0, c.axes[m, j]]
                follows = follows and abs(now - real_at(c.aim[m], j)) <= c.bounds[m, j]  # so that NaN does not follow
    return not follows


class Courses:
    """The set-points of ``arms`` and where their joints are.

    Attributes
    ----------
    table
        What `strays` takes.
    """

    def __init__(self, arms: Sequence[Arm]) -> None:
        self._arms = tuple(arms)
        arrays = self._arrays = _arrays(len(arms))
        for m, arm in enumerate(arms):
            state, axes = arm.joints.plant.source()
            arrays.joints[m] = arm.joints.n
            arrays.own[m] = 0 if state is None else state.ctypes.data
            arrays.axes[m, : len(axes)] = axes[:, 0]
            arrays.aim[m] = arm.joints.setpoint.ctypes.data
        self.table: Integers = table_of(arrays) if arms else np.zeros(0, np.int64)

    def watch(self, due: int) -> bool:
        """Have `strays` check from ``due`` ticks on what is to be checked; False where an arm was astray before."""
        arrays = self._arrays
        arrays.due[0] = due
        for m, arm in enumerate(self._arms):
            watched = arrays.watched[m] = arm.is_watched
            if watched:
                if arm.is_astray:
                    return False
                arrays.bounds[m, : arm.joints.n] = arm.following_bounds
        return True
