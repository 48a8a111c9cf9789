"""The Python API of a running scene.

World axes, SI units; poses are x y z qx qy qz qw. There is no wall clock, no thread and no ROS here:
the same scene, commands and calls give the same bits.
"""

from __future__ import annotations

import math
import operator
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from numbers import Real
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic
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
from ligature.model.frames import inverse, matrix_pose7, pose7_matrix
from ligature.model.handles import BodyHandle, Handles, JointHandle, pose_numbers
from ligature.model.messages import Message, handle
from ligature.model.scene import Actuator, Body, Camera, Light, Scene
from ligature.model.state import FieldViews, StateRecord, new_state
from ligature.model.subsystem import copied
from ligature.physics import failure
from ligature.physics.guard import Guard
from ligature.robots.commands import ArmCommand
from ligature.simulation.clock import Clock
from ligature.simulation.digests import scene_digest, state_digest
from ligature.simulation.parts import Parts
from ligature.simulation.subsystems import Subsystems
from ligature.simulation.ticking import Ticking
from ligature.simulation.unreferenced import count_in
from ligature.suture import Insertion

Array = NDArray[np.float64]

GUARD_TICKS = 10
"""Fewest ticks between two checks for bodies that are too fast: one takes 5 µs."""

Simulated = TypeVar("Simulated", bound="Simulation")


@dataclass(frozen=True, eq=False)
class Snapshot:
    """All that is needed to continue bit for bit, in any process: opaque, made by `Simulation.snapshot`."""

    parts: Mapping[str, Any]
    state: StateRecord
    scene: str
    """Digest of the objects of the scene; see `scene_digest`."""


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
    TypeError
        For anything but a scene.
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
            if (name == "dt" or value is not None) and not (isinstance(value, Real) and 0.0 < value < math.inf):
                raise ValueError(f"{name} is {value!r}; it must be a number of seconds above 0")
        # compiled code would be compiled again for a whole number or one of single precision, for minutes
        dt, update = float(dt), None if update is None else float(update)
        count_in(self)
        self._scene = scene
        self._dt = dt
        self._ticks_per_update = max(1, round((update or dt) / dt))
        self.state: StateRecord = new_state(scene)
        self._closed = False
        self._clock = Clock()
        self._times = FieldViews("tick", "update", "resets", "sim_time")
        self._parts = Parts(scene, dt, self._clock, self.apply)
        self._world, self._suture = self._parts.world, self._parts.suture
        self.arms, self.grasps, self.tissues = self._parts.arms, self._parts.grasps, self._parts.tissues
        subsystems = [subsystem for phase in self._parts.phases.values() for subsystem in phase]
        self._subsystems = Subsystems(subsystems, self._clock, dt)
        self._ticking = Ticking(self._parts, self._subsystems, self._clock)
        self.phases = self._ticking.phases
        self.bodies = Handles("body", scene.bodies, [BodyHandle(self, b) for b in scene.bodies])
        self.joints = Handles("joint", scene.joints, [JointHandle(self, j) for j in scene.joints])
        self._counts = object_counts(scene)
        self._handlers = self._handlers_of_commands()
        self._scene_digest = scene_digest(scene, self.state, dt)
        self._guard, self._watched = Guard(scene, self._world, self.state), 0
        self._parts.plugins.load()
        self._write_state()
        self._watch_anew()

    @property
    def scene(self) -> Scene:
        """What is simulated."""
        return self._scene

    # --- time -------------------------------------------------------------------------------

    @property
    def dt(self) -> float:
        """Length of a tick in seconds."""
        return self._dt

    @property
    def ticks_per_update(self) -> int:
        """Ticks of an update."""
        return self._ticks_per_update

    @property
    def time(self) -> float:
        """Simulated seconds since the start; a reset does not set it back."""
        return self._clock.tick * self.dt

    @property
    def problems(self) -> list[Diagnostic]:
        """What went wrong, the newest last; whoever has read it clears it."""
        return self._subsystems.problems

    def step(self, ticks: int = 1) -> None:
        """Advance by ``ticks`` ticks and write the state. The number of ticks per call does not affect the result.

        Raises ValueError for a negative number of ticks, TypeError if it is not a whole number.
        """
        self._check_open()
        ticks = _whole(ticks)
        if ticks < 0:
            raise ValueError(f"ticks is {ticks}; it must be 0 or more")
        while ticks > 0:
            ticks -= self._ticking.advance(ticks)
        self._write_state()
        self._watch()

    def _watch(self) -> None:
        """Report bodies whose motion no command explains."""
        passed = self._clock.tick - self._watched
        if passed >= GUARD_TICKS:
            self._watched = self._clock.tick
            for body in self._parts.plugins.take_pushed():
                self._guard.note(body, "a plug-in")
            try:
                alarm = self._guard.check(passed * self.dt)
            except Exception as error:
                self._subsystems.report(self._guard, "check", "the simulation continues without it", error)
            else:
                self.problems.extend([alarm] if alarm is not None else [])

    def _watch_anew(self) -> None:
        """Restart the watch of motions after bodies were placed."""
        self._watched = self._clock.tick
        self._guard.reset()

    def _write_state(self) -> None:
        """Fill the state record: the state, then the sensors' readings of it. This changes no state."""
        with self.phases["state"]:
            self._subsystems.write_state(self.state)
            self._clock.write(self._times.of(self.state), self.dt, self.ticks_per_update)
        with self.phases["sensing"]:
            self._subsystems.sense(self.state)

    @property
    def insertions(self) -> tuple[Insertion, ...]:
        """Needles and threads in tissue holes, as after the last tick; ``scene.holes`` names the holes."""
        return self._suture.holes.insertions

    def touched(self, body: int) -> frozenset[int]:
        """Rigid bodies that ``body`` touches, as after the last tick.

        Raises ValueError for a number that no body has, TypeError for anything but a number.
        """
        self._check_open()
        body = self._index_of(body)
        return frozenset(contact.body for contact in self._world.queries.contacts(body, 0.0))

    def _index_of(self, body: Any) -> int:
        """``body`` as the index of a body; raises TypeError or ValueError where it is none."""
        try:
            index = operator.index(body)
        except TypeError:
            raise TypeError(f"body is {body!r}; it must be an index, as bodies['NAME'].body.index is") from None
        if not 0 <= index < len(self.scene.bodies):
            raise ValueError(f"the scene has no body number {index}, only 0 to {len(self.scene.bodies) - 1}")
        return index

    # --- commands ---------------------------------------------------------------------------

    def apply(self, command: Command) -> None:
        """Take a command; it acts from the next tick on.

        Raises ValueError, and changes nothing, for invalid values, and for an object that the scene does not have;
        TypeError for anything but a command.
        What an arm rejects becomes its warning, what goes wrong in it its FAULT. What goes wrong in another object
        clears its command and is among `problems`.
        """
        self._check_open()
        if not isinstance(command, Command):
            where = "ligature.model.commands and ligature.robots.commands"
            raise TypeError(f"a simulation takes the commands of {where}, not {command!r}")
        command.check(self._counts)
        try:
            handle(self._handlers, command)
        except Exception as error:  # no command ends a run
            self.problems.append(failure(self._name_of(command), error))
            if isinstance(command, BodyCommand):
                self._world.release(command.body)
        else:
            if isinstance(command, BodyCommand):
                self._guard.note(command.body)

    def _handlers_of_commands(self) -> dict[type[Message], Callable[[Any], None]]:
        """What takes the commands of each class."""
        parts = self._parts
        return {
            BodyCommand: parts.world.set_command,
            ActuatorCommand: self._actuate,
            PlaceCommand: lambda c: parts.mounts.place(c.kind, c.index, c.pose),
            ParentCommand: lambda c: parts.mounts.adopt(c.kind, c.index, c.parent),
            ArmCommand: parts.arms.apply,
            PluginCommand: parts.plugins.receive,
            WatchContacts: lambda c: parts.touches.watch(c.enabled),
            MarkPhase: lambda _: None,  # only for recordings of the commands
            Release: self._release,
            Reset: lambda c: self.reset(bodies_only=c.bodies_only),
        }

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
        problem = self._parts.actuators.apply(command, self.state["body_pose"][0])
        if problem is not None:
            self.problems.append(problem)

    def _release(self, command: Release) -> None:
        if command.kind == "body":
            self._world.release(command.index)
        elif command.kind == "actuator":
            self._parts.actuators.release(command.index)
        elif command.kind == "arm":
            self.arms.release(command.index)

    def set_pose(self, body: int, pose: Array) -> None:
        """Move a ``body`` to ``pose``, at rest, together with a thread that is attached to it alone.

        What joints hold to it moves along, and the joints stay where they are. Of bodies that joints hold to one that
        stands, only that one can be moved.

        Parameters
        ----------
        body
            Index of the body in the scene.
        pose
            (7,) position (m) and quaternion x, y, z, w in the world, or a matrix (4, 4).

        Raises
        ------
        ValueError
            For a number that no body has, for a body that joints hold to one that stands, as a link of an arm, and
            for an element of a thread.
        TypeError
            For a body that is no number, as a name, and for a pose of anything but numbers.
        """
        self._check_open()
        body, numbers = self._index_of(body), pose_numbers("set_pose", pose)
        BodyCommand(body, CommandType.POSITION, numbers).check(self._counts)
        pose = np.array(numbers)
        moved = self._world.moving_with(body)
        root = moved[0]
        T = pose7_matrix(pose) @ inverse(pose7_matrix(self._world.pose7(body)))
        for other in moved:
            self.grasps.release_body(other)
        self._world.set_pose(root, pose if root == body else matrix_pose7(T @ pose7_matrix(self._world.pose7(root))))
        for other in moved:
            self._suture.rods.carry(other, T)
            self._suture.holes.forget(other)
            self.tissues.forget(other)
        self._write_state()
        self._watch_anew()

    def reset(self, bodies_only: bool = False) -> None:
        """Reset everything to the start of the scene, to the bit; time continues and commands hold.

        ``bodies_only`` leaves ghosts, cameras and lights where they are.
        """
        self._check_open()
        self._subsystems.reset(but=self._parts.mounts if bodies_only else None)
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
        parts = {"clock": self._clock, **self._subsystems.snapshot()}
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
        self._clock.set(parts["clock"])
        self._subsystems.restore(parts)
        self.state[:] = snapshot.state
        self._watch_anew()

    def state_hash(self, clock: bool = True) -> str:
        """SHA-256 of the full state: equal for equal scenes, commands and versions.

        ``clock=False`` leaves out time and the number of resets, to compare with a run that began elsewhere.
        """
        left_out = ("wall_time", "stamp", "update", *(() if clock else ("tick", "sim_time", "resets")))
        tissues = [self.tissues.snapshot()] if self.scene.tissues else []
        return state_digest(self.state, left_out, [self._suture.snapshot(), *tissues])

    def close(self) -> None:
        """End plug-ins and free the physics engine: what needs it raises RuntimeError afterwards; the state remains."""
        self._closed = True
        self._parts.plugins.close()
        self.arms.end()
        self._world.close()

    def __enter__(self: Simulated) -> Simulated:
        return self

    def __exit__(self, *error: object) -> None:
        self.close()

    @property
    def closed(self) -> bool:
        """Whether `close` has been called."""
        return self._closed

    def _check_open(self) -> None:
        """Raise RuntimeError after `close`: compiled code holds addresses of the engine that is gone."""
        if self._closed:
            raise RuntimeError("the simulation is closed; make a new one")

    def __reduce__(self) -> NoReturn:
        """Copies and pickles are rejected, for two would share one engine."""
        raise TypeError(
            "a simulation cannot be copied or pickled; restore its 'snapshot' in another simulation of the scene"
        )


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
