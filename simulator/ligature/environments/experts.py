"""Scripted experts of the environments: each does the deed by the actions that an agent has.

They find their way by the ground truth of the simulation. What an expert does follows from where things are, not from
what it did before: it says what to do wherever a disturbance or another policy has brought the arm, so that a policy
that sees the state can learn it. World axes, metres, radians.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import repeat
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.environments.goals import Insert, Suture, holds
from ligature.environments.hand import JAW, OPEN, SHUT, TIGHT, WIDE, Hand
from ligature.environments.knotting import knot_tie
from ligature.environments.layout import ACTION, TARGET, action_width
from ligature.environments.scripts import hand_over, peg_transfer, pull_through
from ligature.environments.suturing import SuturingEnv
from ligature.environments.tying import first_throw
from ligature.model.frames import frame, inverse
from ligature.tasks.throws import BEHIND, drawn_back

Array = NDArray[np.float64]
HIGHER = 0.02
"""Metres above where it must be to which the needle is lifted: some of it hangs below."""

LAST = 2.6
"""Angle on its circle at which a needle has gone far enough."""

GAP, LEAVE = 0.025, 0.005
"""Metres from the needle to the tool of a hand that has left it, and back to where its set-point goes until then."""

MORE = 0.003
"""Metres of thread that are pulled through beyond those that are asked for."""

SLIPS, SLIP = 1.0 / 40.0, (6, 16)
"""Share of actions with which an expert's jaws begin to shut by mistake, and for how many they do."""


Act = Callable[[Array], NDArray[Any]]
"""The action of a policy for an observation."""

Policy = Callable[[Hand, Array], Iterator[Array]]
"""Actions of an episode, from the first arm and the state at its start; each when what came of the last one is seen."""


def reach(hand: Hand, observation: Array) -> Iterator[Array]:
    """Go there and stop."""
    while True:
        yield hand.action(frame(hand.tool[:3, :3], observation[TARGET]), 0.0)[0]


def pick(hand: Hand, observation: Array) -> Iterator[Array]:
    """Grasp the needle, lift it, hold it."""
    height = float(observation[32]) + HIGHER
    while True:
        held = holds(hand.simulation, hand.arm, hand.needle)
        yield hand.lift_to(height) if held else hand.approach()


def insert(hand: Hand, observation: Array) -> Iterator[Array]:
    """Turn the needle along its circle."""
    goal = hand.env.goal
    assert isinstance(goal, Insert)
    while True:
        yield hand.turn_needle(goal.throw, LAST)


def suture(hand: Hand, observation: Array) -> Iterator[Array]:
    """Drive the needle, take it with the other hand at the exit, let go, draw it out, and pull the thread up."""
    goal = hand.env.goal
    assert isinstance(goal, Suture)
    puller = hand.other(1)
    while True:
        firm = holds(hand.simulation, puller.arm, puller.needle) and puller.opening < TIGHT
        if not firm:
            yield hand.turn_needle(goal.throw, goal.last) + _meet(puller, goal)
        elif not _left(hand):
            yield _leave(hand) + puller.turn_needle(goal.throw, goal.last)
        else:
            yield _draw(puller, goal)


def _meet(puller: Hand, goal: Suture) -> Array:
    """The puller's action that takes the needle beyond the exit; before it is there, that waits behind the place."""
    if goal.driven:
        return puller.close_at(puller.needle_arc @ goal.T_arc_puller)
    wait = goal.throw.arc_at(goal.last, goal.arc) @ goal.T_arc_puller
    return puller.action(drawn_back(wait, 2.0 * BEHIND), OPEN)[0]


def _left(hand: Hand) -> bool:
    """Whether a hand is farther than `GAP` from all of the needle."""
    depths = np.linspace(0.0, hand.arc.length, 9)
    T = inverse(hand.measured_tool) @ hand.needle_arc
    places = np.array([T[:3, :3] @ hand.arc.point(float(depth)) + T[:3, 3] for depth in depths])
    return bool(np.linalg.norm(places, axis=1).min() > GAP)


def _leave(hand: Hand) -> Array:
    """The action that opens the jaws, and then draws the hand back along itself."""
    way = LEAVE if hand.opening > WIDE else 0.0
    return hand.action(drawn_back(hand.tool, way), OPEN)[0]


def _draw(puller: Hand, goal: Suture) -> Array:
    """The puller's action that turns the needle out along its circle, and raises it then until the thread is out."""
    pulled = goal.pulled()
    if pulled.needle_inside:
        return puller.turn_needle(goal.throw, goal.out)
    missing = goal.LENGTH + MORE - pulled.drawn
    return puller.action(puller.moved(z=float(np.clip(missing, 0.0, 0.001))), SHUT)[0]


EXPERTS: dict[str, Policy] = {
    "reach": reach, "pick": pick, "insert": insert, "puncture": insert,
    "hand_over": hand_over, "pull_through": pull_through, "peg_transfer": peg_transfer,
    "suture": suture, "first_throw": first_throw, "knot_tie": knot_tie,
}  # fmt: skip
"""Experts by the names of the tasks."""

CORRECTING = ("reach", "pick", "insert", "puncture", "suture")
"""Tasks whose experts act by where things are alone, so that they can correct what others do."""

GRASPING = ("pick",)
"""Those of them that begin with empty jaws, which must close on something."""


def demonstrate(
    env: SuturingEnv,
    seed: int,
    noise: float,
    look: Callable[[Array, Array], None],
    act: Act | None = None,
    slips: bool = False,
) -> tuple[int, dict[str, Any]]:
    """One episode in which the expert says all the time what is to be done; what is done may be something else.

    Parameters
    ----------
    env
        Where it is done; the expert sees its ground truth, whatever is observed.
    seed
        Of the reset and of the disturbance.
    noise
        Disturbs the expert, as a share of an action; each episode has its own part of it, from none to all. A policy
        that is shown nothing but the expert's own way cannot find back to it (Laskey et al., Conference on Robot
        Learning 2017).
    look
        Called with each observation and with what the expert would do there.
    act
        A policy that acts in the stead of an expert of `CORRECTING`, which only corrects it (Ross, Gordon and Bagnell,
        International Conference on Artificial Intelligence and Statistics 2011).
    slips
        Have the jaws of an expert of `GRASPING` shut by mistake now and then, so that it shows what to do with jaws
        that shut on nothing.

    Returns
    -------
    tuple
        Number of actions, and the last ``info``; raises ValueError where the expert finds no way.
    """
    if act is not None and env.task not in CORRECTING:
        raise ValueError(f"the expert of '{env.task}' cannot correct a policy; those of {', '.join(CORRECTING)} can")
    observation, info = env.reset(seed=seed)
    rng, steps = np.random.default_rng(seed), 0
    noise *= float(rng.uniform())
    disturbance = np.zeros(action_width(len(env.arms)))
    slipping = _slipping(seed) if slips and env.task in GRASPING else repeat(False)
    for action in EXPERTS[env.task](Hand(env), env.true_state()):
        look(observation, action)
        if act is None:
            disturbance = 0.9 * disturbance + noise * rng.standard_normal(disturbance.shape)
            disturbance[JAW::ACTION] = 0.0
            taken = action + disturbance
            if next(slipping):
                taken[JAW] = -1.0
        else:
            taken = act(observation)
        observation, _, ended, cut, info = env.step(np.asarray(taken, dtype=np.float32))
        steps += 1
        if ended or cut:
            break
    return steps, info


def _slipping(seed: int) -> Iterator[bool]:
    """Whether the jaws shut by mistake, for each action."""
    rng = np.random.default_rng([seed, 1])
    while True:
        if rng.uniform() < SLIPS:
            yield from repeat(True, int(rng.integers(*SLIP)))
        else:
            yield False
