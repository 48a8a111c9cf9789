"""What an agent is to do in an environment: where episodes begin, what is seen, rewarded, done and lost.

Metres, radians, simulated seconds. A task is done when the deed is: tests try to get the reward without it
(`tests/environments/cheats.py`).
"""

from __future__ import annotations

from copy import deepcopy
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ligature.environments.reading import ArmReading
from ligature.model.frames import axis_rotation, frame, inverse, matrix_pose7, pose7_matrix
from ligature.robots.psm_arm import PsmArm
from ligature.simulation import Simulation
from ligature.tasks.passages import PassageWatch
from ligature.tasks.scenery import Scenery
from ligature.tasks.scores import RECOMMENDED_AXIAL, holes_of, judge_insertion, passed_in_order
from ligature.tasks.throws import UP, NeedleArc, Throw, best_grasp

Array = NDArray[np.float64]

START = (0.0, 0.0, 0.12, 0.0, 0.0, 0.0)
"""Joint values with which an episode begins, where nothing is in hand."""

EARLY = 1e-9
"""Seconds that a time may fall short of what is wanted, for the rounding of simulated time."""

UNDONE = 1e-6
"""Metres that are left while a task is not done, wherever the needle is."""


HOLD = 0.5
"""Seconds for which jaws must hold the needle without a break before a task with it counts as done."""

REST = 0.2
"""Seconds for which a tool must stay at a place to have reached it."""

LOST = 0.1
"""Seconds without a grasp after which a needle counts as dropped."""

REGRASP = 2.0
"""The same where tissue has the needle, so that the hand may grasp it anew."""


class Progress(NamedTuple):
    """How a task stands: metres that are ``left``, whether it is ``done``, why it is ``lost`` (empty: it is not)."""

    left: float
    done: bool = False
    lost: str = ""


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
    """A task of an environment; `Progress` is taken once after each action, since tasks count time.

    Attributes
    ----------
    holes
        Pairs of holes that a scene must have.
    scene
        Folder of the scene of ours that the task is made for.
    models
        Models of its launch file that the task needs: one arm, where all of them are simulated for nothing.
    thread
        Whether needle and thread take part; where not, the needle stays where it is, and there is no thread.
    arm
        Name of the arm that does it.
    text
        The task in words, for policies that take language and for datasets.
    """

    holes: int = 0
    scene: str
    models: tuple[int, ...]
    thread: bool
    arm: str
    text: str

    _KEPT: tuple[str, ...] = ()
    """Attributes that last from action to action."""

    def prepare(self, simulation: Simulation, scenery: Scenery, arm: PsmArm) -> None:
        """Find out what the task needs of a scene at its start; raises ValueError where it cannot be done there."""
        raise NotImplementedError

    def settle(self, simulation: Simulation, arm: PsmArm) -> None:
        """Bring the scene to where all episodes begin from: the arm above the work, the needle at rest."""
        arm.place_jp(START)
        arm.adopt()
        simulation.step(200)

    def begin(self, simulation: Simulation, scenery: Scenery, arm: PsmArm, rng: np.random.Generator) -> None:
        """Set an episode up."""
        raise NotImplementedError

    def target(self) -> Array:
        """Where something is wanted (3,), world axes."""
        raise NotImplementedError

    def observe(self, simulation: Simulation, arm: PsmArm) -> Progress:
        """Look at the scene after an action."""
        raise NotImplementedError

    def marks(self) -> Array:
        """What `observe` goes by beside the scene (3,), 0 to 1 each.

        Whether the arm's jaws hold the needle; the share of the time for which something must be so; the stage.
        """
        raise NotImplementedError

    def snapshot(self) -> dict[str, Any]:
        """What lasts from action to action."""
        return {name: deepcopy(getattr(self, name)) for name in self._KEPT if hasattr(self, name)}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`, of this goal or of another one of its kind in an equal scene."""
        for name, value in deepcopy(snapshot).items():
            setattr(self, name, value)


def holds(simulation: Simulation, arm: PsmArm, body: int) -> bool:
    """Whether the jaws of ``arm``, and no others, hold ``body`` between their pads."""
    found = simulation.grasps[arm.name]
    return found is not None and found.body == body


def tip_position(simulation: Simulation, arm: PsmArm) -> Array:
    """The control point of an arm's tool (3,), world axes."""
    return ArmReading(simulation, arm).tip_position()


def _base_of(simulation: Simulation, arm: PsmArm) -> int:
    return next(description.base for description in simulation.scene.arms if description.name == arm.name)


def _holes_at(simulation: Simulation, *places: Array) -> set[int]:
    """Holes of the scene that are the nearest to ``places``, (3,) each, in world axes."""
    scene, poses = simulation.scene, simulation.state["body_pose"][0]
    at = np.array([(pose7_matrix(poses[hole.body]) @ hole.T_body_hole)[:3, 3] for hole in scene.holes])
    return {int(np.argmin(np.linalg.norm(at - place, axis=1))) for place in places} if len(at) else set()


class Reach(Goal):
    """Bring the tool's control point to within 2 mm of a random place above the work, and keep it there for 0.2 s."""

    scene, arm, models, thread = "suturing_small", "PSM1", (0, 1, 2), False
    text = "move the tip of the instrument to the target and stop there"
    WITHIN = 0.002
    REACH = np.array([0.025, 0.025, 0.012])
    _KEPT = ("_target", "_there", "_rested")

    def prepare(self, simulation: Simulation, scenery: Scenery, arm: PsmArm) -> None:
        """Nothing: the target follows from where the tool is."""

    def begin(self, simulation: Simulation, scenery: Scenery, arm: PsmArm, rng: np.random.Generator) -> None:
        """A target in a box around where the tool is."""
        self._target = tip_position(simulation, arm) + rng.uniform(-1.0, 1.0, 3) * self.REACH
        self._there, self._rested = Dwell(), 0.0

    def target(self) -> Array:
        """The place."""
        return self._target

    def observe(self, simulation: Simulation, arm: PsmArm) -> Progress:
        """Distance beyond `WITHIN`."""
        distance = float(np.linalg.norm(tip_position(simulation, arm) - self._target)) - self.WITHIN
        self._rested = self._there.observe(distance <= 0.0, simulation.time)
        done = self._rested >= REST - EARLY
        return Progress(0.0 if done else max(distance, 0.0) + UNDONE, done)

    def marks(self) -> Array:
        """No grasp, the share of the rest, no stage."""
        return np.array([0.0, min(self._rested / REST, 1.0), 0.0])


class Pick(Goal):
    """Grasp the needle, which lies somewhere on the pad, lift all of it by 20 mm, and hold it there for 0.5 s.

    Height counts while the arm's own jaws hold the needle. The episode is lost when the needle falls after it was
    lifted by half of that, or off the pad.
    """

    scene, arm, models, thread = "suturing_small", "PSM1", (0, 1, 2), True
    text = "pick up the needle and hold it above the pad"
    HEIGHT = 0.02
    SPREAD = 0.012
    _KEPT = ("_rest", "_at", "_held", "_high", "_up", "_lifted", "_free")

    def prepare(self, simulation: Simulation, scenery: Scenery, arm: PsmArm) -> None:
        """Remember the bodies of the task."""
        self._scenery = scenery

    def begin(self, simulation: Simulation, scenery: Scenery, arm: PsmArm, rng: np.random.Generator) -> None:
        """The needle near its place, turned any way about the vertical, at rest as it came to rest there."""
        body = scenery.needle
        T = pose7_matrix(simulation.state["body_pose"][0, body])
        shift = np.append(rng.uniform(-self.SPREAD, self.SPREAD, 2), 0.0)
        turn = axis_rotation((0.0, 0.0, 1.0), float(rng.uniform(-np.pi, np.pi)))
        middle = T[:3, :3] @ scenery.points.mean(axis=0) + T[:3, 3]
        placed = frame(turn @ T[:3, :3], turn @ (T[:3, 3] - middle) + middle + shift)
        simulation.set_pose(body, matrix_pose7(placed))
        points = scenery.needle_points(simulation.state["body_pose"][0])
        self._rest, self._at = float(points[:, 2].min()), points[1]
        self._held, self._high = False, False
        self._up, self._lifted, self._free = Dwell(), 0.0, Dwell()

    def target(self) -> Array:
        """The needle's place at the height wanted."""
        return np.append(self._at[:2], self._rest + self.HEIGHT)

    def observe(self, simulation: Simulation, arm: PsmArm) -> Progress:
        """How much higher the needle must be; before it is held, how far the tool is from it too."""
        points, now = self._scenery.needle_points(simulation.state["body_pose"][0]), simulation.time
        self._at, height = points[1], float(points[:, 2].min()) - self._rest
        self._held = holds(simulation, arm, self._scenery.needle)
        self._high = self._high or (self._held and height >= 0.5 * self.HEIGHT)
        self._lifted = self._up.observe(self._held and height >= self.HEIGHT, now)
        free = self._free.observe(not self._held, now)
        if self._lifted >= HOLD - EARLY:
            return Progress(0.0, True)
        if self._held:
            return Progress(max(self.HEIGHT - height, 0.0) + UNDONE)
        left = self.HEIGHT + 0.2 * float(np.linalg.norm(tip_position(simulation, arm) - self._at)) + UNDONE
        if self._high and free >= LOST - EARLY:
            return Progress(left, lost="the needle was dropped")
        return Progress(left, lost="the needle fell off the pad" if height < -self.HEIGHT else "")

    def marks(self) -> Array:
        """Whether the needle is held, the share of the time that it is up, whether a fall ends the episode."""
        return np.array([self._held, min(self._lifted / HOLD, 1.0), self._high], dtype=float)


class Insert(Goal):
    """Drive the needle, which is in hand before the entry of the first pair of holes, in there and out at the exit.

    Its tip shall go along the circle of its radius through both holes. Done when the tip has gone through the entry
    and then the exit, is 5 mm beyond, the needle is in both, and the arm's jaws have held it for the last 0.5 s. Lost
    when they drop it, after 2 s where tissue has it.
    """

    holes = 1
    text = "drive the needle in at the first entry and out at its exit"
    scene, arm, thread = "suturing", "PSM2", True
    models: tuple[int, ...] = (0, 1, 4, 5)
    DEPTHS = (0.020, 0.0205, 0.021)
    BEFORE, MORE, LOOK = 0.4, 0.1, 0.15
    SHIFT, TURN = 0.002, 0.08
    OPEN, SHUT = 0.8, -0.35
    ARRIVAL = 30
    """Ticks until the needle is within 0.04 mm of where the shifted hand holds it, at 1 mm/s."""
    _KEPT = ("_watch", "_grasped", "_held", "_kept", "_free", "_stage")

    def prepare(self, simulation: Simulation, scenery: Scenery, arm: PsmArm) -> None:
        """Find how the needle is to be held, and where its tip shall go."""
        scene, self._simulation, self._scenery = simulation.scene, simulation, scenery
        self._body = scene.bodies[scenery.needle]
        self.arc = NeedleArc.of(scene.needles[0], self._body)
        poses = simulation.state["body_pose"][0]
        entry, exit = self._places = self._ends()
        self.throw = Throw.through(entry, exit, self.arc.radius, UP)
        self._pair = _holes_at(simulation, entry, exit) if self.holes else set()
        self._last = self.throw.towards_exit + RECOMMENDED_AXIAL / self.arc.radius + self.MORE
        T_base = pose7_matrix(poses[_base_of(simulation, arm)])
        way = [self.throw.arc_at(a, self.arc) for a in np.linspace(-self.BEFORE, self._last, 12)]
        grasp = best_grasp(self.arc, self.DEPTHS, arm.kinematics, T_base, way, way[0], entry)
        if grasp is None:
            raise ValueError(f"{arm.name} has no grasp of the needle that reaches the whole throw")
        self._first = way[0], inverse(T_base) @ way[0] @ grasp.tool_in_arc(self.arc)

    def _ends(self) -> tuple[Array, Array]:
        """Where the tip goes in and out, (3,) each."""
        poses = self._simulation.state["body_pose"][0]
        return poses[self._scenery.entries[0], :3], poses[self._scenery.exits[0], :3]

    def settle(self, simulation: Simulation, arm: PsmArm) -> None:
        """Close the jaws on the needle, its tip before the entry."""
        assert arm.jaw is not None
        T_world_arc, T_base_tool = self._first
        arm.place_jp(arm.kinematics.inverse(T_base_tool[None]).q[0])
        arm.adopt()
        arm.jaw.servo_jp([self.OPEN])
        simulation.step(200)
        held = matrix_pose7(T_world_arc @ inverse(self.arc.T_body_arc))
        for opening in np.linspace(self.OPEN, self.SHUT, 60):
            if simulation.grasps[arm.name] is None:
                simulation.set_pose(self._scenery.needle, held)
            arm.jaw.servo_jp([opening])
            simulation.step(5)
        simulation.step(200)
        if simulation.grasps[arm.name] is None:
            raise ValueError(f"the jaws of {arm.name} do not hold the needle")

    def begin(self, simulation: Simulation, scenery: Scenery, arm: PsmArm, rng: np.random.Generator) -> None:
        """The hand a little elsewhere, and turned otherwise."""
        T = pose7_matrix(arm.local_setpoint_cp())
        turn = rng.uniform(-1.0, 1.0, 3)
        R = axis_rotation(turn / np.linalg.norm(turn), float(rng.uniform(0.0, self.TURN)))
        arm.servo_cp(frame(R @ T[:3, :3], T[:3, 3] + rng.uniform(-self.SHIFT, self.SHIFT, 3)))
        simulation.step(self.ARRIVAL)
        self._watch = PassageWatch(scenery)
        self._grasped, self._held, self._kept, self._free, self._stage = Dwell(), True, 0.0, Dwell(), 0.0

    def _tip(self) -> tuple[Array, float]:
        """The needle's tip (3,), and its angle past the entry on the circle."""
        tip = self._scenery.needle_points(self._simulation.state["body_pose"][0])[2]
        local = self.throw.axes.T @ (tip - self.throw.centre)
        return tip, float(np.arctan2(local[1], local[0]))

    def _look(self) -> tuple[bool, bool, float]:
        """Whether the needle went where it should, whether tissue has it, and the share of the way that it went."""
        state = self._simulation.state
        poses, time = state["body_pose"][0], self._simulation.time
        self._watch.observe(time, poses)
        score = judge_insertion(self._scenery, poses, self._watch.passages, time)
        n = int(state["insertion_count"][0])
        filled = set(state["insertion_hole"][0, :n][state["insertion_body"][0, :n] == self._scenery.needle].tolist())
        through = score.success and score.pair == 1 and bool(score.axial >= RECOMMENDED_AXIAL)
        entered = passed_in_order(self._watch.passages, holes_of([1])) / 2.0
        return through and self._pair <= filled, bool(filled), entered

    def _on_circle(self, angle: float) -> Array:
        local = self.arc.radius * np.array([np.cos(angle), np.sin(angle), 0.0])
        return np.asarray(self.throw.centre + self.throw.axes @ local)

    def target(self) -> Array:
        """Where the tip should be next: a little further on its circle."""
        _, angle = self._tip()
        return self._on_circle(float(np.clip(angle + self.LOOK, -self.BEFORE, self._last)))

    def observe(self, simulation: Simulation, arm: PsmArm) -> Progress:
        """Way of the tip along the circle that is left, and how far it is beside it."""
        through, inside, self._stage = self._look()
        self._held = holds(simulation, arm, self._scenery.needle)
        self._kept = self._grasped.observe(self._held, simulation.time)
        free = self._free.observe(not self._held, simulation.time)
        if through and self._kept >= HOLD - EARLY:
            return Progress(0.0, True)
        tip, angle = self._tip()
        near = float(np.clip(angle, -2.0 * self.BEFORE, self._last))
        beside = float(np.linalg.norm(tip - self._on_circle(near)))
        left = self.arc.radius * (self._last - near) + beside + UNDONE
        dropped = free >= (REGRASP if inside else LOST) - EARLY
        return Progress(left, lost="the needle was dropped" if dropped else "")

    def marks(self) -> Array:
        """Whether the needle is held, the share of the time that it must be, the share of the holes passed."""
        return np.array([self._held, min(self._kept / HOLD, 1.0), self._stage], dtype=float)


class Puncture(Insert):
    """Drive the needle, which is in hand above a block of soft tissue, in at one place of its top and out at another.

    Its tip shall go along the circle of its radius through both. Done when the needle is in the tissue, has punctured
    its top within 4 mm of each of them, its tip is out of the tissue and 5 mm beyond the second, and the arm's jaws
    have held it for the last 0.5 s.
    """

    holes = 0
    text = "drive the needle in at the top of the tissue and out again beside it"
    NEAR = 0.004
    scene, arm = "needle_insertion", "PSM2"
    models, thread = (0, 1, 2), True
    CHORD = 0.014

    def _ends(self) -> tuple[Array, Array]:
        """Two places on the top of the block, either side of its middle."""
        if not self._simulation.scene.tissues:
            raise ValueError("the scene has no body of soft tissue to puncture")
        nodes = self._simulation.state["tissue_node"][0, self._simulation.scene.tissues[0].rows]
        middle = np.append(0.5 * (nodes.min(axis=0) + nodes.max(axis=0))[:2], nodes[:, 2].max())
        aside = np.array([0.5 * self.CHORD, 0.0, 0.0])
        return middle - aside, middle + aside

    def _look(self) -> tuple[bool, bool, float]:
        state = self._simulation.state
        n = int(state["insertion_count"][0])
        in_tissue = (state["insertion_hole"][0, :n] == -1) & (state["insertion_body"][0, :n] == self._scenery.needle)
        places = state["puncture_point"][0, 0, : int(state["puncture_count"][0, 0])]
        near = [bool((np.linalg.norm(places - wanted, axis=1) < self.NEAR).any()) for wanted in self._places]
        tip, angle = self._tip()
        beyond = self.throw.towards_exit + RECOMMENDED_AXIAL / self.arc.radius
        out = beyond < angle < np.pi and float(tip[2]) > float(self._places[1][2])
        return bool(in_tissue.any() and all(near) and out), bool(in_tissue.any()), sum(near) / 2.0


GOALS: dict[str, type[Goal]] = {"reach": Reach, "pick": Pick, "insert": Insert, "puncture": Puncture}
"""Tasks by name."""
