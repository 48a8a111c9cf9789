"""Scripts of experts that do one thing after the other: hand over, pull through, move a block.

They find their way by the ground truth of the simulation. World axes, metres, radians.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals import HandOver, PegTransfer, PullThrough, holds
from ligature.environments.hand import OPEN, SHUT, Hand
from ligature.model.frames import frame, inverse
from ligature.tasks.throws import BEHIND, PAD, UP, drawn_back, margin, reach

Array = NDArray[np.float64]

ASIDE = (4e-4, -4e-4, 8e-4, -8e-4)
"""Metres along the needle by which a hand that closed on nothing tries beside the place."""

AJAR = 0.5
"""Angle of the jaw at which a finger passes between the side of a block and its post, and needles slip between pads."""

ALONG, HIGH = (-0.003, 0.003), 0.001
"""Metres from the middle of a block's side at which it is grasped, beside the post, and above its middle."""


def hand_over(hand: Hand, observation: Array) -> Iterator[Array]:
    """Grasp the needle with the other hand, let go, and draw the first hand back."""
    taker = hand.other(1)
    yield from take_over(hand, taker)
    yield from hand.stay(12, OPEN)
    yield from hand.go(drawn_back(hand.tool, 0.035), OPEN)
    yield from taker.stay(60, SHUT)


def take_over(hand: Hand, taker: Hand) -> Iterator[Array]:
    """Grasp the needle, which ``hand`` holds, with ``taker`` as well."""
    goal = hand.env.goal
    assert isinstance(goal, HandOver)
    T_arc_tool = goal.grasp()
    yield from taker.go(drawn_back(taker.needle_arc @ T_arc_tool, 0.03), OPEN)
    yield from taker.go(taker.needle_arc @ T_arc_tool, OPEN)
    yield from taker.stay(14, SHUT)
    for aside in ASIDE:
        if holds(taker.simulation, taker.arm, taker.needle):
            return
        yield from taker.stay(5, AJAR)
        yield from taker.go(taker.needle_arc @ T_arc_tool @ frame(np.eye(3), np.array([aside, 0.0, 0.0])), AJAR)
        yield from taker.stay(10, SHUT)


def pull_through(hand: Hand, observation: Array, up: float = 0.04) -> Iterator[Array]:
    """Grasp the needle near its tip, turn it out along its circle, and pull the thread up."""
    goal = hand.env.goal
    assert isinstance(goal, PullThrough)
    T_arc_tool = goal.grasp()
    yield from hand.take(hand.needle_arc @ T_arc_tool)
    T_arc_tool = inverse(hand.needle_arc) @ hand.tool
    for angle in np.arange(goal.reached(), goal.out, 0.05):
        yield from hand.go(goal.throw.arc_at(float(angle), goal.arc) @ T_arc_tool, SHUT)
    yield from hand.go(hand.moved(z=up), SHUT)
    yield from hand.stay(60, SHUT)


def peg_transfer(hand: Hand, observation: Array) -> Iterator[Array]:
    """Grasp a side of the block, lift it off its post, and lower it over the other one."""
    goal = hand.env.goal
    assert isinstance(goal, PegTransfer)
    yield from grasp_side(hand, goal)
    T_block_tool = inverse(hand.needle_pose) @ hand.tool
    for T in goal.way()[1:]:
        yield from hand.go(T @ T_block_tool, SHUT)
    yield from hand.stay(12, AJAR)
    yield from hand.go(drawn_back(hand.tool, 0.02), AJAR)
    yield from hand.stay(40, AJAR)


def grasp_side(hand: Hand, goal: PegTransfer) -> Iterator[Array]:
    """Come from above with jaws that pass between side and post, and close them on the side."""
    T = hand.needle_pose @ side_grasp(hand, goal)
    yield from hand.go(drawn_back(T, BEHIND), AJAR)
    yield from hand.go(T, AJAR)
    yield from hand.stay(12, SHUT)


def side_grasp(hand: Hand, goal: PegTransfer) -> Array:
    """Pose (4, 4) of the tool in the block that is farthest from the limits of its joints on the whole way.

    Raises ValueError where the arm reaches no side of the block.
    """
    best: tuple[float, Array] | None = None
    T_block, way = hand.needle_pose, goal.way()
    for wall in goal.walls():
        for along in ALONG:
            for x in (wall[:3, 0], -wall[:3, 0]):
                R = np.column_stack([x, np.cross(-UP, x), -UP])
                T_hold = inverse(T_block) @ frame(R, wall[:3, 3] + along * wall[:3, 0] + (PAD + HIGH) * UP)
                poses = [T @ T_hold for T in way]
                before = drawn_back(poses[0], BEHIND)
                q = reach(hand.arm.kinematics, hand.base, [before, *poses], goal.target() - 0.02 * UP)
                if q is not None and (best is None or margin(hand.arm.kinematics, q) > best[0]):
                    best = margin(hand.arm.kinematics, q), T_hold
    if best is None:
        raise ValueError("the arm reaches no side of the block with which it could carry it")
    return best[1]
