"""The rigid bodies of a scene on Bullet, advanced one tick at a time.

Frames and units as in `ligature.model.scene`; poses are x y z qx qy qz qw of the body frame B in
world axes, twists are linear at the centre of mass, then angular, in world axes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.model.commands import BodyCommand
from ligature.model.scene import Body, Scene
from ligature.model.state import StateRecord
from ligature.model.subsystem import Subsystem, copied
from ligature.physics.body_commands import BodyCommands
from ligature.physics.chunks import MOST_REPLACED, Chunks
from ligature.physics.closures import Closures
from ligature.physics.collisions import Collisions
from ligature.physics.contact_wrenches import ContactWrenches
from ligature.physics.damping import Damping
from ligature.physics.divergence import MAX_SPEED, diverged, joined
from ligature.physics.drive import Drive
from ligature.physics.engine import Engine
from ligature.physics.gravity import gravity_lifts
from ligature.physics.impulses import Impulses
from ligature.physics.joints import Joints
from ligature.physics.masses import Masses
from ligature.physics.mobility import mobility
from ligature.physics.parting import Parting
from ligature.physics.preparing import prepare
from ligature.physics.queries import BulletQueries
from ligature.physics.readout import Readout
from ligature.physics.trees import read_bodies
from ligature.physics.welds import Welds

Array = NDArray[np.float64]

MOST_CHARACTERS = 300
"""Most characters of an exception in a finding."""


def failure(what: str, error: Exception) -> Diagnostic:
    """The finding that ``what`` failed with the exception ``error``, and that its command is cleared therefore."""
    return failed(f"{what} failed, and its command is cleared", error)


def failed(what: str, error: Exception) -> Diagnostic:
    """The finding that the exception ``error`` was raised; ``what`` names where."""
    text = f"{what}: {type(error).__name__}: {str(error)[:MOST_CHARACTERS]}"
    return Diagnostic(Severity.ERROR, text, code="failed")


class Controllers(Subsystem):
    """Controllers, springs, gravity and damping of a `World`: they act before rods and grasps feel how bodies move.

    All that they keep belongs to the world, which has it in its snapshots.
    """

    def __init__(self, world: World) -> None:
        self._world = world

    def step(self, tick: int) -> None:
        """Act on joints and bodies for the coming step of the world."""
        self._world.pre_step()

    def reset(self) -> None:
        """Nothing: it is part of the world."""

    def recover(self) -> None:
        """Clear the commands of all bodies and joints."""
        self._world.clear_commands()

    def snapshot(self) -> None:
        """Nothing: it is part of the world."""

    def restore(self, snapshot: None) -> None:
        """Nothing: it is part of the world."""


class World(Subsystem):
    """All rigid bodies of a scene outside rods; one Bullet client of its own.

    Parameters
    ----------
    scene
        The description of bodies and joints.
    dt
        Length of a tick in seconds.

    Attributes
    ----------
    engine
        Bullet, where the bodies are, how they move.
    joints
        Controllers of joints.
    commands
        Cartesian commands of bodies; taken by `set_command` and `release`.
    impulses
        What rods, tissue and grasps do to bodies in the coming tick.
    masses
        How heavy bodies are while something holds or drives them.
    welds
        Rigid constraints between bodies.
    collisions
        Which pairs of bodies collide.
    queries
        Contacts, overlaps, gaps, rays.
    wrenches
        What the rest of the world exerts on bodies.
    chunks
        What of volumes that may change collides.
    always
        What `prepare` takes, but the length of a tick.
    """

    def __init__(self, scene: Scene, dt: float = 1e-3) -> None:
        self.scene = scene
        self.dt = dt
        self.problems: list[Diagnostic] = []
        self._owned_reported: set[int] = set()
        self.engine = Engine(scene, dt)
        self.chunks = Chunks(self.engine)
        self.joints = Joints(self.engine)
        self.commands = BodyCommands(self.engine)
        self.impulses = Impulses(self.engine, self.commands)
        self.welds = Welds(self.engine)
        self.masses = Masses(self.engine, self.commands, self.welds)
        self.collisions = Collisions(self.engine)
        for found in self.collisions.overlaps:
            self.report(found.finding(scene))
        self.queries = BulletQueries(self.engine, self.collisions)
        self.wrenches = ContactWrenches(self.engine, self.welds, self.impulses)
        self._set_up()
        self.engine.forget_contacts()

    def _set_up(self) -> None:
        """Create the parts that act on bodies within a tick, for the engine's present client."""
        engine = self.engine
        self._broken = False
        self._lifts = gravity_lifts(engine, self.joints.controls)
        self._damping = Damping(engine)
        self._closures = Closures(engine)
        self._readout = Readout(engine.client, self.scene, engine.trees, engine.motions, engine.place_of)
        self._parting = Parting(engine)
        motions, damping, lifts = engine.motions, self._damping, self._lifts
        self.always = (
            motions.handle, motions.table, self.joints.table, engine.place_table, damping.trees, damping.factors,
            lifts.bodies, lifts.forces,
        )  # fmt: skip

    def _begin(self) -> None:
        """Prepare a restart; with a new Bullet client if this one keeps state that cannot be cleared, or failed.

        Bodies are then put where they begin, and at last contacts are forgotten.
        """
        if self.engine.forgets and not self._broken and self.chunks.replaced < MOST_REPLACED:
            self.welds.loosen()
            self._closures.begin()
            self._parting.begin()
            return
        self.engine.rebuild()
        self.chunks.rebuild()
        self.joints.rebuild()
        self.collisions.rebuild()
        self._set_up()
        self.queries.rebuild()
        self.wrenches.rebuild()

    def report(self, diagnostic: Diagnostic) -> None:
        """Note a finding."""
        self.problems.append(diagnostic)

    # --- commands ---------------------------------------------------------------------------

    def set_command(self, command: BodyCommand) -> None:
        """Take a body command; it holds until the next one or `release` (as in AMBF)."""
        body = self.scene.bodies[command.body]
        if command.body in self.engine.place_of:
            before = self.driven(command.body)
            self.commands.take(command.body, command.type, np.array(command.target, dtype=float))
            self.masses.update_commanded(command.body, before)
        if self.joints.command(body, command.joint_types, command.joint_values):
            self._report_owned(body)

    def _report_owned(self, body: Body) -> None:
        """Report once for each body that an arm owns its joints."""
        if body.index not in self._owned_reported:
            self._owned_reported.add(body.index)
            message = f"joint commands to '{body.identity.identifier}' have no effect: its arm is enabled"
            self.report(Diagnostic(Severity.WARNING, message, hint="disable the arm", code="owned"))

    def release(self, body: int) -> None:
        """Clear the command of a body: no force, its joints limp."""
        before = self.driven(body)
        if before:
            self._parting.begin()
        self.commands.clear(body)
        self.masses.update_commanded(body, before)
        self.joints.release(self.scene.bodies[body].joints)

    def clear_commands(self) -> None:
        """Clear the commands of all bodies; their joints go limp."""
        for body in self.scene.bodies:
            self.release(body.index)

    def drive(
        self, joints: Sequence[int], max_velocity: Array, max_deceleration: Array, yield_stiffness: float = 0.0
    ) -> Drive:
        """The drive of some joints of one tree; see `Drive`.

        Parameters
        ----------
        joints
            Indices (n,) of the joints in the scene.
        max_velocity, max_deceleration
            Limits (n,) at which set-points are followed: rad/s or m/s, rad/s² or m/s².
        yield_stiffness
            Stiffness in N·m/rad with which motors yield to a load; 0 is as strong as they are.

        Returns
        -------
        Drive
            What commands and reads these joints.
        """
        return Drive(self.joints, joints, max_velocity, max_deceleration, yield_stiffness)

    # --- the tick ---------------------------------------------------------------------------

    def pre_step(self) -> None:
        """Controllers, springs and gravity of the coming tick."""
        self.impulses.clear()
        try:
            self._prepare()
        except Exception as error:  # no command ends a run
            self.report(failure("the controllers of all joints", error))
            self.joints.release_tree()
        for body, command in self.commands.all:
            try:
                command.apply()
            except Exception as error:
                self._clear(body, error)

    def _prepare(self) -> None:
        """Laws of joints, damping and gravity, as one compiled call where that can reach Bullet."""
        if self.engine.motions.handle:
            prepare(*self.always, self.dt)
        else:
            self.joints.act()
            self._damping.step()
            self._lifts.step()

    def _clear(self, body: int, error: Exception) -> None:
        """Clear the commands of a body, and of all joints of its tree, whose controller failed."""
        self.report(failure(f"the controller of '{self.scene.bodies[body].identity.identifier}'", error))
        self.release(body)
        self.joints.release_tree(body)

    def step(self, tick: int = 0) -> None:
        """Advance Bullet by one tick, and put back what diverged in it."""
        self._closures.pace()
        # here, for a grasp that ended in this tick took the added mass back: its lift would throw a needle at 5 m/s
        self.masses.lift()
        self.chunks.follow()
        sound = self.engine.motions.step(MAX_SPEED)
        healthy = sound or not diverged(self.engine)
        if healthy:
            self.problems += self._closures.project(not sound)
        self._parting.step()
        self.collisions.step(tick)
        if not healthy:
            self._heal()

    @property
    def begins(self) -> bool:
        """Whether `pre_step` is what compiled code does with `always`."""
        return bool(self.engine.motions.handle) and not self.commands.all

    @property
    def coasts(self) -> bool:
        """Whether `step`, too, does nothing but advance Bullet, as long as no command comes."""
        return not (self.collisions.waits or self._parting.watches or self.chunks.bodies or self.scene.closures)

    def conclude(self, sound: bool) -> None:
        """Put back what diverged in ticks of compiled code, or slow down what is too fast, unless all is ``sound``."""
        if not sound and diverged(self.engine):
            self._heal()
        elif not sound:
            self.problems += self._closures.project(True)

    def _heal(self) -> None:
        """Reset trees that diverged to their initial poses, with all trees that loops join to them."""
        self._broken = True
        found = diverged(self.engine)
        for k in found:
            name = self.scene.bodies[self.engine.trees[k].root].identity.identifier
            message = f"'{name}' diverged and was reset to its initial pose"
            self.report(Diagnostic(Severity.ERROR, message, code="diverged"))
        for k in sorted(joined(self.engine, found)):
            self.engine.restart(k)
        if found:
            self.collisions.begin()

    def write_state(self, state: StateRecord) -> None:
        """Write poses, twists, joints and wrenches into a state record."""
        self._readout.write(state)

    def take_problems(self) -> list[Diagnostic]:
        """What was found since the last call."""
        found, self.problems = self.problems, []
        return found

    # --- bodies -----------------------------------------------------------------------------

    def pose7(self, body: int) -> Array:
        """Pose (7,) of a body."""
        pose, twist = np.empty(7), np.empty(6)
        self.engine.place_of[body].read(pose, twist)
        return pose

    def motion(self, body: int) -> tuple[Array, Array]:
        """Pose (7,) of a body's inertial frame I, and its twist (6,), in one read."""
        pose, twist = np.empty(7), np.empty(6)
        self.engine.place_of[body].read_inertial(pose, twist)
        return pose, twist

    def centre(self, body: int) -> Array:
        """Centre of mass (3,) of a body; a view, which the next tick changes."""
        return self.engine.place_of[body].centre()

    def twist(self, body: int) -> Array:
        """Linear velocity of the centre of mass and angular velocity of a body, (6,)."""
        return self.motion(body)[1]

    def read_motion(self, body: int, pose: Array, twist: Array) -> None:
        """Fill ``pose`` (7,) of a body's inertial frame I, and its ``twist`` (6,)."""
        self.engine.place_of[body].read_inertial(pose, twist)

    def read_motions(self, bodies: NDArray[np.int64], out: Array) -> None:
        """Fill ``out`` (n, 13): poses (7,) of the inertial frames of ``bodies`` (n,), and twists (6,)."""
        engine, motions = self.engine, self.engine.motions
        motions.prepare()
        read_bodies(motions.handle, motions.table, engine.place_table, bodies, out)

    def set_pose(self, body: int, pose: Array) -> None:
        """Put the root ``body`` of a tree at ``pose`` (7,), world axes, at rest, as the joints of a tree that moves."""
        tree = self.engine.place_of[body].tree
        if not self.engine.trees[tree].static and self.engine.trees[tree].axes:
            self.engine.motions.joints(tree)
            self.engine.motions.halt(tree)
        self.engine.place_of[body].set_pose(pose)
        self._parting.begin()

    def moving_with(self, body: int) -> tuple[int, ...]:
        """The bodies that are put elsewhere when ``body`` is, the root of their tree first.

        Raises
        ------
        ValueError
            For a body that joints hold to one that stands, and for a part of a thread.
        """
        place, name = self.engine.place_of.get(body), self.scene.bodies[body].identity.identifier
        if place is None:
            raise ValueError(f"body '{name}' is an element of a thread; set the pose of a body at an end of it")
        tree = self.engine.trees[place.tree]
        if not tree.static:
            return (tree.root, *(other for other in tree.link_of if other != tree.root))
        if place.link < 0:
            return (body,)
        raise ValueError(f"body '{name}' is held by joints; set its joints, or the pose of its root")

    def set_joint_position(self, joint: int, position: float, velocity: float = 0.0) -> None:
        """Set a ``joint`` at once to a ``position`` (rad or m) and ``velocity`` (per second), without dynamics."""
        self.joints.set_state(joint, position, velocity)
        self._parting.begin()

    def apply_force(self, body: int, force: Array, point: Array) -> None:
        """Push a ``body`` with ``force`` (3,), N, at ``point`` (3,), m, in world axes during the coming tick."""
        self.engine.place_of[body].apply_force(force, point)

    def driven(self, body: int) -> bool:
        """Whether a command sets the velocity of a body; see `BodyCommands.driven`."""
        return self.commands.driven(body)

    def apply_impulse(self, body: int, impulse: Array, moment: Array) -> None:
        """Change the momentum of a ``body`` in the coming tick, world axes; see `Impulses.apply`.

        ``impulse`` (3,), N·s, acts at its centre of mass, ``moment`` (3,), N·m·s, about it.
        """
        self.impulses.apply(body, impulse, moment)

    def attached_load(self, body: int) -> tuple[float, Array, Array]:
        """Mass and inertia attached to a body, and the load on it; see `Masses.attached_load`."""
        return self.masses.attached_load(body)

    def mobility(self, body: int) -> Array:
        """Change (6, 6) of a body's twist for a unit of impulse and moment at its centre of mass, at the start."""
        tree = next(tree for tree in self.engine.trees if body in tree.link_of)
        return mobility(self.scene, tree, body, self.dt)

    def kin(self, body: int) -> set[int]:
        """The bodies of the tree, or the rod, that ``body`` belongs to."""
        groups = [tree.link_of.keys() for tree in self.engine.trees] + [rod.bodies for rod in self.scene.rods]
        return set(next(group for group in groups if body in group))

    def commanded(self, bodies: set[int]) -> bool:
        """Whether a command acts on any of ``bodies`` or their joints that may make them as fast as it likes."""
        return self.commands.act(bodies) or self.joints.commanded(bodies)

    # --- reset, snapshots -------------------------------------------------------------------

    def reset(self) -> None:
        """Put every body back to its initial pose, at rest.

        Bullet's contacts are forgotten, for they would go on. Commands hold, as if they were sent again; so do the
        constraints of actuators.
        """
        held = self.joints.held()
        self._begin()
        self.engine.restore(self.engine.start)
        self.joints.follow(held)
        self.impulses.clear()
        self.commands.restart()
        self.collisions.restart()
        self.masses.restart()
        self.welds.repeat()
        self.chunks.follow()
        self._forget_contacts()

    def recover(self) -> None:
        """Put every body back, and clear all commands."""
        self._broken = True
        self.clear_commands()
        self.reset()

    def snapshot(self) -> dict[str, Any]:
        """All dynamic state but Bullet's own caches: a world continues like a restored one once it is restored, too."""
        return {
            **{name: part.snapshot() for name, part in self._parts().items()},
            "owned_reported": self._owned_reported,
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Forget Bullet's contacts and continue from `snapshot`."""
        self._begin()
        for name, part in self._parts().items():
            part.restore(snapshot[name])
        self._owned_reported = snapshot["owned_reported"]
        self.chunks.follow()
        self._forget_contacts()

    def _forget_contacts(self) -> None:
        self.engine.forget_contacts()
        self.wrenches.forget()

    def renew(self) -> None:
        """Go on in another Bullet client, as after a restore."""
        snapshot = copied(self.snapshot())
        self._broken = True
        self.restore(snapshot)

    def _parts(self) -> dict[str, Any]:
        """The parts with state, in the order in which they are restored."""
        return {
            "engine": self.engine,
            "joints": self.joints,
            "commands": self.commands,
            "impulses": self.impulses,
            "masses": self.masses,
            "collisions": self.collisions,
            "welds": self.welds,
            "parting": self._parting,
            "closures": self._closures,
        }

    def close(self) -> None:
        """Give the Bullet client back; a world that is forgotten does so by itself."""
        self.engine.close()
