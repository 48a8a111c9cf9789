"""What a task of an environment is: where episodes begin, what is seen, rewarded, done and lost.

Metres, radians, simulated seconds. A task is done when the deed is: tests try to get the reward without it
(`tests/environments/cheats.py`).
"""

from __future__ import annotations

from collections.abc import Sequence
from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.environments.reading import ArmReading
from ligature.model.commands import BodyCommand, CommandType, Release
from ligature.model.frames import axis_rotation, frame, inverse, matrix_pose7, pose7_matrix
from ligature.robots.poses import rotation_vector
from ligature.robots.psm_arm import PsmArm
from ligature.simulation import Simulation
from ligature.tasks.scenery import Scenery
from ligature.tasks.throws import NeedleArc

Array = NDArray[np.float64]

START = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
"""Joint values with which an episode begins, where nothing is in hand."""

EARLY = 1e-9
"""Seconds that a time may fall short of what is wanted, for the rounding of simulated time."""

BASE = 0.0001
"""Metres that a place where jaws hold a needle is at least from its base, where its thread begins."""

UNDONE = 1e-6
"""Metres that are left while a task is not done, wherever the needle is."""

HOLD = 0.5
"""Seconds for which jaws must hold the needle without a break before a task with it counts as done."""

LOST = 0.1
"""Seconds without a grasp after which a needle counts as dropped."""

REGRASP = 2.0
"""The same where tissue has the needle, so that the hand may grasp it anew."""

OPEN, SHUT = 0.8, -0.35
"""Angles of a jaw before and after it closes."""


class Progress(NamedTuple):
    """How a task stands: metres that are ``left``, whether it is ``done``, why it is ``lost`` (empty: it is not)."""

    left: float
    done: bool = False
    lost: str = ""

    @property
    def ended(self) -> bool:
        """Whether it is done or lost: nothing more is paid."""
        return self.done or bool(self.lost)


class Dwell:
    """For how long something has been so without a break, in simulated seconds."""

    def __init__(self) -> None:
        self._since: float | None = None

    def observe(self, so: bool, now: float) -> float:
        """Take what is so ``now``; returns the seconds that it has been so."""
        if not so:
            self._since = None
            return 0.0
        self._since = now if self._since is None else self._since
        return now - self._since


class Goal:
    """A task in a simulation; `Progress` is taken once after each action, since tasks count time.

    Parameters
    ----------
    simulation
        At the start of its scene.
    arms
        Those that do it, in the order of `arms`.

    Raises
    ------
    ValueError
        Where it cannot be done in the scene.

    Attributes
    ----------
    body
        What is handled: the needle, or another body of the scene.
    holes
        Pairs of holes that a scene must have.
    scene
        Folder of the scene of ours that the task is made for.
    models
        Models of its launch file that the task needs: its arms, where all of them are simulated for nothing.
    thread
        Whether needle and thread take part; where not, the needle stays where it is, and there is no thread.
    arms
        Names of the arms that do it.
    text
        The task in words, for policies that take language and for datasets.
    steps
        Actions until an episode of a registered environment is cut.
    starts
        Settled starts, of which each episode draws one.
    grasping
        Number of the arm whose jaws hold the body as an episode begins; None where none do.
    """

    body: int
    holes: int = 0
    scene: str
    models: tuple[int, ...]
    thread: bool = True
    arms: tuple[str, ...]
    text: str
    steps: int = 200
    starts: int = 1
    grasping: int | None = None

    _KEPT: tuple[str, ...] = ()
    """Attributes that last from action to action."""

    def __init__(self, simulation: Simulation, arms: Sequence[PsmArm]) -> None:
        self._simulation, self._arms = simulation, tuple(arms)
        self._readings = tuple(ArmReading(simulation, arm) for arm in arms)
        self._body_pose: Array = simulation.state["body_pose"][0]
        self._prepare()

    def _prepare(self) -> None:
        """Find what the task needs of the scene: here a needle, and as many pairs of holes as `holes` has."""
        self.scenery = Scenery.of(self._simulation.scene, self.holes)
        self.body = self.scenery.needle

    def settle(self, start: int = 0) -> None:
        """Bring the scene to a settled start, from start 0 to any other: the arms above the work, all else at rest."""
        for arm in self._arms:
            arm.place_jp(START)
            arm.adopt()
        self._simulation.step(200)

    def begin(self, rng: np.random.Generator) -> None:
        """Set an episode up."""
        raise NotImplementedError

    def check_start(self) -> None:
        """Raise ValueError where an episode that has begun does not have the body in the jaws of `grasping` alone."""
        name = self._simulation.scene.bodies[self.body].identity.name
        for number, arm in enumerate(self._arms):
            if self.holds(number) != (number == self.grasping):
                what = "do not hold" if number == self.grasping else "hold"
                raise ValueError(f"the jaws of {arm.name} {what} {name}")

    def target(self) -> Array:
        """Where something is wanted (3,), world axes."""
        raise NotImplementedError

    def observe(self) -> Progress:
        """Look at the scene after an action."""
        raise NotImplementedError

    def marks(self) -> Array:
        """What `observe` goes by beside the scene (3,), 0 to 1 each.

        Whether the first arm's jaws hold the body; the share of the time for which something must be so; the stage.
        """
        raise NotImplementedError

    def snapshot(self) -> dict[str, Any]:
        """What lasts from action to action."""
        return {name: deepcopy(getattr(self, name)) for name in self._KEPT if hasattr(self, name)}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`, of this goal or of another one of its kind in an equal scene."""
        for name, value in deepcopy(snapshot).items():
            setattr(self, name, value)

    # --- what goals ask for -----------------------------------------------------------------

    def _poses(self) -> Array:
        """Poses (bodies, 7) of all bodies now."""
        return self._body_pose

    def _pose(self, body: int) -> Array:
        """Pose (4, 4) of a body now."""
        return pose7_matrix(self._poses()[body])

    def _points(self) -> Array:
        """Base, middle and tip (3, 3) of the needle now."""
        return self.scenery.needle_points(self._poses())

    def _tip(self, arm: int = 0) -> Array:
        """The control point (3,) of an arm of the task, world axes."""
        return self._readings[arm].tip_position()

    def holds(self, arm: int = 0) -> bool:
        """Whether the jaws of an arm of the task hold its body."""
        return holds(self._simulation, self._arms[arm], self.body)


def holds(simulation: Simulation, arm: PsmArm, body: int) -> bool:
    """Whether the jaws of ``arm`` hold ``body`` between their pads."""
    return simulation.grasps.body_in(arm.name) == body


def base_of(simulation: Simulation, arm: PsmArm) -> Array:
    """Pose (4, 4) of an arm's base in the world."""
    base = next(described.base for described in simulation.scene.arms if described.name == arm.name)
    return pose7_matrix(simulation.state["body_pose"][0, base])


def take_in_hand(simulation: Simulation, arm: PsmArm, needle: int, arc: NeedleArc, T_arc: Array, T_tool: Array) -> None:
    """Close the jaws of ``arm`` on the needle, whose arc frame is at ``T_arc`` and the tool at ``T_tool`` in the base.

    Raises ValueError when they do not hold it then.
    """
    assert arm.jaw is not None
    put(arm, T_tool)
    arm.jaw.servo_jp([OPEN])
    simulation.step(200)
    held = matrix_pose7(T_arc @ inverse(arc.T_body_arc))
    for opening in np.linspace(OPEN, SHUT, 60):
        if simulation.grasps[arm.name] is None:
            simulation.set_pose(needle, held)
        arm.jaw.servo_jp([opening])
        simulation.step(5)
    simulation.step(200)
    if not holds(simulation, arm, needle):  # they may hold its thread
        raise ValueError(f"the jaws of {arm.name} do not hold the needle")


def on_needle(depths: Sequence[float], arc: NeedleArc) -> list[float]:
    """``depths`` from the tip of a needle; those that a short needle does not have are at its base."""
    return sorted({min(depth, arc.length - BASE) for depth in depths})


def aside(arm: PsmArm, rng: np.random.Generator, shift: float, turn: float) -> Array:
    """A pose (4, 4) up to ``shift`` metres from the tip's set-point along each axis, turned by up to ``turn``."""
    T = pose7_matrix(arm.local_setpoint_cp())
    axis = rng.uniform(-1.0, 1.0, 3)
    R = axis_rotation(axis / np.linalg.norm(axis), float(rng.uniform(0.0, turn)))
    return frame(R @ T[:3, :3], T[:3, 3] + rng.uniform(-shift, shift, 3))


def put(arm: PsmArm, T: Array) -> None:
    """Have the tip of an arm be at a pose (4, 4) in its base, at rest: for one that neither holds nor touches."""
    arm.place_jp(arm.kinematics.inverse(T[None]).q[0])
    arm.adopt()


def carry(simulation: Simulation, body: int, way: Sequence[Array]) -> None:
    """Have an unseen hand carry a body along ``way`` (k, 4, 4), a pose a tick, and let go at its end."""
    T_inertial, dt = simulation.scene.bodies[body].T_body_inertial, simulation.dt
    for T in way:
        now, then = pose7_matrix(simulation.state["body_pose"][0, body]) @ T_inertial, T @ T_inertial
        turn = rotation_vector(then[:3, :3] @ now[:3, :3].T)
        twist = np.concatenate([then[:3, 3] - now[:3, 3], turn]) / dt
        simulation.apply(BodyCommand(body, CommandType.VELOCITY, tuple(twist.tolist())))
        simulation.step()
    simulation.apply(Release("body", body))
