"""Cheats of `cheats` for tasks that hand the needle over, pull the thread through, move a block, sew and make knots."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import numpy as np
from ligature.environments.experts import suture
from ligature.environments.goals import FirstThrow, Suture, holds
from ligature.environments.goals.ligating import LEFT, RIGHT, holding
from ligature.environments.hand import OPEN, SHUT, TIGHT, Hand
from ligature.environments.knotting import Knotter
from ligature.environments.scripts import AJAR, grasp_side, pull_through, take_over
from ligature.environments.tying import AWAY, DRAW, Tier, first_throw
from ligature.model.frames import frame, inverse
from ligature.tasks.throws import PAD, UP, drawn_back

Array = np.ndarray


def on_the_thread(hand: Hand, number: int) -> Array:
    """Pose (4, 4) of the upright tool at which its jaws close on the thread, so many elements from the needle."""
    bodies = list(hand.simulation.scene.rods[0].bodies)
    points = hand.simulation.state["body_pose"][0, bodies, :3]
    tail = hand.env.goal.scenery.needle_points(hand.simulation.state["body_pose"][0])[0]
    nearest = int(np.argmin(np.linalg.norm(points - tail, axis=1)))
    k = int(np.clip(nearest + (number if nearest < len(points) / 2 else -number), 1, len(points) - 2))
    along = points[k + 1] - points[k - 1]
    along = along - (along @ UP) * UP
    x = along / np.linalg.norm(along)
    x = x if x @ hand.tool[:3, 0] > 0.0 else -x
    return frame(np.column_stack([x, np.cross(-UP, x), -UP]), points[k] + PAD * UP)


# --- hand_over ------------------------------------------------------------------------------


def drop(hand: Hand, observation: Array) -> Iterator[Array]:
    """let go of the needle at once"""
    yield from hand.stay(12, OPEN)
    yield from hand.go(drawn_back(hand.tool, 0.035), OPEN)
    yield from hand.stay(40, OPEN)


def both_keep_it(hand: Hand, observation: Array) -> Iterator[Array]:
    """grasp the needle with both hands and keep it so"""
    taker = hand.other(1)
    yield from take_over(hand, taker)
    yield from taker.stay(80, SHUT)


def stay_there(hand: Hand, observation: Array) -> Iterator[Array]:
    """take the needle, and leave the open hand where it is"""
    taker = hand.other(1)
    yield from take_over(hand, taker)
    yield from hand.stay(80, OPEN)


def take_air(hand: Hand, observation: Array) -> Iterator[Array]:
    """close the other hand 5 mm beside the needle and draw the first one back"""
    taker = hand.other(1)
    T = taker.needle_arc @ hand.env.goal.grasp()
    yield from taker.take(drawn_back(T, 0.005))
    yield from hand.stay(12, OPEN)
    yield from hand.go(drawn_back(hand.tool, 0.035), OPEN)
    yield from taker.stay(40, SHUT)


def take_the_thread(hand: Hand, observation: Array) -> Iterator[Array]:
    """take the thread with the other hand, and let go of the needle"""
    taker = hand.other(1)
    yield from taker.take(on_the_thread(taker, 3))
    yield from hand.stay(12, OPEN)
    yield from hand.go(drawn_back(hand.tool, 0.035), OPEN)
    yield from taker.stay(60, SHUT)


def swing_away(hand: Hand, observation: Array) -> Iterator[Array]:
    """carry the needle away from the other hand"""
    yield from hand.go(hand.moved(x=0.03, z=0.02), SHUT)
    yield from hand.stay(80, SHUT)


# --- pull_through ---------------------------------------------------------------------------


def hold_in_place(hand: Hand, observation: Array) -> Iterator[Array]:
    """grasp the needle and keep it where it is"""
    yield from hand.take(hand.needle_arc @ hand.env.goal.grasp())
    yield from hand.stay(100, SHUT)


def push_back(hand: Hand, observation: Array) -> Iterator[Array]:
    """grasp the needle and turn it back out of the entry"""
    goal = hand.env.goal
    yield from hand.take(hand.needle_arc @ goal.grasp())
    T_arc_tool = inverse(hand.needle_arc) @ hand.tool
    for angle in np.arange(goal.reached(), -1.0, -0.05):
        yield from hand.go(goal.throw.arc_at(float(angle), goal.arc) @ T_arc_tool, SHUT)


def needle_alone(hand: Hand, observation: Array) -> Iterator[Array]:
    """pull the needle out, and none of the thread"""
    yield from pull_through(hand, observation, up=0.0)


def pull_and_let_go(hand: Hand, observation: Array) -> Iterator[Array]:
    """pull the thread through and let go at once"""
    goal = hand.env.goal
    for action in pull_through(hand, observation):
        if goal.marks()[2] >= 1.0:
            break
        yield action
    yield from hand.stay(60, OPEN)


def pull_the_thread_back(hand: Hand, observation: Array) -> Iterator[Array]:
    """pull the thread before the entry instead of the needle"""
    yield from hand.take(on_the_thread(hand, 4))
    yield from hand.go(hand.moved(z=0.05), SHUT)
    yield from hand.stay(60, SHUT)


def lift_nothing(hand: Hand, observation: Array) -> Iterator[Array]:
    """close the jaws 5 mm behind the needle and lift them"""
    yield from hand.take(drawn_back(hand.needle_arc @ hand.env.goal.grasp(), 0.005))
    yield from hand.go(hand.moved(z=0.05), SHUT)
    yield from hand.stay(40, SHUT)


# --- peg_transfer ---------------------------------------------------------------------------


def carried(hand: Hand, first: int, last: int, aside: float = 0.0) -> Iterator[Array]:
    """Grasp the block and take it along a part of its way, moved aside at its end."""
    goal = hand.env.goal
    way = goal.way()
    yield from grasp_side(hand, goal)
    T_block_tool = inverse(hand.needle_pose) @ hand.tool
    for k in range(first, last):
        shift = np.array([0.0, aside if k >= 2 else 0.0, 0.0])
        yield from hand.go(frame(np.eye(3), shift) @ way[k] @ T_block_tool, SHUT)


def keep_it(hand: Hand, observation: Array) -> Iterator[Array]:
    """lower the block over the post and never let go"""
    yield from carried(hand, 1, 4)
    yield from hand.stay(80, SHUT)


def knock_it_off(hand: Hand, observation: Array) -> Iterator[Array]:
    """push the block with shut jaws, towards the other post"""
    way = hand.env.goal.way()
    start, end = way[0][:3, 3], way[-1][:3, 3]
    push = (end - start) / np.linalg.norm(end - start)
    R = hand.tool[:3, :3]
    yield from hand.go(frame(R, start - 0.02 * push + 0.02 * UP), SHUT)
    yield from hand.go(frame(R, start - 0.02 * push + 0.003 * UP), SHUT)
    yield from hand.go(frame(R, end + 0.003 * UP), SHUT)
    yield from hand.stay(30, SHUT)


def put_back(hand: Hand, observation: Array) -> Iterator[Array]:
    """lift the block and lower it over its own post again"""
    yield from carried(hand, 1, 2)
    yield from hand.go(hand.moved(z=-0.02), SHUT)
    yield from hand.stay(12, AJAR)
    yield from hand.go(hand.moved(z=0.03), AJAR)


def put_beside(hand: Hand, observation: Array) -> Iterator[Array]:
    """put the block down 12 mm beside the post"""
    yield from carried(hand, 1, 4, 0.012)
    yield from hand.stay(12, AJAR)
    yield from hand.go(hand.moved(z=0.03), AJAR)
    yield from hand.stay(40, AJAR)


def hold_over(hand: Hand, observation: Array) -> Iterator[Array]:
    """hold the block above the post"""
    yield from carried(hand, 1, 3)
    yield from hand.stay(80, SHUT)


# --- suture ---------------------------------------------------------------------------------


def sewn(hand: Hand, observation: Array, until: Callable[[Suture], bool]) -> Iterator[Array]:
    """What the expert does until something is so."""
    goal = hand.env.goal
    assert isinstance(goal, Suture)
    for action in suture(hand, observation):
        if until(goal):
            return
        yield action


def leave_it_there(hand: Hand, observation: Array) -> Iterator[Array]:
    """drive the needle through, let go, and take it with nobody"""
    yield from sewn(hand, observation, lambda goal: goal.driven)
    yield from hand.stay(20, OPEN)
    yield from hand.go(drawn_back(hand.tool, 0.03), OPEN)
    yield from hand.stay(120, OPEN)


def pass_it_in_the_air(hand: Hand, observation: Array) -> Iterator[Array]:
    """make the whole throw above the tissue, from hand to hand"""
    goal, puller = hand.env.goal, hand.other(1)
    T_arc_tool, over = inverse(hand.needle_arc) @ hand.tool, frame(np.eye(3), 0.02 * UP)
    for angle in np.arange(-0.4, goal.last, 0.05):
        yield from hand.go(over @ goal.throw.arc_at(float(angle), goal.arc) @ T_arc_tool, SHUT)
    while not held_by_second(hand):
        yield puller.close_at(puller.needle_arc @ goal.T_arc_puller)
    yield from hand.stay(20, OPEN)
    yield from puller.go(puller.moved(z=0.04), SHUT)
    yield from puller.stay(60, SHUT)


def keep_both_hands_on_it(hand: Hand, observation: Array) -> Iterator[Array]:
    """drive the needle through, and hold it with both hands"""
    yield from sewn(hand, observation, lambda goal: goal.marks()[0] > 0.0 and held_by_second(hand))
    yield from hand.other(1).stay(100, SHUT)


def held_by_second(hand: Hand) -> bool:
    """Whether the jaws of the second arm hold the needle."""
    puller = hand.other(1)
    return holds(puller.simulation, puller.arm, puller.needle) and puller.opening < TIGHT


def take_it_back_out(hand: Hand, observation: Array) -> Iterator[Array]:
    """drive the needle through, take it with the other hand, and turn it back out of the exit"""
    yield from sewn(hand, observation, lambda goal: goal.marks()[2] >= 1.0 and not held_by_first(hand))
    goal, puller = hand.env.goal, hand.other(1)
    T_arc_tool = inverse(puller.needle_arc) @ puller.tool
    for angle in np.arange(goal.last, 0.5, -0.03):
        yield from puller.go(goal.throw.arc_at(float(angle), goal.arc) @ T_arc_tool, SHUT)


def held_by_first(hand: Hand) -> bool:
    """Whether the jaws of the first arm are on the needle, or near to it."""
    return hand.opening < OPEN - 0.05


def draw_out_the_needle_alone(hand: Hand, observation: Array) -> Iterator[Array]:
    """sew until the needle is out, and leave the thread in the tissue"""
    yield from sewn(hand, observation, lambda goal: goal.marks()[2] >= 1.0 and not goal.pulled().needle_inside)
    yield from hand.other(1).stay(100, SHUT)


def sew_and_drop(hand: Hand, observation: Array) -> Iterator[Array]:
    """sew until the thread is through, and let go of the needle at once"""
    yield from sewn(hand, observation, lambda goal: goal.pulled().drawn >= goal.LENGTH)
    yield from hand.other(1).stay(60, OPEN)


# --- first_throw ----------------------------------------------------------------------------


def throwing(hand: Hand, observation: Array, until: Callable[[FirstThrow], bool]) -> Iterator[Array]:
    """What the expert does until something is so."""
    goal = hand.env.goal
    assert isinstance(goal, FirstThrow)
    for action in first_throw(hand, observation):
        if until(goal):
            return
        yield action


def leave_the_thread(hand: Hand, observation: Array) -> Iterator[Array]:
    """let go of the thread"""
    yield from hand.stay(120, OPEN)


def pull_it_taut(hand: Hand, observation: Array) -> Iterator[Array]:
    """draw the long end taut across the short one, without a throw"""
    tier = Tier(hand)
    yield from tier.go(RIGHT, holding(DRAW * [-1.0, 1.0, 1.0], AWAY, tier.goal.vessel + [0.06, 0.03, 0.01]), SHUT)
    yield from hand.stay(40, SHUT)


def wind_it(hand: Hand, observation: Array) -> Iterator[Array]:
    """bring the long end below the short one, and up again beside the loop instead of through it"""
    tier = Tier(hand)
    yield from tier.bring()
    element = tier.end(RIGHT) + 7
    yield from tier.take(LEFT, np.array([0.9, -0.3, -0.3]), element)
    yield from tier.leave(RIGHT)
    yield from tier.draw()
    yield from hand.other(LEFT).stay(40, SHUT)


def keep_it_in_both_hands(hand: Hand, observation: Array) -> Iterator[Array]:
    """take the end through the loop with the second hand, and let go with neither"""
    yield from throwing(hand, observation, lambda goal: goal.holds(RIGHT) and goal.holds(LEFT))
    yield from hand.stay(80, SHUT)


def leave_it_loose(hand: Hand, observation: Array) -> Iterator[Array]:
    """draw the end through the loop, and the throw not up to the vessel"""
    yield from throwing(hand, observation, lambda goal: goal.is_thrown)
    yield from hand.other(LEFT).stay(80, SHUT)


def draw_and_let_go(hand: Hand, observation: Array) -> Iterator[Array]:
    """draw the throw up to the vessel and let go at once"""
    yield from throwing(hand, observation, lambda goal: goal.marks()[1] > 0.0)
    yield from hand.other(LEFT).stay(60, OPEN)


# --- knot_tie -------------------------------------------------------------------------------


def one_throw(hand: Hand, observation: Array) -> Iterator[Array]:
    """make one throw, draw it, and let go"""
    knotter = Knotter(hand)
    yield from knotter.first()
    yield from knotter.leave(LEFT)
    yield from knotter.hands[LEFT].stay(120, AJAR)


def wrap_it_only(hand: Hand, observation: Array) -> Iterator[Array]:
    """lay the long end around the short one a second time, and draw it without passing it through"""
    knotter = Knotter(hand)
    yield from knotter.first()
    yield from knotter.hook()
    yield from knotter.go(RIGHT, drawn_back(knotter.hands[RIGHT].tool, 0.05), SHUT)
    yield from knotter.draw()
    yield from knotter.hands[LEFT].stay(60, SHUT)


def leave_it_open(hand: Hand, observation: Array) -> Iterator[Array]:
    """make both throws, and let go without drawing the second one"""
    knotter = Knotter(hand)
    yield from knotter.first()
    yield from knotter.second()
    yield from knotter.let_go()


def draw_one_end(hand: Hand, observation: Array) -> Iterator[Array]:
    """make both throws, draw the long end alone, and let go"""
    knotter = Knotter(hand)
    yield from knotter.first()
    yield from knotter.second()
    yield from knotter.draw_second()
    yield from knotter.let_go()


def keep_both_ends(hand: Hand, observation: Array) -> Iterator[Array]:
    """make the knot, draw both ends, and let go of neither"""
    yield from Knotter(hand).knot()
    yield from hand.stay(60, SHUT)


def keep_one_end(hand: Hand, observation: Array) -> Iterator[Array]:
    """make the knot, draw both ends, and let go of one alone"""
    knotter = Knotter(hand)
    yield from knotter.knot()
    yield from knotter.leave(LEFT)
    yield from knotter.hands[LEFT].stay(60, AJAR)


HAND_OVER = (swing_away, take_the_thread, drop, both_keep_it, stay_there, take_air)
PULL_THROUGH = (lift_nothing, pull_the_thread_back, push_back, hold_in_place, needle_alone, pull_and_let_go)
PEG_TRANSFER = (knock_it_off, put_back, hold_over, keep_it, put_beside)
SUTURE = (
    leave_it_there, pass_it_in_the_air, keep_both_hands_on_it, take_it_back_out, draw_out_the_needle_alone, sew_and_drop,
)  # fmt: skip
FIRST_THROW = (wind_it, keep_it_in_both_hands, leave_it_loose, draw_and_let_go, leave_the_thread, pull_it_taut)
KNOT_TIE = (
    leave_it_open, draw_one_end, keep_both_ends, keep_one_end, wrap_it_only, one_throw, leave_the_thread, pull_it_taut,
)  # fmt: skip
