"""Grasps of a running scene: jaws that close on a body hold it by friction, until they open or it slips out.

Bullet's contacts move fingers and bodies until both pads touch. From then on the law of `ligature.suture.grasp`
acts in their place: fingers stop where they are, their contacts with the body are off, and the force between
them follows from the efforts that their commands ask for. World axes, SI units.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ligature.grasping import pinches
from ligature.grasping.clamps import Clamps
from ligature.grasping.fingers import LEAST_LEVER, TOUCH, Facing, Fingers
from ligature.grasping.grips import Exchange, Grip, begin
from ligature.model.frames import inverse, pose7_matrix
from ligature.model.scene import Jaw, Scene
from ligature.model.state import StateRecord
from ligature.model.subsystem import Subsystem, kept, put_back
from ligature.physics import World
from ligature.suture import Rods
from ligature.suture.grasp import Patch, warm_up
from ligature.suture.rod import Pads

Array = NDArray[np.float64]

LOOK = 5
"""Ticks between two looks at what stands between open fingers."""

CREEP = 0.2e-3
"""Slip in metres after which a jaw looks whether the body is still between its pads."""

JUMP = 0.01
"""Way in metres that no holder goes within a tick unless it is put elsewhere."""

PRESENT = 0.3e-3
"""Gap in metres, that of both pads together, beyond which they have lost the body."""


@dataclass(frozen=True, eq=False)
class Held:
    """What one jaw holds.

    ``body`` is the scene's index; ``normal_force`` (N) presses the fingers together; ``wrench`` (6,) acts on the
    body about the patch, world axes; ``slip`` (2,) is how far it slipped since it was grasped, in metres and
    radians; ``share`` how much of the friction is used, 1 while it slips.
    """

    jaw: str
    body: int
    normal_force: float
    wrench: Array
    slip: Array
    share: float


@dataclass
class _Grip(Grip):
    """A grip and what it needs of its jaw: levers of the pads, joint positions at which the fingers stop.

    ``holder_at`` (3,) is where the holder was in the last tick.
    """

    levers: tuple[float, float]
    positions: tuple[float, float]
    holder_at: Array
    checked: float = 0.0

    def jumped(self, holder_at: Array) -> bool:
        """Whether the holder, now at ``holder_at`` (3,), was put elsewhere since the last call."""
        before, self.holder_at = self.holder_at, holder_at
        return bool(np.abs(holder_at - before).max() > JUMP)


class Grasps(Subsystem, Mapping[str, Held | None]):
    """What the jaws of a scene hold, by the jaw's name; None for nothing.

    Parameters
    ----------
    clamps
        What actuators that yield hold; it is solved together with what jaws hold.
    actuated
        Gives the body that each actuator of the scene holds, -1 for none: what a tool's own actuator holds
        rigidly, its jaw does not hold by friction.
    """

    def __init__(
        self, scene: Scene, world: World, rods: Rods, clamps: Clamps, actuated: Callable[[], list[int]]
    ) -> None:
        self._scene, self._world, self._rods, self._clamps, self._actuated = scene, world, rods, clamps, actuated
        self._fingers = [Fingers(jaw, world) for jaw in scene.jaws]
        tree_of = {link.body: tree for tree in scene.articulations for link in tree.links}
        self._own = [{link.body for link in tree_of[jaw.holder].links} for jaw in scene.jaws]
        self._actuators = [[a.index for a in scene.actuators if a.parent in own] for own in self._own]
        self._grips: list[_Grip | None] = [None for _ in scene.jaws]
        self._pinches: list[pinches.Pinch | None] = [None for _ in scene.jaws]
        self._pads: list[Pads | None] = [None for _ in scene.jaws]
        self._passing: list[list[int]] = [[] for _ in scene.jaws]
        self._near = [False for _ in scene.jaws]
        self._exchange = Exchange(world)
        if scene.jaws:
            warm_up()

    def __getitem__(self, name: str) -> Held | None:
        for index, jaw in enumerate(self._scene.jaws):
            if jaw.name == name:
                return self._held(index)
        known = ", ".join(jaw.name for jaw in self._scene.jaws) or "none"
        raise KeyError(f"no jaw is called '{name}'; there are {known}")

    def __iter__(self) -> Iterator[str]:
        return (jaw.name for jaw in self._scene.jaws)

    def __len__(self) -> int:
        return len(self._scene.jaws)

    def _held(self, index: int) -> Held | None:
        grip, pinch = self._grips[index], self._pinches[index]
        if pinch is not None:
            return _held_thread(self._scene.jaws[index].name, pinch)
        if grip is None:
            return None
        grasp = grip.grasp
        R = grasp.world_patch(self._world.motion(self._scene.jaws[index].holder)[0])[:3, :3]
        wrench = np.concatenate([R @ grasp.load[:3], R @ grasp.load[3:]])
        name = self._scene.jaws[index].name
        return Held(name, grip.body, grasp.normal_force, wrench, grasp.slipped.copy(), grasp.share())

    def patch(self, name: str) -> Array:
        """Pose (4, 4) in world axes of the patch in which a jaw holds, z normal to the pads, x along the fingers.

        Raises ValueError when it holds nothing.
        """
        index = [jaw.name for jaw in self._scene.jaws].index(name)
        grip = self._grips[index]
        if grip is None:
            raise ValueError(f"the jaw of {name} holds nothing")
        return grip.grasp.world_patch(self._world.motion(self._scene.jaws[index].holder)[0])

    # --- the tick ---------------------------------------------------------------------------

    def step(self, tick: int) -> None:
        """Look, close, hold, let go; the coming tick of the bodies moves by the impulses."""
        for index, grip in enumerate(self._grips):
            pinch = self._pinches[index]
            if grip is not None:
                self._keep(index, grip)
            elif pinch is not None:
                self._keep_thread(index, pinch)
            elif self._near[index] or ((tick + index) % LOOK == 0 and self._fingers[index].driven()):
                self._look(index)
        self._hold()

    def _look(self, index: int) -> None:
        """Close gently on what is between the fingers; grasp it when both touch it."""
        fingers, passing = self._fingers[index], self._passing[index]
        around, box = self._world.surroundings(fingers.jaw.fingers)
        between: list[tuple[int, tuple[Facing, Facing]]] = []
        for body in around:
            if self._scene.bodies[body].static or body in self._own[index]:
                continue
            faces = fingers.facing(body, fingers.jaw.reach)
            if faces is not None:
                between.append((body, faces))
        for body in [body for body in passing if not fingers.near(body)]:
            self._disable_collision(index, body, False)
        thread = pinches.within(self._rods, box)
        self._near[index] = bool(between or passing or thread)
        if not between:
            if not thread:
                fingers.let()
            elif not self._pinch(index):
                fingers.approach_thread(box)
            return
        body, faces = min(between, key=lambda item: item[1][0].gap + item[1][1].gap)
        if max(faces[0].gap, faces[1].gap) <= TOUCH and min(fingers.efforts()) > 0.0:
            self._grasp(index, body, faces)
        else:
            fingers.approach(faces)

    def _grasp(self, index: int, body: int, faces: tuple[Facing, Facing]) -> None:
        fingers, jaw = self._fingers[index], self._scene.jaws[index]
        holder = self._world.motion(jaw.holder)[0]
        T_holder_patch = inverse(pose7_matrix(holder)) @ _patch_pose(fingers, faces)
        friction = self._friction(jaw, self._scene.bodies[body].friction)
        grasp, ride = begin(self._world, jaw.holder, body, Patch(T_holder_patch, jaw.half_width, friction))
        levers = faces[0].lever, faces[1].lever
        grip = _Grip(body, jaw.holder, grasp, ride, levers, fingers.positions(), holder[:3])
        self._grips[index] = grip
        self._take(index, grip)
        self._world.hold_up(body, True, gripped=True)
        self._rods.update_masses(self._world)
        self._keep(index, grip)

    def _pinch(self, index: int) -> bool:
        """Hold a thread that both pads touch."""
        fingers, jaw = self._fingers[index], self._scene.jaws[index]
        for number, rod in enumerate(self._rods.rods):
            friction = self._friction(jaw, float(rod.description.friction.mean()))
            pinch = pinches.begin(number, self._rods, self._world, fingers, friction)
            if pinch is not None:
                self._pinches[index] = pinch
                self._world.stopped_fingers.update(jaw.fingers)
                self._keep_thread(index, pinch)
                return True
        return False

    def _keep_thread(self, index: int, pinch: pinches.Pinch) -> None:
        """Let the pads of a jaw act on a thread in the coming tick, or let it go."""
        pads = pinches.keep(pinch, self._rods, self._world, self._fingers[index])
        if pads is None:
            self._end_thread(index, pinch)
        else:
            self._pads[index] = pads
            self._tell_rod(pinch.rod)

    def _end_thread(self, index: int, pinch: pinches.Pinch) -> None:
        """Let a thread go."""
        self._pinches[index] = self._pads[index] = None
        self._world.stopped_fingers -= set(self._scene.jaws[index].fingers)
        self._rods.exclude(pinch.rod, self._scene.jaws[index].fingers, None)
        self._fingers[index].let()
        self._tell_rod(pinch.rod)

    def _tell_rod(self, number: int) -> None:
        """Let a rod know all pads that hold it."""
        held = [
            other
            for p, other in zip(self._pinches, self._pads, strict=True)
            if p is not None and other is not None and p.rod == number
        ]
        self._rods.rods[number].pinch(held)

    def _friction(self, jaw: Jaw, other: float) -> float:
        """Coefficient between the pads and something with the friction ``other``: the product, as for all contacts."""
        return other * float(np.mean([self._scene.bodies[finger].friction for finger in jaw.fingers]))

    def _take(self, index: int, grip: _Grip) -> None:
        """Put the law in the place of Bullet's contacts and motors."""
        self._disable_collision(index, grip.body, True)
        self._fingers[index].stop(grip.positions, (0.0, 0.0))

    def _disable_collision(self, index: int, body: int, passes: bool) -> None:
        for finger in self._scene.jaws[index].fingers:
            self._world.disable_collision(finger, body, passes)
        self._passing[index] = sorted({*self._passing[index], body} if passes else {*self._passing[index]} - {body})

    def _keep(self, index: int, grip: _Grip) -> None:
        """Press as hard as the commands ask; let go when they open, or when the body has slipped out."""
        fingers = self._fingers[index]
        efforts = fingers.efforts()
        force = min(effort / max(lever, LEAST_LEVER) for effort, lever in zip(efforts, grip.levers, strict=True))
        if force <= 0.0 or grip.jumped(self._world.motion(fingers.jaw.holder)[0][:3]):
            self._let_go(index)
            return
        grip.grasp.normal_force = force
        fingers.stop(grip.positions, (force * grip.levers[0], force * grip.levers[1]))
        if grip.grasp.slipped[0] > grip.checked + CREEP:
            self._look_again(index, grip)

    def _look_again(self, index: int, grip: _Grip) -> None:
        """Let patch and fingers follow a body that slips; let go when it has slipped out."""
        fingers = self._fingers[index]
        grip.checked = float(grip.grasp.slipped[0])
        faces = fingers.facing(grip.body, fingers.jaw.reach)
        room = np.inf if faces is None else faces[0].gap + faces[1].gap
        if faces is None or room > PRESENT:
            self._let_go(index)
            return
        T_holder_world = inverse(pose7_matrix(self._world.motion(fingers.jaw.holder)[0]))
        grip.grasp.move_patch(T_holder_world @ _patch_pose(fingers, faces))
        grip.levers = faces[0].lever, faces[1].lever
        grip.positions = fingers.moved(grip.positions, (0.5 * room, 0.5 * room), grip.levers)

    def _let_go(self, index: int) -> None:
        """End a grasp; contacts stay off until the fingers are clear of the body."""
        grip = self._grips[index]
        if grip is None:
            return
        self._grips[index] = None
        self._fingers[index].let()
        self._world.hold_up(grip.body, False, gripped=True)
        self._rods.update_masses(self._world)
        self._near[index] = True

    def _hold(self) -> None:
        """Exchange impulses between held bodies and what holds them."""
        by_body: dict[int, list[Grip]] = {}
        if self._clamps.lose(slipped=True):
            self._rods.update_masses(self._world)
        for clamp in self._clamps.grips:
            by_body.setdefault(clamp.body, []).append(clamp)
        for index, grip in enumerate(self._grips):
            if grip is not None:
                actuated = self._actuated()
                if grip.body not in [actuated[a] for a in self._actuators[index]]:
                    by_body.setdefault(grip.body, []).append(grip)
        for grips in by_body.values():
            self._exchange.between(grips)

    # --- state ------------------------------------------------------------------------------

    def let_go_of(self, body: int | None = None) -> None:
        """Release a body that is put elsewhere; all bodies for None."""
        for index, grip in enumerate(self._grips):
            if grip is not None and body in (None, grip.body):
                self._let_go(index)
            pinch = self._pinches[index]
            if pinch is not None and body is None:
                self._end_thread(index, pinch)
        if self._clamps.lose(body):
            self._rods.update_masses(self._world)

    def write_state(self, state: StateRecord) -> None:
        """Write what every jaw holds into a state record."""
        for index in range(len(self)):
            held = self._held(index)
            state["jaw_body"][0, index] = -1 if held is None else held.body
            state["jaw_force"][0, index] = 0.0 if held is None else held.normal_force
            state["jaw_wrench"][0, index] = 0.0 if held is None else held.wrench
            state["jaw_slip"][0, index] = 0.0 if held is None else held.slip

    def reset(self) -> None:
        """Let go of everything; bodies and rods forget what held them by their own resets."""
        jaws = len(self._scene.jaws)
        self._grips, self._pinches, self._pads = [None] * jaws, [None] * jaws, [None] * jaws
        self._passing, self._near = [[] for _ in range(jaws)], [False] * jaws
        for fingers in self._fingers:
            fingers.reset()
        self._clamps.reset()

    def snapshot(self) -> dict[str, Any]:
        """Everything that lasts from tick to tick; what bodies and rods know of it is in their own snapshots."""
        fingers = [fingers.snapshot() for fingers in self._fingers]
        return {"fingers": fingers, "clamps": self._clamps.snapshot(), **kept(self, _KEPT)}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Continue from `snapshot`."""
        put_back(self, {name: snapshot[name] for name in _KEPT})
        for fingers, state in zip(self._fingers, snapshot["fingers"], strict=True):
            fingers.restore(state)
        self._clamps.restore(snapshot["clamps"])


_KEPT = ("_grips", "_pinches", "_pads", "_passing", "_near")
"""Attributes of `Grasps` that last from tick to tick."""


def _held_thread(name: str, pinch: pinches.Pinch) -> Held:
    limit = 2.0 * pinch.friction * pinch.normal_force
    share = float(np.linalg.norm(pinch.force)) / limit if limit > 0.0 else 0.0
    wrench = np.concatenate([pinch.force, np.zeros(3)])
    return Held(name, pinch.body, pinch.normal_force, wrench, np.array([abs(pinch.slip), 0.0]), share)


def _patch_pose(fingers: Fingers, faces: tuple[Facing, Facing]) -> Array:
    """Pose (4, 4) of the patch between two touching pads: z along the fingers' way, x along the fingers."""
    axis, pivot = fingers.axis()
    point = 0.5 * (faces[0].point + faces[1].point)
    lever = point - pivot
    lever = lever - (lever @ axis) * axis
    z = fingers.closing(0, axis, lever)
    T = np.eye(4)
    T[:3, :3] = np.column_stack([np.cross(axis, z), axis, z])
    T[:3, 3] = point
    return T
