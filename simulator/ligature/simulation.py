"""The simulation in process: the tick, the Python API, snapshots and the state hash.

World axes, SI units; poses are x y z qx qy qz qw. There is no clock, no thread and no ROS here: the
same scene, commands and calls give the same bits.
"""

from __future__ import annotations

import gc
import hashlib
import math
import time as clock
import weakref
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from numbers import Real
from operator import methodcaller
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic
from ligature.arms import ArmSet
from ligature.coasting import PHASES as COASTED
from ligature.coasting import Coasting
from ligature.grasping import ActuatorAttachments, ActuatorGrasps, Grasps
from ligature.model.commands import (
    ActuatorCommand,
    BodyCommand,
    Command,
    CommandType,
    MarkPhase,
    ParentCommand,
    PlaceCommand,
    PluginCommand,
    Release,
    Reset,
    WatchContacts,
    object_counts,
)
from ligature.model.frames import inverse, pose7_matrix
from ligature.model.handles import BodyHandle, Handles, JointHandle
from ligature.model.messages import Message, handle
from ligature.model.scene import Actuator, Body, Camera, Light, Scene
from ligature.model.state import FieldViews, StateRecord, new_state
from ligature.model.subsystem import Subsystem, copied
from ligature.physics import Controllers, World, failed, failure
from ligature.physics.guard import Guard
from ligature.physics.volumes import Volumes
from ligature.plugins import AfterStep, Host, Plugins
from ligature.robots.commands import ArmCommand
from ligature.sensing.actuators import Actuators
from ligature.sensing.contacts import Contacts
from ligature.sensing.ghosts import Ghosts
from ligature.sensing.mounts import Mounts
from ligature.sensing.rays import Rays
from ligature.sensing.targets import Targets
from ligature.sensing.touches import Touches
from ligature.soft import BeforeRods, Tissues
from ligature.suture import Insertion, RodQueries, Suture
from ligature.suture.searching import SOLVED

Array = NDArray[np.float64]

PHASES = ("control", "suture", "bodies", "sensing", "state")
"""What the time of a tick is spent on, in order."""


REST = 1000
"""Ticks for which a subsystem that failed is left out, and for which another failure of its kind is not reported."""

GUARD_TICKS = 10
"""Fewest ticks between two checks for bodies that are too fast: one takes 5 µs."""


class Stopwatch:
    """Adds up the time of what is done within it; time never flows into the simulation."""

    def __init__(self) -> None:
        self.seconds = 0.0
        self._start = 0.0

    def __enter__(self) -> None:
        self._start = clock.perf_counter()

    def __exit__(self, *exception: object) -> None:
        self.seconds += clock.perf_counter() - self._start


@dataclass(frozen=True, eq=False)
class Snapshot:
    """All that is needed to continue bit for bit, in any process: opaque, made by `Simulation.snapshot`."""

    parts: Mapping[str, Any]
    state: StateRecord
    scene: str
    """Digest of the objects of the scene; see `_digest_of`."""


MOST_UNHELD = 8
"""Number of unreferenced simulations that may wait to be freed."""

_simulations: weakref.WeakSet[Simulation] = weakref.WeakSet()
"""All simulations in memory."""

_crowd = MOST_UNHELD
"""Number of `_simulations` at which unreferenced ones are freed."""


Simulated = TypeVar("Simulated", bound="Simulation")


def _free_unheld() -> None:
    """Free unreferenced simulations once there are many.

    Each is a reference cycle of 30 to 100 MB, and Python's collector counts objects, not bytes.
    """
    global _crowd
    if len(_simulations) >= _crowd:
        gc.collect()
        _crowd = len(_simulations) + MOST_UNHELD


class Simulation:
    """A running scene.

    Parameters
    ----------
    scene
        What to simulate, from `ligature.load`.
    dt
        Length of a tick in seconds.
    update
        Length of an update in seconds, a whole number of ticks: how often commands of servers are
        taken and states are written for them.
    allow_plugins
        Whether the plug-ins that the scene's files name are run: their code has the rights of this process.

    Raises
    ------
    ValueError
        For a length that is not above 0 and finite.
    """

    def __init__(
        self, scene: Scene, dt: float = 1e-3, update: float | None = None, allow_plugins: bool = False
    ) -> None:
        if not isinstance(scene, Scene):
            raise TypeError(
                f"a simulation takes a scene, not {scene!r}; ligature.load(…) makes one of a file or a name"
            )
        if scene.plugins and not allow_plugins:
            scene = replace(scene, plugins=())
        for name, value in (("dt", dt), ("update", update)):
            if value is not None and not (isinstance(value, Real) and 0.0 < value < math.inf):
                raise ValueError(f"{name} is {value}; it must be a number of seconds above 0")
        _free_unheld()
        _simulations.add(self)
        self.scene = scene
        self.dt = dt
        self.ticks_per_update = max(1, round((update or dt) / dt))
        self.state: StateRecord = new_state(scene)
        self.phases = {name: Stopwatch() for name in PHASES}
        self.problems: list[Diagnostic] = []
        self._counts = object_counts(scene)
        self._scene_digest = _digest_of(scene, self.state, dt)
        self._closed = False
        self._clock = Clock()
        self._watched = 0
        self._world = World(scene, dt)
        queries = self._world.queries
        self._suture = Suture(scene, self._world, dt)
        self._mounts = Mounts(scene)
        targets = Targets(self._world, queries, self._suture.rods, RodQueries(self._suture.rods, self._world))
        self._rays = Rays(scene, targets)
        self._touches = Touches(queries)
        self.arms = ArmSet(scene, self._world, dt)
        actuator_grasps, rods = ActuatorGrasps(scene, self._world), self._suture.rods
        self._actuators = Actuators(scene, ActuatorAttachments(scene, self._world, rods, actuator_grasps), self._rays)
        self.grasps = Grasps(scene, self._world, rods, actuator_grasps, lambda: self._actuators.held)
        self.tissues = Tissues(scene, self._world, rods, dt)
        before, after = ((BeforeRods(self.tissues),), (self.tissues,)) if scene.tissues else ((), ())
        volumes = Volumes(scene, self._world)
        host = Host(scene, dt, targets, self._world.joints.state, lambda: self._clock.tick, self.apply, volumes.of_body)
        self._plugins = Plugins(host)
        before_all, after_all = ((self._plugins,), (AfterStep(self._plugins),)) if scene.plugins else ((), ())
        self._tick: dict[str, tuple[Subsystem, ...]] = {
            "control": (*before_all, self.arms, self._actuators, self._rays, Controllers(self._world)),
            "suture": (*before, self._suture, *after, self.grasps),
            "bodies": (self._world, *((volumes,) if scene.volumes else ())),
            "sensing": (self._touches, self._mounts, Ghosts(scene, queries), Contacts(scene, targets), *after_all),
        }
        """What a tick does, phase by phase: all subsystems in the order of their steps."""
        self._subsystems = [subsystem for phase in self._tick.values() for subsystem in phase]
        self._writers, self._senses, self._reporters = (
            [s for s in self._subsystems if getattr(type(s), name) is not getattr(Subsystem, name)]
            for name in ("write_state", "sense", "take_problems")
        )
        self._times = FieldViews("tick", "update", "resets", "sim_time")
        self._resting: dict[int, int] = {}
        """Subsystems that are skipped, by their number, and the tick at which each continues."""
        self._reported: dict[tuple[str, str], int] = {}
        self._phases = [
            (self.phases[phase], [s for s in subsystems if type(s).step is not Subsystem.step])
            for phase, subsystems in self._tick.items()
        ]
        self._coasting = Coasting(self._world, self._suture)
        (control, controlling), (suture, coupled), *left = self._phases
        leaders, controllers = _parted(controlling, Controllers)
        followers, threads = _parted(coupled, Suture)
        self._leading = [(control, leaders)]
        self._unsolved = [(suture, followers), *left]
        self._following = [(suture, coupled), *left]
        self._controlled = [(control, controllers), *self._following]
        """What is left of a tick after leaders, and controllers, and threads have stepped."""
        self._begins = coupled[: len(threads)] == threads
        """Whether threads step next after controllers."""
        self._before_bodies = _never_idle_first(leaders)
        self._after_bodies = _never_idle_first(_parted([s for _, group in self._unsolved for s in group], World)[0])
        self.bodies = Handles("body", scene.bodies, [BodyHandle(self, b) for b in scene.bodies])
        self.joints = Handles("joint", scene.joints, [JointHandle(self, j) for j in scene.joints])
        self._handlers: dict[type[Message], Callable[[Any], None]] = {
            BodyCommand: self._world.set_command,
            ActuatorCommand: self._actuate,
            PlaceCommand: lambda c: self._mounts.place(c.kind, c.index, c.pose),
            ParentCommand: lambda c: self._mounts.adopt(c.kind, c.index, c.parent),
            ArmCommand: self.arms.apply,
            PluginCommand: self._plugins.receive,
            WatchContacts: lambda c: self._touches.watch(c.enabled),
            MarkPhase: lambda _: None,  # only for recordings of the commands
            Release: self._release,
            Reset: lambda c: self.reset(bodies_only=c.bodies_only),
        }
        self._guard = Guard(scene, self._world, self.state)
        self._plugins.load()
        self._write_state()
        self._watch_anew()

    # --- time -------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated seconds since the start; a reset does not set it back."""
        return self._clock.tick * self.dt

    def step(self, ticks: int = 1) -> None:
        """Advance by ``ticks`` ticks and write the state. The number of ticks per call does not affect the result.

        Raises ValueError for a negative number of ticks, TypeError if it is not a whole number.
        """
        self._check_open()
        ticks = _whole(ticks)
        if ticks < 0:
            raise ValueError(f"ticks is {ticks}; it must be 0 or more")
        while ticks > 0:
            ticks -= self._advance(ticks)
        self._write_state()
        self._watch()

    def _advance(self, ticks: int) -> int:
        """Advance by a tick, or by up to ``ticks`` in which only bodies and threads have work; returns how many.

        In a tick commands become motor targets and forces, threads and grasps exchange impulses, bodies move.
        """
        tick, coasting = self._clock.since_reset, self._coasting
        begins = not self._resting and coasting.begins
        free = _idle_ticks(self._after_bodies, tick, ticks) if begins and coasting.coasts else 0
        idle = _idle_ticks(self._before_bodies, tick, min(free + 1, ticks)) if begins and ticks > 1 else 0
        if not idle:
            self._step_phases(self._leading)
            free = min(free, _idle_ticks(self._after_bodies, tick, 1))  # what has stepped may drive a jaw
        most = min(free, idle or 1)
        begins = begins and self._begins and most < (idle or 1)
        passed, begun = self._coast(most, begins) if most or begins else (0, 0)
        if passed:
            for subsystem in (*self._after_bodies, *(self._before_bodies if idle else ())):
                subsystem.pass_idle(passed)
            self._clock.advance(passed)
            if not begun:
                return passed
        if idle:
            self._step_phases(self._leading)
        self._step_phases(self._unsolved if begun == SOLVED else self._following if begun else self._controlled)
        self._clock.advance()
        return passed + 1

    def _step_phases(self, phases: Sequence[tuple[Stopwatch, Sequence[Subsystem]]]) -> None:
        """Step the subsystems of ``phases`` of a tick."""
        tick, now = self._clock.since_reset, clock.perf_counter()
        for stopwatch, subsystems in phases:
            for subsystem in subsystems:
                if self._resting and self._rests(subsystem):
                    continue
                try:
                    subsystem.step(tick)
                except Exception as error:  # nothing ends a run but its user
                    self._leave_out(subsystem, error)
            begin, now = now, clock.perf_counter()
            stopwatch.seconds += now - begin

    def _coast(self, ticks: int, begins: bool) -> tuple[int, int]:
        """Advance by up to ``ticks`` in which only bodies and threads have work, in one call; returns how many.

        Returns also how far another one has begun; see `Coasting.pass_ticks`.
        """
        try:
            passed, begun = self._coasting.pass_ticks(ticks, begins)
        except Exception as error:  # nothing ends a run but its user
            self._leave_out(self._world, error)
            passed, begun = 1, 0
        for phase, seconds in zip(COASTED, self._coasting.spent.tolist(), strict=True):
            self.phases[phase].seconds += seconds
        return passed, begun

    def _leave_out(self, subsystem: Subsystem, error: Exception) -> None:
        """Reset and skip, for a while, a subsystem whose step raised; then it continues without commands."""
        self._report(subsystem, "step", f"it is reset to its start and skipped for {REST * self.dt:g} s", error)
        self._guarded(subsystem, "recover")
        self._resting[self._subsystems.index(subsystem)] = self._clock.tick + REST

    def _rests(self, subsystem: Subsystem) -> bool:
        """Whether a subsystem is skipped in this tick; recovers it in the tick in which it continues."""
        number = self._subsystems.index(subsystem)
        if self._resting.get(number, 0) > self._clock.tick:
            return True
        if self._resting.pop(number, None) is not None:  # Bullet adds up what pushes bodies meanwhile
            self._guarded(subsystem, "recover")
        return False

    def _guarded(self, subsystem: Subsystem, name: str) -> None:
        """Call a method other than `step` of a subsystem; an exception is reported, and the others continue."""
        try:
            getattr(subsystem, name)()
        except Exception as error:
            self._report(subsystem, name, "the simulation continues without it", error)

    def _report(self, part: Subsystem | Guard, name: str, outcome: str, error: Exception) -> None:
        """Report a failure, unless the same method of the same part failed a moment ago."""
        what, now = (type(part).__name__, name), self._clock.tick
        if now >= self._reported.get(what, 0):
            self._reported[what] = now + REST
            self.problems.append(failed(f"'{name}' of {what[0]} failed; {outcome}", error))

    def _watch(self) -> None:
        """Report bodies whose motion no command explains."""
        passed = self._clock.tick - self._watched
        if passed >= GUARD_TICKS:
            self._watched = self._clock.tick
            try:
                alarm = self._guard.check(passed * self.dt)
            except Exception as error:
                self._report(self._guard, "check", "the simulation continues without it", error)
            else:
                self.problems += [alarm] if alarm is not None else []

    def _watch_anew(self) -> None:
        """Restart the watch of motions after bodies were placed."""
        self._watched = self._clock.tick
        self._guard.reset()

    def _write_state(self) -> None:
        """Fill the state record: the state, then the sensors' readings of it. This changes no state."""
        with self.phases["state"]:
            self._fill("write_state", self._writers)
            for subsystem in self._reporters:
                self.problems += subsystem.take_problems()
            self._clock.write(self._times.of(self.state), self.dt, self.ticks_per_update)
        with self.phases["sensing"]:
            self._fill("sense", self._senses)

    def _fill(self, name: str, subsystems: Sequence[Subsystem]) -> None:
        """Have subsystems write to the record, each by its method ``name``; where one fails the others continue."""
        write = methodcaller(name, self.state)
        for subsystem in subsystems:
            try:  # here and not in `_guarded`: it is done every update
                write(subsystem)
            except Exception as error:
                self._report(subsystem, name, "the simulation continues without it", error)

    @property
    def insertions(self) -> tuple[Insertion, ...]:
        """Needles and threads in tissue holes, as after the last tick; ``scene.holes`` names the holes."""
        return self._suture.holes.insertions

    def touched(self, body: int) -> frozenset[int]:
        """Rigid bodies that ``body`` touches, as after the last tick."""
        return frozenset(contact.body for contact in self._world.queries.contacts(body, 0.0))

    # --- commands ---------------------------------------------------------------------------

    def apply(self, command: Command) -> None:
        """Take a command; it acts from the next tick on.

        Raises ValueError, and changes nothing, for invalid values, and for an object that the scene does not have.
        What an arm rejects becomes its warning, what goes wrong in it its FAULT. What goes wrong in another object
        clears its command and is among `problems`.
        """
        self._check_open()
        command.check(self._counts)
        try:
            handle(self._handlers, command)
        except Exception as error:  # no command ends a run
            self.problems.append(failure(self._name_of(command), error))
            if isinstance(command, BodyCommand):
                self._world.release(command.body)

    def _name_of(self, command: Command) -> str:
        """The object of a command, for messages."""
        if command.object is None:
            return type(command).__name__
        kind, index = command.object
        items: dict[str, Sequence[Body] | Sequence[Actuator] | Sequence[Camera] | Sequence[Light]] = {
            "body": self.scene.bodies,
            "actuator": self.scene.actuators,
            "camera": self.scene.cameras,
            "light": self.scene.lights,
        }
        return f"{kind} '{items[kind][index].identity.identifier if kind in items else self.scene.arms[index].name}'"

    def _actuate(self, command: ActuatorCommand) -> None:
        problem = self._actuators.apply(command, self.state["body_pose"][0])
        if problem is not None:
            self.problems.append(problem)

    def _release(self, command: Release) -> None:
        if command.kind == "body":
            self._world.release(command.index)
        elif command.kind == "actuator":
            self._actuators.release(command.index)
        elif command.kind == "arm":
            self.arms.release(command.index)

    def set_pose(self, body: int, pose: Array) -> None:
        """Move the root body of a tree to ``pose`` (7,), at rest, together with a thread that is attached to it alone.

        Raises ValueError for a body that a joint holds, such as a link of an arm, and for an element of a thread.
        """
        self._check_open()
        BodyCommand(body, CommandType.POSITION, tuple(pose)).check(self._counts)
        self._world.check_root(body)
        before = pose7_matrix(self._world.pose7(body))
        self.grasps.release_body(body)
        self._world.set_pose(body, pose)
        self._suture.rods.carry(body, pose7_matrix(pose) @ inverse(before))
        self._suture.holes.forget(body)
        self.tissues.forget(body)
        self._write_state()
        self._watch_anew()

    def reset(self, bodies_only: bool = False) -> None:
        """Reset everything to the start of the scene, to the bit; time continues and commands hold.

        ``bodies_only`` leaves ghosts, cameras and lights where they are.
        """
        self._check_open()
        for subsystem in reversed(self._subsystems):
            if not (bodies_only and subsystem is self._mounts):
                self._guarded(subsystem, "reset")
        self._resting.clear()
        self._clock.restart()
        self._write_state()
        self._watch_anew()

    # --- snapshots --------------------------------------------------------------------------

    def snapshot(self) -> Snapshot:
        """The whole dynamic state: this simulation and a restored one continue with the same bits.

        Bullet keeps contacts in a form that cannot be read. Therefore a snapshot clears them in this simulation too, as
        `restore` does: a run continues with different last bits after a snapshot than without it.
        """
        self._check_open()
        parts = {
            "clock": self._clock,
            "resting": self._resting,
            **{f"{n}": s.snapshot() for n, s in enumerate(self._subsystems)},
        }
        taken = Snapshot(copied(parts), self.state.copy(), self._scene_digest)
        self.restore(taken)
        return taken

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a snapshot of this scene, taken here or elsewhere.

        Raises ValueError, and changes nothing, for a snapshot of a scene with other objects or of another tick, and
        TypeError for anything but a snapshot.
        """
        self._check_open()
        if not isinstance(snapshot, Snapshot):
            raise TypeError(f"a {type(snapshot).__name__} is not a snapshot; restore what 'snapshot' returned")
        if snapshot.scene != self._scene_digest:
            raise ValueError(
                "the snapshot is of another scene or tick length; restore it in a simulation of its scene and dt"
            )
        parts = copied(dict(snapshot.parts))
        self._clock, self._resting = parts["clock"], parts["resting"]
        for n, subsystem in reversed(list(enumerate(self._subsystems))):
            subsystem.restore(parts[f"{n}"])
        self.state[:] = snapshot.state
        self._watch_anew()

    def state_hash(self, clock: bool = True) -> str:
        """SHA-256 of the full state: equal for equal scenes, commands and versions.

        ``clock=False`` leaves out time and the number of resets, to compare with a run that began elsewhere.
        """
        digest = hashlib.sha256()
        left_out = ("wall_time", "stamp", "update", *(() if clock else ("tick", "sim_time", "resets")))
        for name in sorted(self.state.dtype.names or ()):
            if name not in left_out:
                digest.update(np.ascontiguousarray(self.state[name]).tobytes())
        _digest(self._suture.snapshot(), digest.update)
        if self.scene.tissues:
            _digest(self.tissues.snapshot(), digest.update)
        return digest.hexdigest()

    def close(self) -> None:
        """End plug-ins and free the physics engine: what needs it raises RuntimeError afterwards; the state remains."""
        self._closed = True
        self._plugins.close()
        self._world.close()

    def __enter__(self: Simulated) -> Simulated:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    def _check_open(self) -> None:
        """Raise RuntimeError after `close`: compiled code holds addresses of the engine that is gone."""
        if self._closed:
            raise RuntimeError("the simulation is closed; make a new one")

    def __reduce__(self) -> NoReturn:
        """Copies and pickles are rejected, for two would share one engine."""
        raise TypeError(
            "a simulation cannot be copied or pickled; restore its 'snapshot' in another simulation of the scene"
        )


@dataclass
class Clock:
    """Ticks since the start and since the last reset, and how many resets there were."""

    tick: int = 0
    since_reset: int = 0
    resets: int = 0

    def advance(self, ticks: int = 1) -> None:
        """``ticks`` went by."""
        self.tick += ticks
        self.since_reset += ticks

    def restart(self) -> None:
        """The scene was reset."""
        self.since_reset = 0
        self.resets += 1

    def write(self, fields: Sequence[NDArray[Any]], dt: float, ticks_per_update: int) -> None:
        """Write counts and time to the fields tick, update, resets and sim_time of a record, (1,) each."""
        tick, update, resets, sim_time = fields
        tick[0], resets[0], sim_time[0] = self.tick, self.resets, self.tick * dt
        update[0] = self.tick // ticks_per_update


def _parted(subsystems: Sequence[Subsystem], kind: Any) -> tuple[list[Subsystem], list[Subsystem]]:
    """Subsystems that are not of a kind, and those that are."""
    return [s for s in subsystems if not isinstance(s, kind)], [s for s in subsystems if isinstance(s, kind)]


def _never_idle_first(subsystems: Sequence[Subsystem]) -> list[Subsystem]:
    """Subsystems in the order in which to ask them; arms take the longest to answer."""
    return sorted(subsystems, key=lambda s: (type(s).idle_ticks is not Subsystem.idle_ticks, isinstance(s, ArmSet)))


def _idle_ticks(subsystems: Sequence[Subsystem], tick: int, most: int) -> int:
    """For how many ticks from ``tick`` on all ``subsystems`` are idle, at most."""
    for subsystem in subsystems:
        most = min(most, subsystem.idle_ticks(tick))
        if most < 1:
            return 0
    return most


def _whole(ticks: Any) -> int:
    """``ticks`` as an int: a whole number of any type; raises TypeError for anything else."""
    if type(ticks) is int:
        return ticks
    try:
        whole = int(np.asarray(ticks).item() if np.size(ticks) == 1 else ticks)
        if not isinstance(ticks, str) and whole == ticks:
            return whole
    except (TypeError, ValueError, OverflowError):
        pass
    raise TypeError(f"ticks is {ticks!r}; it must be a whole number, as round(seconds / dt) is")


def _digest_of(scene: Scene, state: StateRecord, dt: float) -> str:
    """SHA-256 of what a snapshot stands for: the objects of a scene in their order, how many, and seconds a tick."""
    objects = (scene.bodies, scene.joints, scene.ghosts, scene.sensors, scene.actuators, scene.cameras, scene.lights)
    names = [[item.identity.identifier for item in items] for items in objects]
    arms = [arm.name for arm in scene.arms]
    return hashlib.sha256(repr((names, arms, state.dtype.descr, dt)).encode("utf-8", "surrogatepass")).hexdigest()


def _digest(value: Any, update: Callable[[bytes], object]) -> None:
    """Feed nested dicts, sequences and arrays of a snapshot to a hash."""
    if isinstance(value, Mapping):
        for name in sorted(value):
            _digest(value[name], update)
    elif isinstance(value, list | tuple):
        for item in value:
            _digest(item, update)
    elif is_dataclass(value):
        _digest([getattr(value, field.name) for field in fields(value)], update)
    else:
        array = np.ascontiguousarray(value)
        if array.dtype.hasobject:
            raise TypeError(f"a snapshot contains a {type(value).__name__}, which has no bytes to compare")
        update(array.tobytes())
