"""The rigid bodies of a scene on Bullet, advanced one tick at a time.

Frames and units as in `ligature.model.scene`; poses are x y z qx qy qz qw of the body frame B in
world axes, twists are linear at the centre of mass, then angular, in world axes.
"""

from __future__ import annotations

import weakref
from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.adf import Diagnostic, Severity
from ligature.mesh import CollisionCache
from ligature.model.commands import BodyCommand, CommandType
from ligature.model.frames import matrix_pose7
from ligature.model.scene import Body, Scene
from ligature.model.state import StateRecord
from ligature.model.subsystem import Subsystem, kept, put_back
from ligature.physics.articulation import Tree, build, inertia_of, is_alone
from ligature.physics.bodies import BodyControl, Placement
from ligature.physics.closures import CLOSING, Closures
from ligature.physics.control import TreeControl
from ligature.physics.drive import Drive
from ligature.physics.grasp_support import GraspSupport
from ligature.physics.gravity import common_gravity, gravity_lifts
from ligature.physics.mobility import mobility
from ligature.physics.motions import Motions
from ligature.physics.parting import Parting
from ligature.physics.queries import BulletQueries
from ligature.physics.readout import Readout

Array = NDArray[np.float64]

SOLVER_ITERATIONS = 50
"""With 10, a step on the base of an arm shakes its jaws by 0.06 rad; contacts at rest cost the same."""

LOOP_ITERATIONS = 200
"""The same where loops close: with 50, links of grams beside ones of kilograms part by 2 mm, with 200 by 0.1 mm."""

NEAR = 0.002
"""Gap in metres up to which Bullet prepares contacts; its 20 mm takes half of the time of a needle on a phantom."""

IMMOVABLE = 1e6
"""Mass in kg, and inertia, that no thread or tissue moves in a tick."""

MOST_CHARACTERS = 300
"""Most characters of an exception in a finding."""

MAX_SPEED = 1e4
"""Speed in m/s or rad/s beyond which a body has diverged."""

_KEPT = (
    "_hold_counts",
    "_grasp_counts",
    "_disabled_pairs",
    "stopped_fingers",
    "_impulses",
    "_next_handle",
    "_owned_reported",
)
"""Attributes that last from tick to tick as they are."""


def failure(what: str, error: Exception) -> Diagnostic:
    """The finding that ``what`` failed with an exception, and that its command is cleared therefore."""
    return failed(f"{what} failed, and its command is cleared", error)


def failed(what: str, error: Exception) -> Diagnostic:
    """The finding that an exception was raised, ``what`` states where."""
    text = f"{what}: {type(error).__name__}: {str(error)[:MOST_CHARACTERS]}"
    return Diagnostic(Severity.ERROR, text, code="failed")


class Controllers(Subsystem):
    """Controllers, springs, gravity and damping of a `World`: they act before rods and grasps feel how bodies move.

    All that they remember belongs to the world, which keeps it in its snapshots.
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


class World(Subsystem, BulletQueries, GraspSupport):
    """All rigid bodies of ``scene`` outside rods; one Bullet client of its own."""

    def __init__(self, scene: Scene, dt: float = 1e-3) -> None:
        self.scene = scene
        self.dt = dt
        self._cache = CollisionCache()
        self.problems: list[Diagnostic] = []
        self._owned_reported: set[int] = set()
        self._create()

    def _create(self) -> None:
        scene = self.scene
        self.client = pybullet.connect(pybullet.DIRECT)
        self._end = weakref.finalize(self, pybullet.disconnect, self.client)
        self._world_gravity = common_gravity(scene)
        iterations = LOOP_ITERATIONS if scene.closures else SOLVER_ITERATIONS
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.dt, numSubSteps=0, numSolverIterations=iterations, erp=CLOSING,
            deterministicOverlappingPairs=1, contactBreakingThreshold=NEAR, physicsClientId=self.client,
        )  # fmt: skip
        pybullet.setGravity(*self._world_gravity.tolist(), physicsClientId=self.client)
        self.trees = [build(self.client, self._cache, scene, a, dt=self.dt) for a in scene.articulations]
        self._motions = Motions(self.client, self.trees)
        self.place_of = {
            body: Placement(self.client, tree, scene.bodies[body], self._motions, k)
            for k, tree in enumerate(self.trees)
            for body in tree.link_of
        }
        self._tree_of_joint: dict[int, TreeControl] = {}
        self._controls = [
            TreeControl(self.client, tree, scene.joints, self.dt, self._motions, k) for k, tree in enumerate(self.trees)
        ]
        for control in self._controls:
            self._tree_of_joint.update(dict.fromkeys(control.row, control))
        self._jointed = [control for control in self._controls if control.links]
        self._body_controls: dict[int, BodyControl] = {}
        self._lifts = gravity_lifts(
            self.client, scene, self.trees, self._controls, self.place_of, self._motions, self._world_gravity
        )
        self._damped = self._damping_factors()
        self._silence_pairs()
        self._closures = Closures(self.client, scene, self.trees, self.place_of, self._motions, self.dt)
        self._readout = Readout(self.client, scene, self.trees, self._motions, self.place_of)
        self._parting = Parting(self.client, self.dt)
        self._setup_queries()
        self._setup_grasp_support()
        self._motions.forget_all()

    def report(self, diagnostic: Diagnostic) -> None:
        """Note a finding."""
        self.problems.append(diagnostic)

    # --- commands ---------------------------------------------------------------------------

    def set_command(self, command: BodyCommand) -> None:
        """Take a body command; it holds until the next one or `release` (interface reference §3.1, §3.2)."""
        body = self.scene.bodies[command.body]
        if command.body in self.place_of:
            control = self._body_controls.get(command.body)
            if control is None:
                control = self._body_controls[command.body] = BodyControl(self.place_of[command.body], self.dt)
            before = self.driven(command.body)
            control.set(command.type, np.array(command.target, dtype=float))
            self._update_commanded(command.body, before)
        types = command.joint_types
        for i, (joint, value) in enumerate(zip(body.joints, command.joint_values, strict=False)):
            tree = self._tree_of_joint.get(joint)
            if tree is not None:
                type_ = types[i] if i < len(types) else CommandType.FORCE
                if tree.owned[tree.row[joint]] and type_ is not CommandType.FORCE:
                    self._report_owned(body)
                tree.command(self.scene.joints[joint], type_, value)

    def _report_owned(self, body: Body) -> None:
        """State once for each body that an arm owns its joints."""
        if body.index not in self._owned_reported:
            self._owned_reported.add(body.index)
            message = f"joint commands to '{body.identity.identifier}' have no effect: its arm is enabled"
            self.report(Diagnostic(Severity.WARNING, message, hint="disable the arm", code="owned"))

    def drive(
        self, joints: Sequence[int], max_velocity: Array, max_deceleration: Array, yield_stiffness: float = 0.0
    ) -> Drive:
        """The drive of ``joints``, all of one tree; see `Drive`."""
        return Drive(self, joints, max_velocity, max_deceleration, yield_stiffness)

    def control_of(self, joint: int) -> TreeControl:
        """The controllers of the tree that a joint belongs to; another one after a snapshot."""
        return self._tree_of_joint[joint]

    def release(self, body: int) -> None:
        """Clear the command of a body: no force, its joints limp."""
        before = self.driven(body)
        if before:
            self._parting.begin()
        self._body_controls.pop(body, None)
        self._update_commanded(body, before)
        for joint in self.scene.bodies[body].joints:
            if joint in self._tree_of_joint:
                self._tree_of_joint[joint].release(joint)

    def clear_commands(self) -> None:
        """Clear the commands of all bodies; their joints go limp."""
        for body in self.scene.bodies:
            self.release(body.index)

    # --- the tick ---------------------------------------------------------------------------

    def pre_step(self) -> None:
        """Controllers, springs and gravity of the coming tick."""
        self._impulses.clear()
        for control in self._jointed:
            if control.active:
                try:
                    control.apply()
                except Exception as error:  # no command ends a run
                    self._clear(control.tree.root, error)
        for place, linear, angular in self._damped:
            place.slow_down(linear, angular)
        for lift in self._lifts:
            lift.push()
        self._apply_attached_loads()
        for body, control_ in list(self._body_controls.items()):
            try:
                control_.apply()
            except Exception as error:
                self._clear(body, error)

    def _clear(self, body: int, error: Exception) -> None:
        """Clear the commands of a body, or of all joints of the tree of a root, whose controller failed."""
        self.report(failure(f"the controller of '{self.scene.bodies[body].identity.identifier}'", error))
        self.release(body)
        for tree in self._controls:
            if tree.tree.root == body:
                tree.let_go(np.arange(len(tree.links)))

    def step(self, tick: int = 0) -> None:
        """Advance Bullet by one tick, and put back what diverged in it."""
        self._closures.pace()
        pybullet.stepSimulation(physicsClientId=self.client)
        self._parting.step()
        self._motions.expire()
        if not self._motions.sound(MAX_SPEED):
            self._heal()

    def write_state(self, state: StateRecord) -> None:
        """Write poses, twists, joints and wrenches into a state record."""
        self._readout.write(state)

    # --- bodies -----------------------------------------------------------------------------

    def pose7(self, body: int) -> Array:
        """Pose (7,) of a body."""
        pose, twist = np.empty(7), np.empty(6)
        self.place_of[body].read(pose, twist)
        return pose

    def twist6(self, body: int) -> Array:
        """Twist (6,) of a body."""
        pose, twist = np.empty(7), np.empty(6)
        self.place_of[body].read(pose, twist)
        return twist

    def motion(self, body: int) -> tuple[Array, Array]:
        """Pose (7,) of a body's inertial frame I, and its twist (6,), in one read."""
        pose, twist = np.empty(7), np.empty(6)
        self.place_of[body].read_inertial(pose, twist)
        return pose, twist

    def read_motion(self, body: int, pose: Array, twist: Array) -> None:
        """Fill ``pose`` (7,) of a body's inertial frame I, and its ``twist`` (6,)."""
        self.place_of[body].read_inertial(pose, twist)

    def set_pose(self, body: int, pose: Array) -> None:
        """Put the root body of a tree at ``pose`` (7,) at rest; raises ValueError for a link of an arm."""
        place = self.place_of[body]
        if place.link >= 0:
            name = self.scene.bodies[body].identity.identifier
            raise ValueError(f"body '{name}' hangs on joints; set its joints, or the pose of its root")
        place.put(pose)
        self._parting.begin()

    def set_joint_position(self, joint: int, position: float, velocity: float = 0.0) -> None:
        """Set a joint to a position and velocity at once, without dynamics."""
        control = self._tree_of_joint[joint]
        control.put([control.row[joint]], [position], velocity)
        self._parting.begin()

    def apply_force(self, body: int, force: Array, point: Array) -> None:
        """Push a body with ``force`` (3,) at ``point`` (3,) during the coming tick."""
        self.place_of[body].push(force, point)

    def driven(self, body: int) -> bool:
        """Whether a command sets the velocity of a body, so that a thread, however light the body, does not."""
        control = self._body_controls.get(body)
        return body in self.stopped_fingers or (control is not None and control.sets_velocity)

    def apply_impulse(self, body: int, impulse: Array, moment: Array) -> None:
        """Change the momentum of a body by ``impulse`` (3,) at its centre of mass and ``moment`` (3,).

        A driven body feels it and moves as commanded.
        """
        total, given = self._impulses.get(body), np.concatenate([impulse, moment])
        self._impulses[body] = given if total is None else total + given
        if body in self.stopped_fingers or not self.driven(body):
            self.place_of[body].load((given / self.dt).tolist())

    def mobility(self, body: int) -> Array:
        """Change (6, 6) of a body's twist for a unit of impulse and moment at its centre of mass, at the start."""
        tree = next(tree for tree in self.trees if body in tree.link_of)
        return mobility(self.scene, tree, body, self.dt)

    def attached_load(self, body: int) -> tuple[float, Array, Array]:
        """What holds a body, and pulls at it in the coming tick: mass, inertia (3,), and commanded wrench (6,)."""
        if self.driven(body):
            return IMMOVABLE, np.full(3, IMMOVABLE), np.zeros(6)
        palms = [self.scene.bodies[held.parent] for held in self._welds.values() if held.child == body]
        held_mass, held_inertia = self.mass_of(body)
        own = self.scene.bodies[body]
        mass = held_mass - own.mass + sum(palm.mass for palm in palms)
        inertia = held_inertia - inertia_of(own)
        inertia += sum((np.full(3, inertia_of(palm).max()) for palm in palms), np.zeros(3))
        control = self._body_controls.get(body)
        forced = control is not None and control.type is CommandType.FORCE
        return mass, inertia, control.target.copy() if control is not None and forced else np.zeros(6)

    def kin(self, body: int) -> set[int]:
        """The bodies of the tree, or the rod, that ``body`` belongs to."""
        groups = [tree.link_of.keys() for tree in self.trees] + [rod.bodies for rod in self.scene.rods]
        return set(next(group for group in groups if body in group))

    def commanded(self, bodies: set[int]) -> bool:
        """Whether a command acts on any of ``bodies`` or their joints that may make them as fast as it likes."""
        controls = (self._body_controls.get(body) for body in bodies)
        if any(control is not None and control.acts for control in controls):
            return True
        trees = {id(c): c for c in self._controls if not bodies.isdisjoint(c.tree.link_of)}
        return any(control.commanded for control in trees.values())

    def overlap(self, bodies: set[int]) -> tuple[float, int]:
        """How deep in metres one of ``bodies`` overlaps another body, and which; (0, -1) when none does."""
        deepest = (0.0, -1)
        for body in sorted(bodies & self.place_of.keys()):
            for contact in self.contacts(body, 0.0):
                deepest = max(deepest, (-contact.distance, contact.body))
        return deepest

    # --- health, reset, snapshots -----------------------------------------------------------

    def take_problems(self) -> list[Diagnostic]:
        """What was found since the last call."""
        found, self.problems = self.problems, []
        return found

    def _heal(self) -> None:
        """Put trees that diverged back to where the scene starts, with all that loops join to them."""
        diverged = [k for k in range(len(self.trees)) if not all(abs(v) < MAX_SPEED for v in self._motions.speeds(k))]
        for k in diverged:
            name = self.scene.bodies[self.trees[k].root].identity.identifier
            message = f"'{name}' diverged and was put back to its initial pose"
            self.report(Diagnostic(Severity.ERROR, message, code="diverged"))
        for k in sorted(self._joined(diverged)):
            self._restart(k, self.trees[k])

    def _joined(self, trees: Iterable[int]) -> set[int]:
        """``trees`` and those that loops join to them, over any number of trees that move."""
        ends = [{self.place_of[body].tree for body in (c.inner, c.outer)} for c in self.scene.closures]
        still = {k for k, tree in enumerate(self.trees) if tree.static and not tree.axes}
        joined, before = set(trees), -1
        while len(joined) > before:
            before = len(joined)
            for pair in ends:
                if pair & joined - still:
                    joined |= pair
        return joined

    def reset(self) -> None:
        """Put every body back to its initial pose, at rest.

        The world is built anew, for Bullet's own caches would go on. Commands hold, as if they were sent again; so do
        the constraints of actuators.
        """
        controls, commands, held = self._controls, self._body_controls, self.welds()
        handle = self._next_handle
        self.close()
        self._create()
        for control, before in zip(self._controls, controls, strict=True):
            control.follow(before)
        self._hold_counts = dict(Counter(weld.child for weld in held.values()))
        for body, command in commands.items():
            self._body_controls[body] = BodyControl(self.place_of[body], self.dt)
            self._body_controls[body].set(command.type, command.target.copy())
        self._restore_masses()
        self.restore_welds(held)
        self._next_handle = handle

    def recover(self) -> None:
        """Put every body back, and clear all commands."""
        self.clear_commands()
        self.reset()

    def _restart(self, index: int, tree: Tree) -> None:
        self.place_of[tree.root].put(matrix_pose7(self.scene.start.roots[tree.root]))
        tree.put_joints(self.client)
        self._motions.forget(index)

    def snapshot(self) -> dict[str, Any]:
        """All dynamic state but Bullet's own caches: a world continues like a restored one once it is restored, too."""
        trees = []
        for tree in self.trees:
            pose = pybullet.getBasePositionAndOrientation(tree.uid, physicsClientId=self.client)
            velocity = pybullet.getBaseVelocity(tree.uid, physicsClientId=self.client)
            links = [link for link, *_ in tree.axes]
            states = pybullet.getJointStates(tree.uid, links, physicsClientId=self.client) if links else []
            trees.append((pose, velocity, [(s[0], s[1]) for s in states]))
        return {
            "trees": trees,
            "controls": [control.snapshot() for control in self._controls],
            "sent": dict(self._motions.sent),
            "parting": self._parting.snapshot(),
            "held": self.welds(),
            "bodies": {body: control.snapshot() for body, control in self._body_controls.items()},
            **kept(self, _KEPT),
        }

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Build the world anew and continue from `snapshot`: Bullet's own saved states are not exact."""
        self.close()
        self._create()
        for tree, (pose, velocity, joints) in zip(self.trees, snapshot["trees"], strict=True):
            self.place_of[tree.root].put_inertial(*pose)
            for (link, *_), (q, qd) in zip(tree.axes, joints, strict=True):
                pybullet.resetJointState(tree.uid, link, q, qd, physicsClientId=self.client)
            pybullet.resetBaseVelocity(tree.uid, *velocity, physicsClientId=self.client)
        self._motions.sent.update(snapshot["sent"])
        for control, state in zip(self._controls, snapshot["controls"], strict=True):
            control.restore(state)
        for body, state in snapshot["bodies"].items():
            command = self._body_controls[body] = BodyControl(self.place_of[body], self.dt)
            command.restore(state)
        put_back(self, {name: snapshot[name] for name in _KEPT})
        self._restore_masses()
        self._restore_disabled_pairs()
        self.restore_welds(snapshot["held"])
        self._parting.restore(snapshot["parting"])
        self._next_handle = snapshot["_next_handle"]
        self._motions.forget_all()

    def close(self) -> None:
        """Give the Bullet client back; a world that is forgotten does so by itself."""
        self._end()

    # --- set-up -----------------------------------------------------------------------------

    def _damping_factors(self) -> list[tuple[Placement, float, float]]:
        """Lone bodies with the factors of a tick on their linear and angular velocity (§12.1)."""
        factors = []
        for tree in self.trees:
            if is_alone(tree, self.scene.bodies):
                body = self.scene.bodies[tree.root]
                linear, angular = (1 - body.linear_damping) ** self.dt, (1 - body.angular_damping) ** self.dt
                if linear < 1.0 or angular < 1.0:
                    factors.append((self.place_of[tree.root], linear, angular))
        return factors

    def _silence_pairs(self) -> None:
        for body, place in self.place_of.items():
            for other in self.scene.bodies[body].no_collision_with:
                if other > body and other in self.place_of:
                    there = self.place_of[other]
                    pybullet.setCollisionFilterPair(
                        place.uid, there.uid, place.link, there.link, 0, physicsClientId=self.client
                    )
