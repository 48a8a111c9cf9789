"""Grasps of a running scene: jaws that close on a body hold it by friction, until they open or it slips out.

Bullet's contacts move fingers and bodies until both pads touch. From then on the friction law of
`ligature.grasping.grasp` replaces them: the fingers stop where they are, their collisions with the body are disabled,
and the force between them follows from the efforts that their commands request. World axes, SI units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.grasping import thread_grasps
from ligature.grasping.actuator_grasps import ActuatorGrasps
from ligature.grasping.exchange import AFRESH, CREPT, RELEASED, JawArrays, keep, warm_up
from ligature.grasping.fingers import TOUCH, Facing, Fingers
from ligature.grasping.grasp import Patch
from ligature.grasping.impulses import BodyGrasp, ImpulseExchange, begin
from ligature.grasping.looking import SEARCH_PERIOD, Looks, looks
from ligature.model.frames import inverse, pose7_matrix
from ligature.model.lookup import UnknownNameError
from ligature.model.scene import Jaw, Scene
from ligature.model.state import FieldViews, StateRecord
from ligature.model.subsystem import ALWAYS, Subsystem, kept, put_back
from ligature.physics import World
from ligature.suture import Rods
from ligature.suture.partners import JawPads
from ligature.tables import table_of

Array = NDArray[np.float64]
Integers = NDArray[np.int64]

NOTHING: Integers = np.zeros((0, 1), dtype=np.int64)
"""No tables."""

PRESENT = 0.3e-3
"""Sum of the gaps of both pads, in metres, beyond which they have lost the body."""


@dataclass(frozen=True, eq=False)
class Held:
    """The body that one jaw holds.

    ``body`` is the scene's index; ``normal_force`` (N) presses the fingers together; ``wrench`` (6,) acts on the
    body about the patch, in world axes; ``slip`` (2,) is the slip since the body was grasped, in metres and radians;
    ``share`` is the used share of the Coulomb limit, 1 while the body slips.
    """

    jaw: str
    body: int
    normal_force: float
    wrench: Array
    slip: Array
    share: float


@dataclass
class JawGrasp(BodyGrasp):
    """A body between the pads of one jaw.

    ``levers`` (2,) in metres are those of the pads about the axis of the fingers, ``positions`` (2,) in radians the
    joint positions at which the fingers stop, ``palm_at`` (3,) the position of the palm in the last tick, and
    ``checked`` (1,) the slip in metres at the last check.
    """

    levers: Array
    positions: Array
    palm_at: Array
    checked: Array = field(default_factory=lambda: np.zeros(1))


class Grasps(Subsystem, Mapping[str, Held | None]):
    """The bodies that the jaws of a scene hold, by the jaw's name; None for an empty jaw.

    Parameters
    ----------
    scene, world, rods
        The scene, its rigid bodies and its threads.
    actuator_grasps
        The grasps of actuators; they are solved together with those of jaws.
    actuated
        Returns the body that each actuator of the scene holds, -1 for none: a jaw does not grasp a body that an
        actuator of the same tool holds rigidly.
    """

    def __init__(
        self, scene: Scene, world: World, rods: Rods, actuator_grasps: ActuatorGrasps, actuated: Callable[[], list[int]]
    ) -> None:
        self._scene, self._world, self._rods = scene, world, rods
        self._actuator_grasps, self._actuated = actuator_grasps, actuated
        self._fingers = [Fingers(jaw, world) for jaw in scene.jaws]
        tree_of = {link.body: tree for tree in scene.articulations for link in tree.links}
        self._own = [{link.body for link in tree_of[jaw.palm].links} for jaw in scene.jaws]
        free = {body for body in tree_of if not scene.bodies[body].static}
        self._idle = [not rods.rods and not free - own for own in self._own]
        """Jaws for which there is nothing to grasp."""
        self._searching = [index for index, idle in enumerate(self._idle) if not idle]
        self._actuators = [[a.index for a in scene.actuators if a.parent in own] for own in self._own]
        self._jaw_grasps: list[JawGrasp | None] = [None for _ in scene.jaws]
        self._thread_grasps: list[thread_grasps.ThreadGrasp | None] = [None for _ in scene.jaws]
        self._pads: list[JawPads | None] = [None for _ in scene.jaws]
        self._disabled: list[list[int]] = [[] for _ in scene.jaws]
        self._near = [False for _ in scene.jaws]
        self._impulses = ImpulseExchange(world)
        self._holds: list[tuple[JawGrasp, JawArrays, Integers] | None] = [None for _ in scene.jaws]
        """Tables of the jaw grasps, for compiled code."""
        self._looked_at: object = None
        self.look_table: Integers = np.zeros(0, np.int64)
        """What `may_grasp` takes."""
        self._looking: list[bool] = []
        """Whether the boxes of a jaw's fingers are known."""
        self._look()
        self._fields, self._written_empty = FieldViews(), False
        if scene.jaws:
            warm_up()
            for rod in rods.rods:
                rod.warm_up()

    def __getitem__(self, name: str) -> Held | None:
        return self._held(self._index(name))

    def __iter__(self) -> Iterator[str]:
        return (jaw.name for jaw in self._scene.jaws)

    def __len__(self) -> int:
        return len(self._scene.jaws)

    def _index(self, name: str) -> int:
        """Index of a jaw; raises `UnknownNameError` for a name that no jaw has."""
        names = [jaw.name for jaw in self._scene.jaws]
        if name not in names:
            raise UnknownNameError(f"jaw '{name}' is missing; the scene has {', '.join(names) or 'none'}")
        return names.index(name)

    def _held(self, index: int) -> Held | None:
        held, thread = self._jaw_grasps[index], self._thread_grasps[index]
        if thread is not None:
            return _held_thread(self._scene.jaws[index].name, thread)
        if held is None:
            return None
        grasp = held.grasp
        R = grasp.world_patch(self._world.motion(self._scene.jaws[index].palm)[0])[:3, :3]
        wrench = np.concatenate([R @ grasp.load[:3], R @ grasp.load[3:]])
        name = self._scene.jaws[index].name
        return Held(name, held.body, grasp.normal_force, wrench, grasp.slipped.copy(), grasp.share())

    def body_in(self, name: str) -> int:
        """The body that a jaw holds, -1 for none; raises `UnknownNameError` for a name that no jaw has."""
        index = self._index(name)
        held = self._thread_grasps[index] or self._jaw_grasps[index]
        return -1 if held is None else held.body

    def patch(self, name: str) -> Array:
        """Pose (4, 4) in world axes of the contact patch of a jaw, z normal to the pads, x along the fingers.

        Raises `UnknownNameError` for a name that no jaw has, ValueError when the jaw holds no body.
        """
        index = self._index(name)
        held = self._jaw_grasps[index]
        if held is None:
            raise ValueError(f"the jaw of {name} holds no body")
        return held.grasp.world_patch(self._world.motion(self._scene.jaws[index].palm)[0])

    # --- the tick ---------------------------------------------------------------------------

    def step(self, tick: int) -> None:
        """Search, close, hold and release; the impulses act in the coming tick of the bodies."""
        for index, held in enumerate(self._jaw_grasps):
            thread = self._thread_grasps[index]
            if held is not None:
                self._keep(index, held)
            elif thread is not None:
                self._keep_thread(index, thread)
            elif self._idle[index]:
                continue
            elif self._near[index] or ((tick + index) % SEARCH_PERIOD == 0 and self._fingers[index].driven()):
                self._search(index)
        if self._actuator_grasps or any(held is not None for held in self._jaw_grasps):
            self._exchange_impulses()

    def idle_ticks(self, tick: int) -> int:
        """The ticks until a jaw that may grasp something searches.

        None counts that compiled code finds in vain, with `look_table`; nor do jaws that hold bodies, as long as
        it holds on to them with the tables of `carried`. That is not so where actuators hold something, jaws a thread,
        or two of them one body.
        """
        if self._actuator_grasps or any(self._thread_grasps) or not self._hold_alone():
            return 0
        left, due = ALWAYS, self._look().due
        for index in self._searching:
            due[index] = -1
            if self._jaw_grasps[index] is not None:
                continue
            if self._near[index]:
                return 0
            wait = -(tick + index) % SEARCH_PERIOD
            if wait < left and self._fingers[index].driven():
                if self._looking[index]:
                    due[index] = wait
                else:
                    left = wait
        return left

    def _look(self) -> Looks:
        """The boxes in Bullet of what jaws may grasp: others once an engine is rebuilt."""
        motions = self._world.engine.motions
        if motions is not self._looked_at:
            self._looked_at = motions
            owners = [self._world.engine.body_at.get(place, -1) for place in self._world.engine.boxed]
            found = self._looks = looks(len(self), len(owners))
            for index, (fingers, own) in enumerate(zip(self._fingers, self._own, strict=True)):
                found.fingers[index] = [body in fingers.jaw.fingers for body in owners]
                found.others[index] = [
                    body >= 0 and body not in own and not self._scene.bodies[body].static for body in owners
                ]
            self._looking = [set(fingers.jaw.fingers) <= set(owners) for fingers in self._fingers]
            self.look_table = table_of(found) if self._searching else np.zeros(0, np.int64)
        return self._looks

    def _hold_alone(self) -> bool:
        """Whether nothing else holds what a jaw holds."""
        bodies = [held.body for held in self._jaw_grasps if held is not None]
        return not bodies or (len(set(bodies)) == len(bodies) and set(bodies).isdisjoint(self._actuated()))

    def carried(self) -> tuple[Integers, Integers]:
        """Tables for compiled code: `JawArrays` of each jaw that holds a body, and what is `Exchanged` for each body.

        They are those of the coming ticks, after which `pass_idle` is to follow.
        """
        holding = [(index, held) for index, held in enumerate(self._jaw_grasps) if held is not None]
        if not holding:
            return NOTHING, NOTHING
        exchanges = [self._impulses.of([held]) for _, held in holding]
        for exchange in exchanges:
            exchange.prepare()
        return np.array([self._hold_table(*jaw) for jaw in holding]), np.array([found.table for found in exchanges])

    def pass_idle(self, ticks: int) -> None:
        """Take over what compiled code did with the tables of `carried`."""
        for held in self._jaw_grasps:
            if held is not None:
                self._impulses.of([held]).conclude()

    def _search(self, index: int) -> None:
        """Close gently on the nearest body between the fingers; grasp it when both pads touch it."""
        fingers, disabled = self._fingers[index], self._disabled[index]
        around, box = self._world.queries.surroundings(fingers.jaw.fingers)
        between: list[tuple[int, tuple[Facing, Facing]]] = []
        for body in around:
            if self._scene.bodies[body].static or body in self._own[index]:
                continue
            faces = fingers.facing(body, fingers.jaw.reach)
            if faces is not None:
                between.append((body, faces))
        for body in [body for body in disabled if not fingers.near(body)]:
            self._disable_collision(index, body, False)
        thread = thread_grasps.within(self._rods, box)
        self._near[index] = bool(between or disabled or thread)
        if not between:
            if not thread:
                fingers.release()
            elif not self._grasp_thread(index):
                fingers.approach_thread(box)
            return
        body, faces = min(between, key=lambda item: item[1][0].gap + item[1][1].gap)
        if max(faces[0].gap, faces[1].gap) <= TOUCH and min(fingers.efforts()) > 0.0:
            self._grasp(index, body, faces)
        else:
            fingers.approach(faces)

    def _grasp(self, index: int, body: int, faces: tuple[Facing, Facing]) -> None:
        fingers, jaw = self._fingers[index], self._scene.jaws[index]
        palm = self._world.motion(jaw.palm)[0]
        T_palm_patch = inverse(pose7_matrix(palm)) @ _patch_pose(fingers, faces)
        friction = self._friction(jaw, self._scene.bodies[body].friction)
        grasp, ride = begin(self._world, jaw.palm, body, Patch(T_palm_patch, jaw.half_width, friction))
        levers, positions = np.array([face.lever for face in faces]), np.array(fingers.positions())
        held = JawGrasp(body, jaw.palm, grasp, ride, levers, positions, palm[:3].copy())
        self._jaw_grasps[index] = held
        self._replace_contacts(index, held)
        self._world.masses.set_held(body, True, grasped=True)
        self._rods.update_masses(self._world.masses)
        self._keep(index, held)

    def _grasp_thread(self, index: int) -> bool:
        """Grasp a thread that both pads touch; returns whether there is one."""
        fingers, jaw = self._fingers[index], self._scene.jaws[index]
        for number, rod in enumerate(self._rods.rods):
            friction = self._friction(jaw, float(rod.description.friction.mean()))
            thread = thread_grasps.begin(number, self._rods, self._world, fingers, friction)
            if thread is not None:
                self._thread_grasps[index] = thread
                self._world.commands.set_stopped(jaw.fingers, True)
                self._keep_thread(index, thread)
                return True
        return False

    def _keep_thread(self, index: int, thread: thread_grasps.ThreadGrasp) -> None:
        """Apply the pads of a jaw to a thread in the next tick, or release it."""
        pads = thread_grasps.keep(thread, self._rods, self._world, self._fingers[index])
        if pads is None:
            self._release_thread(index, thread)
        else:
            self._pads[index] = pads
            self._update_rod(thread.rod)

    def _release_thread(self, index: int, thread: thread_grasps.ThreadGrasp) -> None:
        """Release a thread."""
        self._thread_grasps[index] = self._pads[index] = None
        self._world.commands.set_stopped(self._scene.jaws[index].fingers, False)
        self._rods.exclude(thread.rod, self._scene.jaws[index].fingers, None)
        self._fingers[index].release()
        self._update_rod(thread.rod)

    def _update_rod(self, number: int) -> None:
        """Set the pads that hold a rod."""
        held = [
            other
            for p, other in zip(self._thread_grasps, self._pads, strict=True)
            if p is not None and other is not None and p.rod == number
        ]
        self._rods.rods[number].set_pads(held)

    def _friction(self, jaw: Jaw, other: float) -> float:
        """Coefficient between the pads and something with the friction ``other``: the product, as for all contacts."""
        return other * float(np.mean([self._scene.bodies[finger].friction for finger in jaw.fingers]))

    def _replace_contacts(self, index: int, held: JawGrasp) -> None:
        """Replace Bullet's contacts and motors by the friction law."""
        self._disable_collision(index, held.body, True)
        self._fingers[index].stop(held.positions.tolist(), (0.0, 0.0))

    def _disable_collision(self, index: int, body: int, disabled: bool) -> None:
        for finger in self._scene.jaws[index].fingers:
            self._world.collisions.disable(finger, body, disabled)
        self._disabled[index] = sorted(
            {*self._disabled[index], body} if disabled else {*self._disabled[index]} - {body}
        )

    def _keep(self, index: int, held: JawGrasp) -> None:
        """Set the commanded normal force; release the body when the jaw opens or the body slipped out."""
        motions = self._world.engine.motions
        motions.prepare()
        found = keep(
            motions.handle, motions.table, self._world.engine.place_table, self._world.joints.table,
            self._hold_table(index, held),
        )  # fmt: skip
        if found & RELEASED:
            self._release(index)
            return
        if found & AFRESH:
            self._fingers[index].sort_motors()
        if found & CREPT:
            self._follow_slip(index, held)

    def _hold_table(self, index: int, held: JawGrasp) -> Integers:
        """The table of a `JawArrays`, for compiled code."""
        known = self._holds[index]
        if known is None or known[0] is not held:
            fingers, arrays = self._fingers[index], held.grasp.arrays
            hold = JawArrays(
                np.array([held.palm]), fingers.axes, fingers.opening, held.levers, held.positions, held.palm_at,
                held.checked, arrays.pads[0], arrays.slid[0],
            )  # fmt: skip
            known = self._holds[index] = held, hold, table_of(hold)
        return known[2]

    def _follow_slip(self, index: int, held: JawGrasp) -> None:
        """Move patch and fingers along with a body that slips; release it when it has slipped out."""
        fingers = self._fingers[index]
        held.checked[0] = held.grasp.slipped[0]
        faces = fingers.facing(held.body, fingers.jaw.reach)
        room = np.inf if faces is None else faces[0].gap + faces[1].gap
        if faces is None or room > PRESENT:
            self._release(index)
            return
        T_palm_world = inverse(pose7_matrix(self._world.motion(fingers.jaw.palm)[0]))
        held.grasp.move_patch(T_palm_world @ _patch_pose(fingers, faces))
        levers = faces[0].lever, faces[1].lever
        held.levers[:] = levers
        held.positions[:] = fingers.moved(held.positions.tolist(), (0.5 * room, 0.5 * room), levers)

    def _release(self, index: int) -> None:
        """End a grasp; collisions stay disabled until the fingers are clear of the body."""
        held = self._jaw_grasps[index]
        if held is None:
            return
        self._jaw_grasps[index] = None
        self._fingers[index].release()
        self._world.masses.set_held(held.body, False, grasped=True)
        self._rods.update_masses(self._world.masses)
        self._near[index] = True

    def _exchange_impulses(self) -> None:
        """Apply the impulses of all grasps, body by body."""
        by_body: dict[int, list[BodyGrasp]] = {}
        if self._actuator_grasps:
            if self._actuator_grasps.release(slipped=True):
                self._rods.update_masses(self._world.masses)
            for grasp in self._actuator_grasps.grasps:
                by_body.setdefault(grasp.body, []).append(grasp)
        actuated = self._actuated()
        for held, actuators in zip(self._jaw_grasps, self._actuators, strict=True):
            if held is not None and held.body not in [actuated[a] for a in actuators]:
                by_body.setdefault(held.body, []).append(held)
        for grasps in by_body.values():
            self._impulses.apply(grasps)

    # --- state ------------------------------------------------------------------------------

    def release_body(self, body: int | None = None) -> None:
        """Release a body that is put elsewhere; all bodies and threads for None."""
        for index, held in enumerate(self._jaw_grasps):
            if held is not None and body in (None, held.body):
                self._release(index)
            thread = self._thread_grasps[index]
            if thread is not None and body is None:
                self._release_thread(index, thread)
        if self._actuator_grasps.release(body):
            self._rods.update_masses(self._world.masses)

    def write_state(self, state: StateRecord) -> None:
        """Write the body in every jaw to a state record."""
        self._fields.of(state)
        empty = not any(self._jaw_grasps) and not any(self._thread_grasps)
        if empty and self._written_empty and not self._fields.fresh:
            return
        self._written_empty = empty
        for index in range(len(self)):
            held = self._held(index)
            state["jaw_body"][0, index] = -1 if held is None else held.body
            state["jaw_force"][0, index] = 0.0 if held is None else held.normal_force
            state["jaw_wrench"][0, index] = 0.0 if held is None else held.wrench
            state["jaw_slip"][0, index] = 0.0 if held is None else held.slip

    def reset(self) -> None:
        """Release everything; the resets of bodies and rods clear what they know of grasps."""
        jaws = len(self._scene.jaws)
        self._jaw_grasps, self._thread_grasps, self._pads = [None] * jaws, [None] * jaws, [None] * jaws
        self._disabled, self._near = [[] for _ in range(jaws)], [False] * jaws
        for fingers in self._fingers:
            fingers.reset()
        self._actuator_grasps.reset()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick; bodies and rods keep their side in their own snapshots."""
        fingers = [fingers.snapshot() for fingers in self._fingers]
        return {"fingers": fingers, "actuator_grasps": self._actuator_grasps.snapshot(), **kept(self, _KEPT)}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        put_back(self, {name: snapshot[name] for name in _KEPT})
        self._written_empty = False
        for fingers, state in zip(self._fingers, snapshot["fingers"], strict=True):
            fingers.restore(state)
        self._actuator_grasps.restore(snapshot["actuator_grasps"])


_KEPT = ("_jaw_grasps", "_thread_grasps", "_pads", "_disabled", "_near")
"""Attributes of `Grasps` that last from tick to tick."""


def _held_thread(name: str, thread: thread_grasps.ThreadGrasp) -> Held:
    limit = 2.0 * thread.friction * thread.normal_force
    share = float(np.linalg.norm(thread.force)) / limit if limit > 0.0 else 0.0
    wrench = np.concatenate([thread.force, np.zeros(3)])
    return Held(name, thread.body, thread.normal_force, wrench, np.array([abs(thread.slip), 0.0]), share)


def _patch_pose(fingers: Fingers, faces: tuple[Facing, Facing]) -> Array:
    """Pose (4, 4) of the patch between two touching pads: z along the closing direction, x along the fingers."""
    axis, pivot = fingers.axis()
    point = 0.5 * (faces[0].point + faces[1].point)
    lever = point - pivot
    lever = lever - (lever @ axis) * axis
    z = fingers.closing(0, axis, lever)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([np.cross(axis, z), axis, z])
    T[:3, 3] = point
    return T
