"""A suture of soft tissue without hands: bites where the program wants them, and threads drawn tight.

Like `suture`, but nothing marks where stitches go: the program looks at the edges of the wound, chooses how much of
each lip a stitch takes, drives the needle through both, and closes the wound with the thread between both arms. Run it
with ``--help``. World axes, metres, radians, seconds of simulated time.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import ligature
import numpy as np
from ligature.model.frames import axis_rotation, frame, inverse
from ligature.tasks import Measures, Scenery
from ligature.tasks.throws import PAD, UP, Throw, pose_of
from ligature.tasks.wounds import Bite, ClosureScore, Wound, judge_closure

sys.path.insert(0, str(Path(__file__).resolve().parent))
from suture import ABOVE, BEYOND, OPEN, SHUT, STREAM, Failure, Film, Surgeon, scatter  # noqa: E402

Array = np.ndarray

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "soft_suturing" / "launch.yaml"
OUT, MOST_TURN = 0.003, 0.5
"""Metres by which the tip must come out of the tissue, and radians by which the needle turns on for that at most."""

TAIL = 0.012
"""Metres of thread between the entry and the hand that holds its tail."""

LEANS = np.radians([-40.0, -20.0, 0.0, 20.0, 40.0])
"""Angles by which a tool may lean that takes the thread."""

TIGHT, MOST_PULL, PACE, MOST_WAY = 0.2e-3, 3.0, 0.01, 0.03
"""Gap at which a stitch is tight enough, tension that the thread may get, speed of the hands, and how far they go."""


@dataclass(frozen=True)
class Plan:
    """Which bites to take: ``stitches`` of them, ``width`` metres of each lip, ``spacing`` metres apart."""

    stitches: int = 1
    width: float = 0.004
    spacing: float = 0.008

    @property
    def places(self) -> list[float]:
        """Places of the stitches along the wound, from its middle on."""
        return [self.spacing * (k - 0.5 * (self.stitches - 1)) for k in range(self.stitches)]


class TissueSurgeon(Surgeon):
    """Two arms that suture a wound."""

    def __init__(self, simulation: ligature.Simulation, plan: Plan, watch: Callable[[], object] = lambda: None) -> None:
        self.plan, self.wound = plan, Wound.of(simulation.scene)
        self.bites: list[Bite] = []
        self.made: list[tuple[float, float] | None] = []
        self.depth = 0.0
        super().__init__(simulation, watch, Scenery.of(simulation.scene, 0))
        self.open_gap = self.wound.gap(self._state, 0.0)
        self._rod = next(rod for rod in simulation.scene.rods if set(rod.bodies) == set(self.monitor.scenery.thread))
        places = self._state["body_pose"][list(self._rod.bodies), :3]
        self._rod_length = float(np.linalg.norm(np.diff(places, axis=0), axis=1).sum())

    @property
    def _state(self):
        return self.simulation.state[0]

    def ends(self, number: int) -> tuple[Array, Array]:
        """Where a stitch goes in and out, (3,) each."""
        bite = self.wound.bite(self._state, self.plan.places[number - 1], self.plan.width)
        return bite.entry, bite.exit

    def tip(self) -> Array:
        """Where the needle's tip is, (3,)."""
        return self.monitor.scenery.needle_points(self._state["body_pose"])[2]

    def drive(self, name: str, throw: Throw) -> None:
        """Turn the needle in, and on until its tip is out far enough to be taken."""
        super().drive(name, throw)
        surface = throw.centre + throw.axes[:, 0] * self.arc.radius
        end, most = throw.towards_exit + BEYOND, throw.towards_exit + BEYOND + MOST_TURN
        while (self.tip() - surface) @ UP < OUT:
            if end > most:
                raise Failure("the needle's tip did not come out of the tissue")
            self.turn(name, throw, end, end + 0.05)
            end += 0.05

    def tension(self) -> float:
        """Largest tension of the thread, N."""
        return float(np.abs(self._state["rod_tension"][list(self.monitor.scenery.thread)]).max())

    def take_thread(self, name: str, ahead: Array) -> None:
        """Take the thread where it lies on the tissue, `TAIL` before where it goes in at ``ahead`` (3,)."""
        poses = self._state["body_pose"][list(self._rod.bodies)]
        nearest = int(np.argmin(np.linalg.norm(poses[:, :3] - ahead, axis=1)))
        length = self._rod_length / len(poses)
        element = min(nearest + round(TAIL / length), len(poses) - 2)
        T = self._tool_at(name, pose_of(poses[element]))
        self.jaw(name, OPEN)
        self.line(name, frame(np.eye(3), ABOVE * UP) @ self.tool(name))
        self.move(name, frame(np.eye(3), ABOVE * UP) @ T)
        self.line(name, T)
        self.jaw(name, SHUT, 0.5)
        self.wait(0.2)
        if not self.holds(name):
            raise Failure(f"{name} closed on nothing, not on the thread")

    def _tool_at(self, name: str, T_element: Array) -> Array:
        """Pose of a tool from above that grasps an element of the thread, far from the limits of its joints."""
        kinematics, base = self.arms[name].kinematics, self._base[name]
        along = T_element[:3, 2] - (T_element[:3, 2] @ UP) * UP
        along /= np.linalg.norm(along)
        span = kinematics.upper - kinematics.lower
        best, margin = None, 0.0
        for sign in (1.0, -1.0):
            for tilt in LEANS:
                for pivot in LEANS:
                    z = axis_rotation(along, tilt) @ axis_rotation(np.cross(UP, along), pivot) @ -UP
                    x = sign * (along - (along @ z) * z)
                    x /= np.linalg.norm(x)
                    T = frame(np.column_stack([x, np.cross(z, x), z]), T_element[:3, 3] - PAD * z)
                    above = frame(np.eye(3), ABOVE * UP) @ T
                    path = kinematics.inverse(np.array([inverse(base) @ T, inverse(base) @ above]))
                    if not path.ok.all():
                        continue
                    inside = float((np.minimum(path.q - kinematics.lower, kinematics.upper - path.q) / span).min())
                    inside -= 0.05 * (abs(tilt) + abs(pivot))
                    if inside > margin:
                        best, margin = T, inside
        if best is None:
            raise Failure(f"{name} cannot reach the thread")
        return best

    def draw_tight(self, names: tuple[str, str], place: float) -> None:
        """Pull the tail with one hand and the needle with the other, until the lips meet or the thread is taut."""
        across = self.wound.directions(self._state)[:, 0]
        ways = [-0.8 * across + 0.6 * UP, 0.8 * across + 0.6 * UP]
        goals = [self.tool(name) for name in names]
        for _ in range(round(MOST_WAY / (PACE * STREAM))):
            if self.wound.gap(self._state, place) < TIGHT or self.tension() > MOST_PULL:
                break
            for name, goal, way in zip(names, goals, ways, strict=True):
                goal[:3, 3] += PACE * STREAM * way
                self.arms[name].servo_cp(inverse(self._base[name]) @ goal)
            self.wait(STREAM)
        self.wait(0.5)

    def suture_wound(self, driver: str = "PSM2", puller: str = "PSM1") -> None:
        """All stitches of the plan, and the wound drawn together."""
        self.prepare()
        self.pick_up(puller, self.throw(1))
        for number, place in enumerate(self.plan.places, 1):
            throw = self.throw(number)
            self.bites.append(self.wound.bite(self._state, place, self.plan.width))
            self.made.append(None)
            self.hand_over(puller, driver, throw)
            self.drive(driver, throw)
            self.pull_out(puller, driver, throw)
            self.made[-1] = self.wound.widths(self._state, place)
        self.take_thread(driver, self.bites[0].entry)
        self.draw_tight((driver, puller), self.plan.places[0])


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
    state = simulation.state[0]
    score = judge_closure(
        surgeon.wound, state, surgeon.bites, surgeon.made, plan.width, surgeon.open_gap, surgeon.depth, simulation.time
    )
    return score, surgeon.monitor.measures(), stopped


def main() -> int:
    """Make a suture and print how well it went."""
    arguments = argparse.ArgumentParser(description="Two arms suture a wound in soft tissue by themselves.")
    arguments.add_argument("--stitches", type=int, choices=(1, 2, 3), default=1)
    arguments.add_argument("--width", type=float, default=0.004, help="metres of each lip that a stitch takes")
    arguments.add_argument("--spacing", type=float, default=0.008, help="metres between stitches")
    arguments.add_argument("--seed", type=int, default=0, help="where the needle lies; 0 is the scene's own place")
    arguments.add_argument("--out", type=Path, help="folder for pictures and an animation")
    arguments.add_argument("--scene", type=Path, default=SCENE, help="launch file")
    given = arguments.parse_args()
    simulation = ligature.Simulation(ligature.load(given.scene))
    scatter(simulation, given.seed)
    film = Film(simulation, given.out) if given.out else None
    started = time.perf_counter()
    score, measures, stopped = operate(simulation, Plan(given.stitches, given.width, given.spacing), film)
    took = time.perf_counter() - started
    lines = [
        *score.lines(),
        *measures.lines(),
        f"computed in {took:.1f} s, {simulation.time / took:.1f} times real time",
    ]
    print("\n".join([f"stopped: {stopped}", *lines] if stopped else lines))
    if film is not None:
        print(film.save())
    return 0 if score.success and not stopped else 1


if __name__ == "__main__":
    sys.exit(main())
