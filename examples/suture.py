"""A suture without hands: two arms pick up a needle and make throws through a pad, by the calls a real robot takes.

The program localises from ground truth, plans with closed-form kinematics (`ligature.tasks.throws`), and moves the
arms by CRTK alone: ``move_cp``, ``servo_cp``, ``jaw/servo_jp``, ``measured_cp``. Run it with ``--help``.
World axes, metres, radians, seconds of simulated time.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import ligature
import numpy as np
from ligature.model.frames import axis_rotation, frame, inverse, matrix_pose7
from ligature.paths import reason
from ligature.render.context import RenderUnavailable
from ligature.robots.operating_state import Rejected
from ligature.robots.poses import rotation_vector
from ligature.robots.psm_arm import PsmArm
from ligature.tasks import Measures, Monitor, Scenery, SutureScore, judge_suture
from ligature.tasks.throws import UP, NeedleArc, Throw, best_grasp, pose_of
from PIL import Image

SCENE = Path(__file__).resolve().parents[1] / "scenes" / "suturing" / "launch.yaml"
STREAM = 0.005
"""Seconds between two set-points of a stream: 200 Hz."""

HOLD_DEPTHS = (0.020, 0.0205, 0.021)
"""Metres from the needle's tip at which it may be held to drive it."""

PULL_DEPTHS = (0.0018, 0.0022, 0.0026)
"""The same for the hand that pulls it out."""

PICK_DEPTHS = (0.003, 0.004, 0.005)
"""The same for the hand that picks it up."""

ASIDE = (0.0, 4e-4, -4e-4)
"""Metres along the needle by which a hand that has closed on nothing tries beside the place."""

OPEN, SHUT = 0.8, -0.35
ABOVE, MEETING, BEFORE, BEYOND = 0.02, 0.03, 0.4, 0.5
"""Metres above the work when moving and when handing over; angles of the tip before the entry and beyond the exit."""

FILM_PERIOD, FILM_SIZE = 0.25, (640, 400)
"""Seconds between two pictures of the film, and their width and height."""

FILM_SHOWN, FILM_QUALITY = 80, 45
"""Milliseconds for which each is shown, and how well it is kept, of 100."""

Array = np.ndarray


class Failure(RuntimeError):
    """The suture cannot go on; its text is what went wrong."""


class Surgeon:
    """Two arms, a needle, and how they work together."""

    up = UP
    """Which way the surface of the tissue faces."""

    def __init__(
        self, simulation: ligature.Simulation, watch: Callable[[], object] = lambda: None, pairs: int = 1
    ) -> None:
        self.simulation, self._watch = simulation, watch
        scene = simulation.scene
        self.monitor = Monitor(scene, Scenery.of(scene, pairs))
        self._needle = simulation.bodies[scene.bodies[self.monitor.scenery.needle].identity.topic]
        self.arc = NeedleArc.of(scene.needles[0], scene.bodies[self.monitor.scenery.needle])
        self._base = {arm.name: scene.bodies[arm.base].T_world_body for arm in scene.arms if arm.base >= 0}
        self.arms, self.jaws = {}, {}
        for name in ("PSM1", "PSM2"):
            arm = simulation.arms[name]
            if not isinstance(arm, PsmArm) or arm.jaw is None:
                raise Failure(f"{name} is not a PSM with a jaw")
            self.arms[name], self.jaws[name] = arm, arm.jaw

    # --- time and seeing --------------------------------------------------------------------

    def wait(self, seconds: float) -> None:
        """Advance the simulation, and look at it all the while."""
        for _ in range(max(1, round(seconds / STREAM))):
            self.simulation.step(round(STREAM / self.simulation.dt))
            self.see()

    def see(self) -> None:
        """Look at the simulation, which this or something else has advanced."""
        self.monitor.observe(self.simulation.state[0])
        self._watch()

    def needle(self) -> Array:
        """Pose (4, 4) of the needle's arc frame."""
        return pose_of(self._needle.pose) @ self.arc.T_body_arc

    def tool(self, name: str) -> Array:
        """Pose (4, 4) of an arm's tool by its own sensors."""
        return self._base[name] @ pose_of(self.arms[name].local_measured_cp())

    def ends(self, pair: int) -> tuple[Array, Array]:
        """Where a throw goes in and out, (3,) each: the holes of a pair."""
        entry, exit = (self.simulation.bodies[f"BODY {side}{pair}"].pose[:3] for side in ("Entry", "Exit"))
        return entry, exit

    # --- moving -----------------------------------------------------------------------------

    def move(self, name: str, T_world_tool: Array) -> None:
        """Go there on a joint trajectory, and wait for it."""
        arm = self.arms[name]
        try:
            arm.move_cp(inverse(self._base[name]) @ T_world_tool)
        except Rejected as rejection:
            raise Failure(str(rejection)) from rejection
        while arm.is_busy:
            self.wait(0.02)

    def glide(self, name: str, poses: Iterator[Array]) -> None:
        """Stream poses of the tool, one each `STREAM`."""
        arm = self.arms[name]
        for T in poses:
            try:
                arm.servo_cp(inverse(self._base[name]) @ T)
            except Rejected as rejection:
                raise Failure(str(rejection)) from rejection
            self.wait(STREAM)

    def line(self, name: str, goal: Array, speed: float = 0.045) -> None:
        """Stream the straight way to a pose of the tool."""
        start = self.tool(name)
        way = goal[:3, 3] - start[:3, 3]
        turn = rotation_vector(start[:3, :3].T @ goal[:3, :3])
        angle = float(np.linalg.norm(turn))
        steps = max(2, int(max(float(np.linalg.norm(way)) / speed, angle / 2.0) / STREAM))
        axis = turn / angle if angle > 1e-9 else UP
        self.glide(
            name,
            (
                frame(start[:3, :3] @ axis_rotation(axis, angle * s), start[:3, 3] + s * way)
                for s in np.linspace(0.0, 1.0, steps + 1)[1:]
            ),
        )

    def turn(self, name: str, throw: Throw, begin: float, end: float, speed: float = 1.0) -> None:
        """Turn the needle that ``name`` holds along the throw's circle, its tip from one angle to another."""
        T_arc_tool = inverse(self.needle()) @ self.tool(name)
        steps = max(2, int(abs(end - begin) / speed / STREAM))
        self.glide(name, (throw.arc_at(a, self.arc) @ T_arc_tool for a in np.linspace(begin, end, steps)))

    def jaw(self, name: str, angle: float, seconds: float = 0.3) -> None:
        """Open or close the jaw."""
        jaw = self.jaws[name]
        start = float(jaw.setpoint_js().position[0])
        for s in np.linspace(0.0, 1.0, max(2, int(seconds / STREAM))):
            jaw.servo_jp([start + s * (angle - start)])
            self.wait(STREAM)

    def take(self, name: str, T_arc_tool: Array) -> None:
        """Come from behind, close on the needle, and make sure that something is between the fingers.

        Looks at the needle again on the way: a taut thread turns it in the other hand.
        """
        self.jaw(name, OPEN)
        self.line(name, frame(np.eye(3), ABOVE * UP) @ self.tool(name))
        self.move(name, frame(np.eye(3), ABOVE * UP) @ self._behind(T_arc_tool))
        self.line(name, self._behind(T_arc_tool))
        for aside in ASIDE:
            self.line(name, self.needle() @ T_arc_tool @ frame(np.eye(3), np.array([aside, 0.0, 0.0])))
            self.jaw(name, SHUT, 0.5)
            self.wait(0.2)
            if self.holds(name):
                return
            self.jaw(name, OPEN)
        raise Failure(f"{name} closed on nothing")

    def holds(self, name: str) -> bool:
        """Whether something is between the fingers."""
        return self.simulation.grasps[name] is not None

    def _behind(self, T_arc_tool: Array) -> Array:
        """Where a tool stands before it takes the needle: drawn back along itself."""
        T = self.needle() @ T_arc_tool
        return frame(np.eye(3), -0.015 * T[:3, 2]) @ T

    def leave(self, name: str) -> None:
        """Open, and draw back along the tool."""
        self.jaw(name, OPEN)
        T = self.tool(name)
        self.line(name, frame(np.eye(3), -0.02 * T[:3, 2]) @ T)

    # --- the suture -------------------------------------------------------------------------

    def prepare(self) -> None:
        """Enable and home both arms."""
        for arm in self.arms.values():
            arm.home()
        while any(arm.is_busy or not arm.is_homed for arm in self.arms.values()):
            self.wait(0.05)

    def throw(self, pair: int) -> Throw:
        """The circle through both ends of a throw."""
        return Throw.through(*self.ends(pair), self.arc.radius, self.up)

    def meeting(self, throw: Throw) -> Array:
        """Pose (4, 4) of the arc frame in which the needle is handed over."""
        return frame(np.eye(3), MEETING * UP) @ throw.arc_at(-BEFORE, self.arc)

    def pick_up(self, name: str, throw: Throw) -> None:
        """Take the needle from the pad near its tip, and hold it up where it is handed over."""
        waiting = self.meeting(throw)
        grasp = self._grasp(name, PICK_DEPTHS, [waiting], self.needle(), upright=True)
        self.take(name, grasp)
        T = self.tool(name)
        self.line(name, frame(np.eye(3), MEETING * UP) @ T)
        self.move(name, waiting @ inverse(self.needle()) @ self.tool(name))

    def _grasp(
        self, name: str, depths: tuple[float, ...], way: list[Array], now: Array, upright: bool = False
    ) -> Array:
        """Pose (4, 4) of the tool in the arc frame that reaches the whole way, and where the needle is now."""
        kinematics, base = self.arms[name].kinematics, self._base[name]
        grasp = best_grasp(self.arc, depths, kinematics, base, way, now, self.ends(1)[0], upright, self.up)
        if grasp is None:
            raise Failure(f"{name} has no grasp of the needle that reaches the whole throw")
        return grasp.tool_in_arc(self.arc)

    def drive(self, name: str, throw: Throw) -> None:
        """Turn the needle, which ``name`` holds, in at the entry and out at the exit."""
        start = throw.arc_at(-BEFORE, self.arc) @ inverse(self.needle()) @ self.tool(name)
        self.move(name, frame(np.eye(3), ABOVE * UP) @ start)
        start = throw.arc_at(-BEFORE, self.arc) @ inverse(self.needle()) @ self.tool(name)
        self.line(name, start)
        self.turn(name, throw, -BEFORE, throw.towards_exit + BEYOND)

    def reached(self, throw: Throw) -> float:
        """Angle past the entry at which the tip is when the needle has been driven."""
        return throw.towards_exit + BEYOND

    def pull_out(self, name: str, other: str, throw: Throw, out: float = 0.035) -> None:
        """``name`` takes the tip beyond the exit, ``other`` lets go, and the needle and its thread come out."""
        tip = self.reached(throw)
        rest = self.arc.end - self.arc.begin
        way = [throw.arc_at(a, self.arc) for a in np.linspace(tip, throw.towards_exit + rest + 0.3, 10)]
        self.take(name, self._grasp(name, PULL_DEPTHS, way, self.needle()))
        self.leave(other)
        self.turn(name, throw, tip, throw.towards_exit + rest + 0.3)
        T = self.tool(name)
        self.line(name, frame(np.eye(3), out * UP) @ T, 0.025)

    def hand_over(self, giver: str, taker: str, throw: Throw) -> None:
        """The needle goes to the arm that drives the next throw."""
        self.take_to_drive(taker, throw)
        self.leave(giver)

    def take_to_drive(self, name: str, throw: Throw) -> None:
        """Take the needle where it is, as it is held to be driven all the way."""
        way = [throw.arc_at(a, self.arc) for a in np.linspace(-BEFORE, throw.towards_exit + BEYOND, 12)]
        self.take(name, self._grasp(name, HOLD_DEPTHS, way, self.needle()))

    def suture(self, pairs: tuple[int, ...], driver: str = "PSM2", puller: str = "PSM1") -> None:
        """Throws through ``pairs``, from picking the needle up to pulling it out of the last hole."""
        self.prepare()
        throw = self.throw(pairs[0])
        self.pick_up(puller, throw)
        for pair in pairs:
            throw = self.throw(pair)
            self.hand_over(puller, driver, throw)
            self.drive(driver, throw)
            self.pull_out(puller, driver, throw)


def scatter(simulation: ligature.Simulation, seed: int) -> None:
    """Lay the needle somewhere else on the pad, turned otherwise; seed 0 leaves it."""
    if seed == 0:
        return
    rng = np.random.default_rng(seed)
    body = simulation.scene.needles[0].body
    handle = simulation.bodies[simulation.scene.bodies[body].identity.topic]
    T = pose_of(handle.pose)
    turned = axis_rotation(UP, float(rng.uniform(-0.6, 0.6)))
    shift = np.append(rng.uniform(-0.008, 0.008, 2), 0.0)
    handle.set_pose(matrix_pose7(frame(turned @ T[:3, :3], T[:3, 3] + shift)).tolist())


class Film:
    """Pictures of a camera while time passes: one now and then as a file, all of them as a short animation."""

    def __init__(self, simulation: ligature.Simulation, folder: Path, camera: str = "cameraL") -> None:
        self._simulation, self._folder = simulation, folder
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            sys.exit(f"error: '{folder}': {reason(error)}")
        self._camera = simulation.cameras[camera]
        self._frames: list[Image.Image] = []
        self._next = 0.0
        self.unavailable = ""

    def watch(self) -> None:
        """Take a picture when it is time for one; where nothing can be drawn, `unavailable` gets the reason."""
        if self._simulation.time >= self._next and not self.unavailable:
            self._next += FILM_PERIOD
            try:
                self._frames.append(Image.fromarray(self._camera.capture(FILM_SIZE, passes=("rgb",)).rgb))
            except RenderUnavailable as error:
                self.unavailable = str(error)

    def save(self) -> str:
        """Write ``suture.webp`` and eight pictures along the way; nothing half-written stays under these names.

        Returns what was done, for the user.
        """
        if not self._frames:
            return f"no pictures: {self.unavailable}"
        try:
            self._write()
        except OSError as error:
            return f"no pictures: '{self._folder}' cannot be written: {reason(error)}"
        return f"pictures in {self._folder}"

    def _write(self) -> None:
        for number, index in enumerate(np.linspace(0, len(self._frames) - 1, 8).round().astype(int), 1):
            self._frames[index].save(self._folder / f"suture_{number}.png")
        part = self._folder / "suture.webp.part"
        first, *rest = self._frames
        first.save(part, format="WEBP", save_all=True, append_images=rest, duration=FILM_SHOWN, quality=FILM_QUALITY)
        part.replace(self._folder / "suture.webp")


def operate(
    simulation: ligature.Simulation, throws: int, film: Film | None = None
) -> tuple[SutureScore, Measures, str]:
    """Suture; returns how well it went, what was measured, and why it stopped, if it did."""
    surgeon = Surgeon(simulation, film.watch if film else lambda: None)
    surgeon.wait(0.3)
    pairs, stopped = tuple(range(1, throws + 1)), ""
    try:
        surgeon.suture(pairs)
    except Failure as failure:
        stopped = str(failure)
    monitor, poses = surgeon.monitor, simulation.state["body_pose"][0]
    score = judge_suture(monitor.scenery, poses, monitor.passages, simulation.time, throws)
    return score, monitor.measures(), stopped


def perform(
    given: argparse.Namespace, suture: Callable[[ligature.Simulation, Film | None], tuple[Any, Measures, str]]
) -> int:
    """Load the scene, suture, print how it went, and keep the pictures; returns the exit status."""
    try:
        simulation = ligature.Simulation(ligature.load(given.scene))
    except ligature.SceneError as error:
        sys.exit(str(error))
    scatter(simulation, given.seed)
    film = Film(simulation, given.out) if given.out else None
    started = time.perf_counter()
    score, measures, stopped = suture(simulation, film)
    took = time.perf_counter() - started
    lines = [
        *score.lines(),
        *measures.lines(),
        f"computed in {took:.1f} s, {simulation.time / took:.2g} times real time",
    ]
    print("\n".join([f"stopped: {stopped}", *lines] if stopped else lines))
    if film is not None:
        print(film.save())
    return 0 if score.success and not stopped else 1


def seed_and_folder(description: str, seed: str) -> argparse.Namespace:
    """The options ``--seed``, which is for what ``seed`` names, and ``--out`` of a program that has no others."""
    arguments = argparse.ArgumentParser(description=description)
    arguments.add_argument("--seed", type=int, default=0, help=seed)
    arguments.add_argument("--out", type=Path, help="folder for pictures and an animation")
    given = arguments.parse_args()
    if given.seed < 0:
        arguments.error("--seed is at least 0")
    return given


def main() -> int:
    """Make a suture and print how well it went."""
    arguments = argparse.ArgumentParser(description="Two arms suture a pad by themselves.")
    arguments.add_argument(
        "--throws", type=int, choices=(1, 2, 3, 4), default=2, help="from the first pair of holes on"
    )
    arguments.add_argument("--seed", type=int, default=0, help="where the needle lies; 0 is the scene's own place")
    arguments.add_argument("--out", type=Path, help="folder for pictures and an animation")
    arguments.add_argument("--scene", type=Path, default=SCENE, help="launch file; launch_400006.yaml has other tools")
    given = arguments.parse_args()
    if given.seed < 0:
        arguments.error("--seed is at least 0")
    return perform(given, lambda simulation, film: operate(simulation, given.throws, film))


if __name__ == "__main__":
    sys.exit(main())
