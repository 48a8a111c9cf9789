"""A suture of soft tissue without hands: bites where the program wants them, and a wound drawn together.

Like `suture`, but nothing marks where stitches go: the program looks at the lips of the wound, chooses how much of
each lip a stitch takes, drives the needle through both, and pulls the thread tight between both arms. Run it
with ``--help``. World axes, metres, radians, seconds of simulated time.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import ligature
import numpy as np
from ligature.model.frames import axis_rotation, frame, inverse
from ligature.robots.operating_state import Rejected
from ligature.tasks import Measures
from ligature.tasks.throws import PAD, UP, Throw, pose_of
from ligature.tasks.wounds import ClosureScore, Stitch, Wound, torn

sys.path.insert(0, str(Path(__file__).resolve().parent))
from suture import (  # noqa: E402
    ABOVE,
    BEYOND,
    HOLD_DEPTHS,
    MEETING,
    OPEN,
    SHUT,
    STREAM,
    Failure,
    Film,
    Surgeon,
    perform,
)

Array = np.ndarray

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "soft_suturing" / "launch.yaml"
OUT, MOST_TURN, TURN = 0.004, 0.4, 0.05
"""Metres by which the tip must stand over the tissue, and radians by which the needle turns on for that: most, each."""

STANDS_OUT = 0.0064
"""Metres of needle that are in neither lip nor hand when it has been driven; bites of wide wounds are less for that."""

TAILS = (0.02, 0.016, 0.012)
"""Metres of thread between the first entry and the hand that holds its tail, one after the other where it misses."""

CROSS, OVER = 0.05, (0.012, 0.06)
"""Metres across and over the wound to which hands pull the ends of the thread: the tail's, and the needle's."""

DEEP = 0.007
"""Metres from the control point of a tool to where it holds the thread, which swings: deep between its fingers."""

BEHIND = 0.015
"""Metres by which a tool stands behind the thread, along itself, before it takes it."""

LEANS = np.radians(np.arange(-60, 61, 15))
"""Angles by which a tool may lean about the thread that it takes."""

TIGHT, MOST_PULL, PACE, MOST_WAY = 0.2e-3, 8.0, 0.015, 0.09
"""Gap at which a stitch is tight, tension that the thread may get, speed of the hands, and how far each goes."""


@dataclass(frozen=True)
class Plan:
    """Which bites to take: ``stitches`` of them, ``width`` metres of each lip at most, ``spacing`` metres apart.

    ``depth``, in metres below the top where a stitch passes the walls, decides the width where it is given: the needle
    turns on its own circle.
    """

    stitches: int = 1
    width: float = 0.0045
    spacing: float = 0.008
    depth: float | None = None

    @property
    def places(self) -> list[float]:
        """Places of the stitches along the wound, from its middle."""
        return [self.spacing * (k - 0.5 * (self.stitches - 1)) for k in range(self.stitches)]

    def width_for(self, gap: float, radius: float) -> float:
        """Width of each lip that a needle of ``radius`` takes of a wound that gapes by ``gap``, metres.

        Raises
        ------
        ValueError
            When the needle does not get as deep as planned.
        """
        if self.depth is None:
            return self.width
        low = np.sqrt(radius**2 - 0.25 * gap**2)
        if not 0.0 < self.depth < low:
            raise ValueError(
                f"a needle of radius {1e3 * radius:.1f} mm cannot pass {1e3 * self.depth:.1f} mm below the top; "
                f"choose more than 0 and less than {1e3 * low:.1f} mm"
            )
        return float(np.sqrt(radius**2 - (low - self.depth) ** 2) - 0.5 * gap)


class TissueSurgeon(Surgeon):
    """Two arms that suture a wound."""

    def __init__(self, simulation: ligature.Simulation, plan: Plan, watch: Callable[[], object] = lambda: None) -> None:
        self.plan, self.wound = plan, Wound.of(simulation.scene)
        self.made: list[Stitch | None] = []
        self.force = 0.0
        super().__init__(simulation, watch, 0)
        self.open_gap = max(self.gaps())
        reach = 2.0 * self.arc.radius * np.sin(0.5 * (max(HOLD_DEPTHS) - STANDS_OUT) / self.arc.radius)
        self.width = min(plan.width_for(self.open_gap, self.arc.radius), 0.5 * (reach - self.open_gap))
        places = self._state["body_pose"][list(self.monitor.scenery.thread), :3]
        self._spacing = float(np.linalg.norm(np.diff(places, axis=0), axis=1).mean())

    @property
    def _state(self) -> Any:
        return self.simulation.state[0]

    def see(self) -> None:
        """Look at the simulation, and keep the largest force on the tissue."""
        super().see()
        self.force = max(self.force, float(self._state["tissue_peak"][self.wound.tissue.index]))

    def ends(self, pair: int) -> tuple[Array, Array]:
        """Where a stitch goes in and out, (3,) each."""
        place = self.plan.places[pair - 1]
        near, far = (self.wound.point(self._state, side, place, self.width) for side in (-1, 1))
        return near, far

    def meeting(self, throw: Throw) -> Array:
        """The tail towards the arm that drives, the tip towards the one that pulls, so that they need not cross."""
        return frame(np.eye(3), MEETING * UP) @ throw.arc_at(throw.towards_exit, self.arc)

    def hand_over(self, giver: str, taker: str, throw: Throw) -> None:
        """The needle is brought to where the hands meet, and goes to the other arm."""
        self.line(giver, self.meeting(throw) @ inverse(self.needle()) @ self.tool(giver))
        super().hand_over(giver, taker, throw)

    def tip(self) -> Array:
        """Where the needle's tip is, (3,)."""
        return self.monitor.scenery.needle_points(self._state["body_pose"])[2]

    def reached(self, throw: Throw) -> float:
        """Angle past the entry at which the tip is."""
        way = throw.axes.T @ (self.tip() - throw.centre)
        return float(np.arctan2(way[1], way[0]) % (2.0 * np.pi))

    def drive(self, name: str, throw: Throw) -> None:
        """Turn the needle in, and on until its tip is out far enough to be taken: the lips yield meanwhile."""
        super().drive(name, throw)
        exit = throw.centre + self.arc.radius * throw.axes @ np.array(
            [np.cos(throw.towards_exit), np.sin(throw.towards_exit), 0.0]
        )
        end = throw.towards_exit + BEYOND
        while (self.tip() - exit) @ self.up < OUT:
            if end > throw.towards_exit + BEYOND + MOST_TURN:
                raise Failure("the needle's tip did not come out of the tissue")
            self.turn(name, throw, end, end + TURN)
            end += TURN

    # --- the thread ---------------------------------------------------------------------------

    def take_thread(self, name: str, entry: Array) -> None:
        """Take the thread where it comes out of the tissue at ``entry`` (3,), some way before it."""
        self.jaw(name, OPEN)
        for tail in TAILS:
            self.line(name, frame(np.eye(3), ABOVE * UP) @ self.tool(name))
            self.move(name, frame(np.eye(3), ABOVE * UP) @ self._before_thread(name, entry, tail, BEHIND))
            self.line(name, self._before_thread(name, entry, tail, BEHIND))
            self.line(name, self._before_thread(name, entry, tail, 0.0))
            self.jaw(name, SHUT, 0.5)
            self.wait(0.2)
            if self.holds(name):
                return
            self.jaw(name, OPEN)
        raise Failure(f"{name} closed on nothing, not on the thread")

    def _before_thread(self, name: str, entry: Array, tail: float, behind: float) -> Array:
        """Pose (4, 4) of a tool ``behind`` the place of the thread ``tail`` before the entry, as it lies now."""
        poses = self._state["body_pose"][list(self.monitor.scenery.thread)]
        nearest = int(np.argmin(np.linalg.norm(poses[:, :3] - entry, axis=1)))
        T = self._tool_at(name, pose_of(poses[min(nearest + round(tail / self._spacing), len(poses) - 2)]))
        return frame(np.eye(3), -behind * T[:3, 2]) @ T

    def _tool_at(self, name: str, T_element: Array) -> Array:
        """Pose (4, 4) of a tool that grasps an element of the thread from above, far from the limits of its joints."""
        kinematics, base = self.arms[name].kinematics, self._base[name]
        along = T_element[:3, 2]
        down = (along @ UP) * along - UP
        span = kinematics.upper - kinematics.lower
        best, margin = None, 0.0
        for sign in (1.0, -1.0):
            for lean in LEANS:
                z = axis_rotation(along, lean) @ (down / np.linalg.norm(down))
                x = sign * along
                T = frame(np.column_stack([x, np.cross(z, x), z]), T_element[:3, 3] - DEEP * z)
                behind = frame(np.eye(3), -BEHIND * z) @ T
                way = [inverse(base) @ at for at in (frame(np.eye(3), ABOVE * UP) @ behind, behind, T)]
                path = kinematics.inverse(np.array(way))
                if not path.ok.all() or z @ UP > 0.0:
                    continue
                inside = np.minimum(path.q - kinematics.lower, kinematics.upper - path.q) / span
                found = float(inside.min()) - 0.05 * abs(lean)
                if found > margin:
                    best, margin = T, found
        if best is None:
            raise Failure(f"{name} cannot reach the thread")
        return best

    def draw_tight(self, names: tuple[str, str]) -> None:
        """Cross the ends of the thread over the wound, the tail low and the needle above it, until the lips meet.

        Pulled apart, they would open it: a lip feels the thread in the wound, and its own end of it.
        """
        across = self.wound.axes(self._state)[:, 0]
        middle = sum(self.ends(1)) / 2.0
        goals = [self.tool(name) for name in names]
        targets = [middle + side * CROSS * across + up * UP for side, up in zip((1.0, -1.0), OVER, strict=True)]
        for _ in range(round(MOST_WAY / (PACE * STREAM))):
            if max(self.gaps()) < TIGHT or self.tension() > MOST_PULL:
                break
            for name, goal, target in zip(names, goals, targets, strict=True):
                way = target - goal[:3, 3] - PAD * goal[:3, 2]
                goal[:3, 3] += PACE * STREAM * way / max(float(np.linalg.norm(way)), PACE * STREAM)
                try:
                    self.arms[name].servo_cp(inverse(self._base[name]) @ goal)
                except Rejected as rejection:
                    raise Failure(str(rejection)) from rejection
            self.wait(STREAM)
        self.wait(0.5)

    def tension(self) -> float:
        """Largest tension of the thread, N."""
        return float(np.abs(self._state["rod_tension"][list(self.monitor.scenery.thread)]).max())

    def gaps(self) -> list[float]:
        """Width of the wound at each stitch of the plan."""
        return [self.wound.gap(self._state, place) for place in self.plan.places]

    # --- the suture ---------------------------------------------------------------------------

    def suture_wound(self, driver: str = "PSM2", puller: str = "PSM1") -> None:
        """All stitches of the plan, and the wound drawn together."""
        self.prepare()
        self.pick_up(puller, self.throw(1))
        for number, place in enumerate(self.plan.places, 1):
            throw = self.throw(number)
            self.hand_over(puller, driver, throw)
            self.drive(driver, throw)
            self.made.append(self.wound.stitch(self._state, place))
            self.pull_out(puller, driver, throw)
        self.take_thread(driver, self.ends(1)[0])
        self.draw_tight((driver, puller))

    def score(self) -> ClosureScore:
        """How well it went until now."""
        state, places = self._state, self.plan.places
        after = [self.wound.stitch(state, place) for place, _ in zip(places, self.made, strict=False)]
        return ClosureScore(
            (self.plan.stitches, self.width), tuple(s for s in self.made if s is not None), self.open_gap,
            tuple(self.gaps()), torn(self.made, after), self.force, self.monitor.measures().thread_tension,
            self.simulation.time,
        )  # fmt: skip


def operate(
    simulation: ligature.Simulation, plan: Plan, film: Film | None = None
) -> tuple[ClosureScore, Measures, str]:
    """Suture; returns how well it went, what was measured, and why it stopped, if it did."""
    surgeon = TissueSurgeon(simulation, plan, film.watch if film else lambda: None)
    surgeon.wait(0.3)
    stopped = ""
    try:
        surgeon.suture_wound()
    except Failure as failure:
        stopped = str(failure)
    return surgeon.score(), surgeon.monitor.measures(), stopped


def main() -> int:
    """Make a suture and print how well it went."""
    arguments = argparse.ArgumentParser(description="Two arms suture a wound in soft tissue by themselves.")
    arguments.add_argument("--stitches", type=int, choices=(1, 2, 3), default=1)
    arguments.add_argument("--width", type=float, default=0.0045, help="metres of each lip that a stitch takes")
    arguments.add_argument("--spacing", type=float, default=0.008, help="metres between stitches")
    arguments.add_argument("--depth", type=float, help="metres below the top at the walls, instead of a width")
    arguments.add_argument("--seed", type=int, default=0, help="where the needle lies; 0 is the scene's own place")
    arguments.add_argument("--out", type=Path, help="folder for pictures and an animation")
    arguments.add_argument("--scene", type=Path, default=SCENE, help="launch file")
    given = arguments.parse_args()
    lengths = (given.width, given.spacing, 0.001 if given.depth is None else given.depth)
    if given.seed < 0 or not all(0.0 < length < 1.0 for length in lengths):
        arguments.error("--seed is at least 0, and --width, --spacing and --depth are metres, above 0 and below 1")
    plan = Plan(given.stitches, given.width, given.spacing, given.depth)
    return perform(given, lambda simulation, film: operate(simulation, plan, film))


if __name__ == "__main__":
    sys.exit(main())
