"""The simulation in process: the tick, the Python API, snapshots and the state hash.

World axes, SI units; poses are x y z qx qy qz qw. There is no clock, no thread and no ROS here: the
same scene, commands and calls give the same bits.
"""

from __future__ import annotations

import copy
import hashlib
import time as clock
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic
from ligature.arms import ArmSet
from ligature.grasping import Clamps, Grasps, Holder
from ligature.model.commands import (
    ActuatorCommand,
    ArmCommand,
    BodyCommand,
    Command,
    CommandType,
    ParentCommand,
    PlaceCommand,
    Release,
    Reset,
    WatchContacts,
    check,
    check_object,
    object_of,
    objects_of,
)
from ligature.model.frames import inverse, pose7_matrix
from ligature.model.lookup import find_by_text
from ligature.model.scene import Actuator, Body, Camera, Joint, Light, Scene
from ligature.model.state import MAX_TOUCHES, StateRecord, new_state
from ligature.physics import World, failure
from ligature.sensing.actuators import Actuators
from ligature.sensing.attachments import Attachments
from ligature.sensing.contacts import Contacts
from ligature.sensing.ghosts import Ghosts
from ligature.sensing.rays import Rays
from ligature.suture import Holes, Insertion, Rods

Array = NDArray[np.float64]
Handle = TypeVar("Handle")

PHASES = ("control", "suture", "bodies", "sensing", "state")
"""What the time of a tick is spent on, in order."""

LOOK_TICKS = 16
"""Ticks between two looks at contacts that are watched."""


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
    """All that is needed to continue bit for bit: opaque, made by `Simulation.snapshot`."""

    parts: Mapping[str, Any]


class Handles(Mapping[str, Handle], Generic[Handle]):
    """Objects of one kind by topic name, identifier, name, or any part of these that only one of them has."""

    def __init__(
        self, kind: str, items: Sequence[Body] | Sequence[Joint] | Sequence[Camera], handles: Sequence[Handle]
    ) -> None:
        self._kind = kind
        self._names = ([i.identity.topic for i in items], [i.identity.identifier for i in items])
        self._bare_names = [i.identity.name for i in items]
        self._handles = list(handles)

    def __getitem__(self, text: str) -> Handle:
        for names in self._names:
            if text in names:
                return self._handles[names.index(text)]
        if self._bare_names.count(text) == 1:
            return self._handles[self._bare_names.index(text)]
        for names in self._names:
            found = find_by_text(names, text)
            if found is not None:
                return self._handles[found]
        raise KeyError(f"no {self._kind} is called '{text}', or several are; there are {', '.join(self._names[0])}")

    def __iter__(self) -> Iterator[str]:
        return iter(self._names[0])

    def __len__(self) -> int:
        return len(self._handles)


class BodyHandle:
    """One body of a running simulation."""

    def __init__(self, simulation: Simulation, body: Body) -> None:
        self._simulation = simulation
        self.body = body

    @property
    def pose(self) -> Array:
        """Pose (7,) of the body frame in world axes."""
        return np.array(self._simulation.state["body_pose"][0, self.body.index])

    @property
    def twist(self) -> Array:
        """Linear velocity of the centre of mass and angular velocity, (6,), world axes."""
        return np.array(self._simulation.state["body_twist"][0, self.body.index])

    def set_pose(self, pose: Sequence[float]) -> None:
        """Put the body at ``pose`` (7,) at once, at rest; for links of an arm use joint commands."""
        self._simulation.set_pose(self.body.index, np.asarray(pose, dtype=float))

    def command_pose(self, pose: Sequence[float]) -> None:
        """Drive the body to ``pose`` (7,) with its Cartesian controller."""
        self._command(CommandType.POSITION, pose)

    def command_twist(self, twist: Sequence[float]) -> None:
        """Drive the body with ``twist`` (6,)."""
        self._command(CommandType.VELOCITY, twist)

    def command_wrench(self, wrench: Sequence[float]) -> None:
        """Push the body with ``wrench`` (6,) at its centre of mass."""
        self._command(CommandType.FORCE, wrench)

    def command_joints(self, values: Sequence[float], type: CommandType = CommandType.POSITION) -> None:
        """Command the active joints below this body, in the order of ``body.joints``."""
        self._simulation.apply(
            BodyCommand(
                self.body.index,
                CommandType.FORCE,
                (0.0,) * 6,
                (type,) * len(values),
                tuple(map(float, values)),
            )
        )

    def release(self) -> None:
        """Drop whatever was commanded: joints go limp, forces cease."""
        self._simulation.apply(Release("body", self.body.index))

    def _command(self, type: CommandType, target: Sequence[float]) -> None:
        self._simulation.apply(BodyCommand(self.body.index, type, tuple(map(float, target))))


class JointHandle:
    """One joint of a running simulation; radians or metres."""

    def __init__(self, simulation: Simulation, joint: Joint) -> None:
        self._simulation = simulation
        self.joint = joint

    @property
    def position(self) -> float:
        """Joint position."""
        return float(self._simulation.state["joint_position"][0, self.joint.index])

    @property
    def velocity(self) -> float:
        """Joint velocity."""
        return float(self._simulation.state["joint_velocity"][0, self.joint.index])

    @property
    def effort(self) -> float:
        """Reaction along the joint axis, where the joint has feedback enabled."""
        return float(self._simulation.state["joint_effort"][0, self.joint.index])


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
    """

    def __init__(self, scene: Scene, dt: float = 1e-3, update: float | None = None) -> None:
        self.scene = scene
        self.dt = dt
        self.ticks_per_update = max(1, round((update or dt) / dt))
        self.state: StateRecord = new_state(scene)
        self.phases = {name: Stopwatch() for name in PHASES}
        self.problems: list[Diagnostic] = []
        self._objects = objects_of(scene)
        self._tick = 0
        self._resets = 0
        self._watching = False
        self._world = World(scene, dt)
        self._rods = Rods(scene, dt)
        self._holes = Holes(scene, self._rods, self._world, dt)
        self._attachments = Attachments(scene)
        self._ghosts = Ghosts(scene, self._world)
        self._rays = Rays(scene, self._world)
        self._contacts = Contacts(scene, self._world)
        self.arms = ArmSet(scene, self._world)
        self.problems += self.arms.problems
        clamps = Clamps(scene, self._world)
        self._actuators = Actuators(scene, Holder(scene, self._world, self._rods, clamps), self._rays)
        self.grasps = Grasps(scene, self._world, self._rods, clamps, lambda: self._actuators.held)
        self.bodies = Handles("body", scene.bodies, [BodyHandle(self, b) for b in scene.bodies])
        self.joints = Handles("joint", scene.joints, [JointHandle(self, j) for j in scene.joints])
        self._write_state()

    # --- time -------------------------------------------------------------------------------

    @property
    def time(self) -> float:
        """Simulated seconds since the start; a reset does not set it back."""
        return self._tick * self.dt

    def step(self, ticks: int = 1) -> None:
        """Advance by ``ticks`` ticks and write the state."""
        for _ in range(ticks):
            self._advance()
        with self.phases["state"]:
            self._write_bodies()
        with self.phases["sensing"]:
            self._sense()
        with self.phases["state"]:
            self._write_rest()

    def _advance(self) -> None:
        """One tick."""
        with self.phases["control"]:
            self.arms.tick(self.dt)
            self._world.pre_step()
        with self.phases["suture"]:
            self._holes.begin()
            self._rods.step(self._world)
            self._holes.end()
            self.grasps.step(self._tick)
        with self.phases["bodies"]:
            self._world.step()
        self._tick += 1

    def _sense(self) -> None:
        """Ghosts, rays, contact sensors and the poses of what rides on bodies."""
        poses = self.state["body_pose"][0]
        self._attachments.update(poses)
        self._ghosts.update(self._attachments.world[self._attachments.of("ghost")], poses)
        self._rays.update(poses, self._world.apply_force)
        self._contacts.update()

    @property
    def insertions(self) -> tuple[Insertion, ...]:
        """Needles and threads in tissue holes, as after the last tick; ``scene.holes`` names the holes."""
        return self._holes.insertions

    # --- commands ---------------------------------------------------------------------------

    def apply(self, command: Command) -> None:
        """Take a command; it acts from the next tick on.

        Raises ValueError, and changes nothing, for numbers that are not finite or too many, and for an object that the
        scene does not have. What an arm refuses becomes its warning, what goes wrong in it its FAULT. What goes wrong
        in another object clears its command and is among `problems`.
        """
        check(command)
        check_object(command, self._objects)
        try:
            self._carry_out(command)
        except Exception as error:  # no command ends a run
            self.problems.append(failure(self._name_of(command), error))
            if isinstance(command, BodyCommand):
                self._world.release(command.body)

    def _name_of(self, command: Command) -> str:
        """The object that a command is for, in words."""
        item = object_of(command)
        if item is None:
            return type(command).__name__
        kind, index = item
        items: dict[str, Sequence[Body] | Sequence[Actuator] | Sequence[Camera] | Sequence[Light]] = {
            "body": self.scene.bodies,
            "actuator": self.scene.actuators,
            "camera": self.scene.cameras,
            "light": self.scene.lights,
        }
        return f"{kind} '{items[kind][index].identity.identifier if kind in items else self.scene.arms[index].name}'"

    def _carry_out(self, command: Command) -> None:
        if isinstance(command, BodyCommand):
            self._world.set_command(command)
        elif isinstance(command, ActuatorCommand):
            problem = self._actuators.apply(command, self.state["body_pose"][0])
            if problem is not None:
                self.problems.append(problem)
        elif isinstance(command, PlaceCommand):
            self._attachments.place(command.kind, command.index, command.pose)
        elif isinstance(command, WatchContacts):
            self._watching = command.enabled
        elif isinstance(command, ParentCommand):
            self._attachments.adopt(command.kind, command.index, command.parent)
        elif isinstance(command, ArmCommand):
            self.arms.apply(command)
        elif isinstance(command, Release):
            self._release(command)
        elif isinstance(command, Reset):
            self.reset(bodies_only=command.bodies_only)

    def _release(self, command: Release) -> None:
        if command.kind == "body":
            self._world.release(command.index)
        elif command.kind == "actuator":
            self._actuators.release(command.index)
        elif command.kind == "arm":
            self.arms.release(command.index)

    def set_pose(self, body: int, pose: Array) -> None:
        """Put the root body of a tree at ``pose`` (7,) at rest, and a thread that hangs on it alone along with it.

        Raises ValueError for a link of an arm.
        """
        check(BodyCommand(body, CommandType.POSITION, tuple(pose)))
        before = pose7_matrix(self._world.pose7(body))
        self.grasps.let_go_of(body)
        self._world.set_pose(body, pose)
        self._rods.carry(body, pose7_matrix(pose) @ inverse(before))
        self._holes.forget(body)
        self._write_state()

    def reset(self, bodies_only: bool = False) -> None:
        """Put everything back to where the scene starts; time goes on and commands hold."""
        self.grasps.let_go_of()
        self._world.reset()
        self._rods.reset()
        self._holes.reset()
        self.arms.reset()
        if not bodies_only:
            self._attachments.reset()
        self._resets += 1
        self._write_state()

    # --- snapshots --------------------------------------------------------------------------

    def snapshot(self) -> Snapshot:
        """The whole dynamic state; this simulation and a restored one continue with the same bits."""
        parts: dict[str, Any] = {
            "tick": self._tick,
            "resets": self._resets,
            "world": self._world.snapshot(),
            "rods": self._rods.memory(),
            "holes": self._holes.memory(),
            "attachments": self._attachments.memory(),
            "arms": self.arms.memory(),
            "actuators": self._actuators.memory(),
            "grasps": self.grasps.memory(),
        }
        self._holes.restart()
        self._ghosts.forget()
        self.grasps.recall(parts["grasps"])
        self._write_state()
        return Snapshot(copy.deepcopy(parts))

    def restore(self, snapshot: Snapshot) -> None:
        """Continue from a snapshot of this scene."""
        parts = copy.deepcopy(dict(snapshot.parts))
        self._tick, self._resets = parts["tick"], parts["resets"]
        self._world.restore(parts["world"])
        self._rods.recall(parts["rods"])
        self._holes.recall(parts["holes"])
        self._attachments.recall(parts["attachments"])
        self.arms.recall(parts["arms"])
        self._ghosts.forget()
        self._actuators.recall(parts["actuators"])
        self.grasps.recall(parts["grasps"])
        self._write_state()

    def state_hash(self) -> str:
        """SHA-256 of the full state: equal for equal scenes, commands and versions."""
        digest = hashlib.sha256()
        for name in sorted(self.state.dtype.names or ()):
            if name not in ("wall_time", "stamp"):
                digest.update(np.ascontiguousarray(self.state[name]).tobytes())
        for kept in (*self._rods.memory(), self._holes.memory()):
            for name in sorted(kept):
                digest.update(np.ascontiguousarray(kept[name]).tobytes())
        return digest.hexdigest()

    def close(self) -> None:
        """Give the physics engine back."""
        self._world.close()

    # --- state ------------------------------------------------------------------------------

    def _write_bodies(self) -> None:
        self.problems += self._world.heal() + self._rods.heal()
        self._world.write_state(self.state)
        self._rods.write_state(self.state)
        self._holes.write_state(self.state)

    def _write_state(self) -> None:
        """Fill the state record anew, after something was put elsewhere."""
        self._write_bodies()
        self._attachments.update(self.state["body_pose"][0])
        self._write_rest()

    def _write_touches(self) -> None:
        """Contact points and forces for whoever looks at them, as often as eyes can see."""
        if self._watching and self._tick % LOOK_TICKS < self.ticks_per_update:
            points, forces = self._world.touches(MAX_TOUCHES)
            count = self.state["touch_count"][0] = len(points)
            self.state["touch_point"][0, :count], self.state["touch_force"][0, :count] = points, forces
        elif not self._watching:
            self.state["touch_count"] = 0

    def _write_rest(self) -> None:
        """Fill everything of the state record but the bodies."""
        state, attachments = self.state, self._attachments
        state["tick"] = self._tick
        state["update"] = self._tick // self.ticks_per_update
        state["resets"] = self._resets
        state["sim_time"] = self.time
        state["ghost_world"][0] = attachments.world[attachments.of("ghost")]
        state["ghost_sensed"][0] = self._ghosts.sensed
        for kind in ("camera", "light"):
            state[f"{kind}_pose"][0] = attachments.local[attachments.of(kind)]
            state[f"{kind}_world"][0] = attachments.world[attachments.of(kind)]
        hits = self._rays.hits
        state["ray_measurement"][0] = self._rays.measurement
        state["ray_body"][0], state["ray_point"][0], state["ray_normal"][0] = (
            hits.body,
            hits.point,
            hits.normal,
        )
        self._contacts.write(state)
        self._write_touches()
        self.grasps.write_state(state)
        self.arms.write(state["arm"][0])
        held = np.array(self._actuators.held, dtype=np.int32)
        state["actuator_body"][0], state["actuator_active"][0] = held, held >= 0
