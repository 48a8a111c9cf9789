"""Policies that try to get an environment's reward without the deed, and experts that do the deed.

``python -m tests.environments.cheats`` prints the table of docs/cheats.md. Policies use the actions that an agent has,
and the ground truth of the simulation to find what they cheat with. World axes, metres, radians.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from ligature.environments import SuturingEnv
from ligature.environments.experts import EXPERTS, Policy
from ligature.environments.goals import GOALS, Insert
from ligature.environments.hand import OPEN, SHUT, Hand
from ligature.model.frames import axis_rotation, frame, inverse
from ligature.tasks.throws import UP

from tests.environments import more_cheats as more

Array = np.ndarray
MOST = 500
"""Actions of an episode, where registered environments do not allow more."""


def most(task: str) -> int:
    """Actions of an episode: at least as many as the registered environment allows."""
    return max(MOST, GOALS[task].steps)


def still(hand: Hand, observation: Array) -> Iterator[Array]:
    """do nothing"""
    yield from np.zeros((100, *hand.env.action_space.shape))


def flail(hand: Hand, observation: Array) -> Iterator[Array]:
    """random actions"""
    yield from np.random.default_rng(5).uniform(-1.0, 1.0, (100, *hand.env.action_space.shape))


# --- reach ----------------------------------------------------------------------------------


def fly_through(hand: Hand, observation: Array) -> Iterator[Array]:
    """pass the target at full speed"""
    way = observation[30:33] - observation[27:30]
    beyond = observation[30:33] + 0.03 * way / np.linalg.norm(way)
    yield from hand.go(frame(hand.tool[:3, :3], beyond), 0.0)


def shake(hand: Hand, observation: Array) -> Iterator[Array]:
    """shuttle through the target"""
    at, way = observation[30:33], observation[30:33] - observation[27:30]
    aside = 0.006 * way / np.linalg.norm(way)
    for k in range(20):
        yield from hand.go(frame(hand.tool[:3, :3], at + (-1.0) ** k * aside), 0.0)


def stop_short(hand: Hand, observation: Array) -> Iterator[Array]:
    """stop 3 mm before the target"""
    way = observation[30:33] - observation[27:30]
    yield from hand.go(frame(hand.tool[:3, :3], observation[30:33] - 0.003 * way / np.linalg.norm(way)), 0.0)
    yield from hand.stay(100, 0.0)


def touch_and_go(hand: Hand, observation: Array) -> Iterator[Array]:
    """stay at the target for 0.1 s again and again"""
    at, way = observation[30:33], observation[30:33] - observation[27:30]
    aside = 0.005 * way / np.linalg.norm(way)
    for _ in range(12):
        yield from hand.go(frame(hand.tool[:3, :3], at), 0.0)
        yield from hand.stay(5, 0.0)
        yield from hand.go(frame(hand.tool[:3, :3], at - aside), 0.0)
        yield from hand.stay(3, 0.0)


# --- pick -----------------------------------------------------------------------------------


def lift_by_thread(hand: Hand, observation: Array) -> Iterator[Array]:
    """grasp the thread beside the needle and lift both"""
    yield from hand.take(more.on_the_thread(hand, 3))
    yield from hand.go(hand.moved(z=0.06), SHUT)
    yield from hand.stay(60, SHUT)


def close_in_the_air(hand: Hand, observation: Array) -> Iterator[Array]:
    """close the jaws above the needle and lift them"""
    T = hand.grasp()
    yield from hand.take(frame(T[:3, :3], T[:3, 3] + 0.006 * UP))
    yield from hand.go(hand.moved(z=0.045), SHUT)
    yield from hand.stay(40, SHUT)


def toss(hand: Hand, observation: Array) -> Iterator[Array]:
    """lift the needle and let go at once"""
    yield from hand.take(hand.grasp())
    yield from hand.go(hand.moved(z=0.03), SHUT)
    yield from hand.stay(10, OPEN)
    yield from hand.stay(40, OPEN)


def sweep(hand: Hand, observation: Array) -> Iterator[Array]:
    """sweep the needle away and up with shut jaws"""
    T = hand.grasp()
    yield from hand.go(frame(T[:3, :3], T[:3, 3] + 0.02 * UP), SHUT)
    yield from hand.go(frame(T[:3, :3], T[:3, 3] + np.array([0.015, 0.0, 0.003])), SHUT)
    for _ in range(3):
        yield from hand.go(hand.moved(x=-0.03), SHUT)
        yield from hand.go(hand.moved(x=0.03, z=0.002), SHUT)
    yield from hand.go(hand.moved(z=0.04), SHUT)


def hold_low(hand: Hand, observation: Array) -> Iterator[Array]:
    """hold the needle just above the pad"""
    yield from hand.take(hand.grasp())
    yield from hand.go(hand.moved(z=0.008), SHUT)
    yield from hand.stay(60, SHUT)


def bounce(hand: Hand, observation: Array) -> Iterator[Array]:
    """lift the needle and lower it again and again, up for 0.3 s each time"""
    yield from hand.take(hand.grasp())
    for _ in range(6):
        yield from hand.go(hand.moved(z=0.027), SHUT)
        yield from hand.stay(8, SHUT)
        yield from hand.go(hand.moved(z=-0.027), SHUT)


# --- insert and puncture --------------------------------------------------------------------


def drive(
    hand: Hand, observation: Array, aside: Array | None = None, end: float = 2.6, turn: float = 0.03
) -> Iterator[Array]:
    """Turn the needle along its circle moved ``aside`` (3,); ``end`` is the tip's last angle."""
    goal = hand.env.goal
    assert isinstance(goal, Insert)
    T_arc_tool = inverse(hand.needle_arc) @ hand.tool
    shift = frame(np.eye(3), np.zeros(3) if aside is None else aside)
    angle = -0.4
    while angle < end:
        wanted = shift @ goal.throw.arc_at(angle, goal.arc) @ T_arc_tool
        found, left = hand.action(wanted, SHUT)
        angle += turn if left <= 1.0 else 0.0
        yield found


def let_go(hand: Hand, observation: Array) -> Iterator[Array]:
    """open the jaws"""
    yield from hand.stay(130, OPEN)


def over_the_top(hand: Hand, observation: Array) -> Iterator[Array]:
    """carry the needle through the air from the entry to beyond the exit"""
    goal = hand.env.goal
    way = goal._ends()[1] - goal._ends()[0]
    for x, z in ((0.0, 0.02), (1.2, 0.0), (0.0, -0.02), (0.0, 0.03)):
        yield from hand.go(hand.moved(x * way[0], x * way[1], x * way[2] + z), SHUT)


def backwards(hand: Hand, observation: Array) -> Iterator[Array]:
    """turn the needle the wrong way"""
    goal = hand.env.goal
    T_arc_tool = inverse(hand.needle_arc) @ hand.tool
    for angle in np.linspace(-0.4, -2.0, 80):
        yield hand.action(goal.throw.arc_at(float(angle), goal.arc) @ T_arc_tool, SHUT)[0]


def beside(hand: Hand, observation: Array) -> Iterator[Array]:
    """make the whole throw 8 mm beside the place"""
    yield from hand.go(hand.moved(z=0.015), SHUT)
    yield from drive(hand, observation, np.array([0.0, 0.008, 0.0]))


def from_the_exit(hand: Hand, observation: Array) -> Iterator[Array]:
    """drive the needle in at the exit and out at the entry"""
    goal = hand.env.goal
    first, last = goal._ends()
    middle, turn = 0.5 * (first + last), axis_rotation(UP, np.pi)
    swapped = frame(np.eye(3), middle) @ frame(turn, np.zeros(3)) @ frame(np.eye(3), -middle)
    T_arc_tool = inverse(hand.needle_arc) @ hand.tool
    yield from hand.go(hand.moved(z=0.02), SHUT)
    over = frame(np.eye(3), 0.02 * UP) @ swapped @ goal.throw.arc_at(-0.4, goal.arc) @ T_arc_tool
    yield from hand.go(over, SHUT, most=160)
    for angle in np.arange(-0.4, 2.6, 0.06):
        yield from hand.go(swapped @ goal.throw.arc_at(float(angle), goal.arc) @ T_arc_tool, SHUT, most=6)


def leave_it_in(hand: Hand, observation: Array) -> Iterator[Array]:
    """drive the needle half way in and let go"""
    yield from drive(hand, observation, end=0.7)
    yield from hand.stay(30, OPEN)
    yield from hand.go(hand.moved(z=0.02), OPEN)


def peck(hand: Hand, observation: Array) -> Iterator[Array]:
    """prick the entry again and again"""
    goal = hand.env.goal
    T_arc_tool = inverse(hand.needle_arc) @ hand.tool
    for angle in np.concatenate([np.r_[np.linspace(-0.4, 0.25, 25), np.linspace(0.25, -0.4, 25)]] * 4):
        yield hand.action(goal.throw.arc_at(float(angle), goal.arc) @ T_arc_tool, SHUT)[0]


QUICK = 3
"""How many, the last of each list, `make test` rolls; the slow tests roll all."""

CHEATS: dict[str, tuple[Policy, ...]] = {
    "reach": (still, flail, fly_through, shake, touch_and_go, stop_short),
    "pick": (still, flail, close_in_the_air, sweep, bounce, lift_by_thread, toss, hold_low),
    "insert": (still, flail, backwards, beside, from_the_exit, let_go, over_the_top, leave_it_in),
    "puncture": (still, backwards, beside, from_the_exit, peck, let_go, over_the_top, leave_it_in),
    "hand_over": (still, flail, *more.HAND_OVER),
    "pull_through": (still, flail, *more.PULL_THROUGH),
    "peg_transfer": (still, flail, *more.PEG_TRANSFER),
    "suture": (still, flail, *more.SUTURE),
    "first_throw": (still, flail, *more.FIRST_THROW),
    "knot_tie": (still, flail, *more.KNOT_TIE),
}


class Outcome(NamedTuple):
    """How an episode went: dense reward, what the deed would have paid, success, why it was lost, actions."""

    total: float
    deed: float
    success: bool
    lost: str
    steps: int


def roll(env: SuturingEnv, policy: Policy, seed: int) -> Outcome:
    """One episode; whatever a policy leaves over is spent standing still."""
    observation, info = env.reset(seed=seed)
    deed, total, steps, ended, success, lost = 1.0 + 100.0 * info["distance"], 0.0, 0, False, False, ""
    hand = Hand(env)
    for action in policy(hand, observation):
        observation, reward, ended, cut, info = env.step(np.asarray(action, dtype=np.float32))
        total, steps = total + reward, steps + 1
        success, lost = info["is_success"], info["lost"]
        if ended or cut:
            break
    return Outcome(total, deed, success, lost, steps)


def described(policy: Policy) -> str:
    """What a policy does."""
    text = (policy.__doc__ or "").split("\n")[0].rstrip(".")
    return text[0].lower() + text[1:]


def main() -> int:
    """Print the table of all experts and cheats, or of the environments that the command line names."""
    tasks = sys.argv[1:] or list(CHEATS)
    sys.stdout.write("| environment | policy | dense reward | of | sparse | ends |\n|---|---|---|---|---|---|\n")
    for task in tasks:
        cheats = CHEATS[task]
        env = SuturingEnv(task, max_steps=most(task))
        for policy in (EXPERTS[task], *cheats):
            found = roll(env, policy, seed=3)
            what = described(policy) if policy in cheats else f"**{described(policy)}**"
            ends = found.lost or ("done" if found.success else "cut")
            rewards = f"{found.total:.2f} | {found.deed:.2f} | {int(found.success)}"
            sys.stdout.write(f"| {task} | {what} | {rewards} | {ends} |\n")
            sys.stdout.flush()
        env.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
