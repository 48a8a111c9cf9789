"""One Bullet client with all rigid bodies of a scene, where they are and how they move.

World axes, SI units; poses are x y z qx qy qz qw.
"""

from __future__ import annotations

import weakref
from typing import Any

import numpy as np
import pybullet
from numpy.typing import NDArray

from ligature.mesh import CollisionCache
from ligature.model.frames import matrix_pose7
from ligature.model.scene import Scene
from ligature.physics.articulation import Tree, build
from ligature.physics.bodies import Placement
from ligature.physics.bullet import connect, exclude_void, find_boxes, find_owners, find_sleepers
from ligature.physics.motions import Motions
from ligature.physics.parking import Boxes, boxes
from ligature.physics.trees import Places
from ligature.tables import table_of

Array = NDArray[np.float64]
Pose = tuple[tuple[float, ...], tuple[float, ...]]
"""Position (3,) and quaternion (4,) as Bullet returns them."""

SOLVER_ITERATIONS = 50
"""With 10, a step on the base of an arm shakes its jaws by 0.06 rad; contacts at rest cost the same."""

LOOP_ITERATIONS = 200
"""The same where loops close: with 50, links of grams beside ones of kilograms part by 2 mm, with 200 by 0.1 mm."""

CLOSING = 0.8
"""Part of a loop's gap that Bullet closes within a tick; its 0.2 lets a swinging linkage open by 0.5 mm."""

MOVES, STANDS, VOID = (1, -1), (2, -3), (0, 0)
"""Bullet's collision group and mask of what moves, of what stands and meets only what moves, its own defaults, and of
what has no shape: Bullet would look for contacts of each such link with all whose boxes it lies in, in each tick."""

MOST_PAIRED = 128
"""Bodies up to which Bullet compares all pairs of boxes in a tick, which costs nothing up to a hundred.

Its trees of boxes, for more, balance themselves by addresses in memory and by counters that nothing resets: the order
of pairs, and with it that of contacts in the solver, goes on from whatever moved before.
"""

NEAR = 0.002
"""Gap in metres up to which Bullet prepares contacts; its 20 mm takes half of the time of a needle on a phantom."""


def common_gravity(scene: Scene) -> Array:
    """The gravity (3,) that all moving bodies of trees share; none where they differ: under Bullet's nothing sleeps."""
    members = [scene.bodies[link.body] for articulation in scene.articulations for link in articulation.links]
    found = {tuple(body.gravity.tolist()) for body in members if not body.static} or {tuple(scene.world.gravity)}
    return np.array(found.pop() if len(found) == 1 else (0.0, 0.0, 0.0))


class Engine:
    """The trees of ``scene`` in a Bullet client.

    Bullet's contacts cannot be read or set, so whatever begins anew begins without: `forget_contacts` where that is
    all that is remembered, else `rebuild`; whoever keeps one of these attributes over a rebuild has those of the
    client that is gone.

    Attributes
    ----------
    client
        Bullet's number of the client.
    trees
        The scene's articulations in Bullet, in order.
    motions
        Poses, twists, joints of all trees.
    place_of, places, place_table
        Where each body outside rods is; the same as arrays, and their addresses for compiled code.
    body_at
        The body at Bullet's multibody and link.
    boxed
        Multibody and link of each of the boxes of `Motions.trees`.
    chunks
        For bodies whose shapes are in other multibodies than their own: these, with link, group and mask.
    gravity
        Bullet's gravity (3,).
    forgets
        Whether `forget_contacts` leaves nothing of what was before.
    """

    def __init__(self, scene: Scene, dt: float) -> None:
        self.scene, self.dt = scene, dt
        self.cache = CollisionCache()
        self.gravity = common_gravity(scene)
        self.forgets = sum(len(articulation.links) for articulation in scene.articulations) <= MOST_PAIRED
        self._build()

    def _build(self) -> None:
        scene = self.scene
        self.client, handle = connect()
        self._end = weakref.finalize(self, pybullet.disconnect, self.client)
        if self.forgets:
            pybullet.resetSimulation(pybullet.RESET_USE_SIMPLE_BROADPHASE, physicsClientId=self.client)
        iterations = LOOP_ITERATIONS if scene.closures else SOLVER_ITERATIONS
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=self.dt, numSubSteps=0, numSolverIterations=iterations, erp=CLOSING,
            deterministicOverlappingPairs=1, contactBreakingThreshold=NEAR, physicsClientId=self.client,
        )  # fmt: skip
        pybullet.setGravity(*self.gravity.tolist(), physicsClientId=self.client)
        self._restored: dict[tuple[int, Pose], Pose] = {}
        self.trees = [build(self.client, self.cache, scene, a, dt=self.dt) for a in scene.articulations]
        self._colliders = [collider for tree in self.trees for collider in _colliders(self.client, tree)]
        self._boxes = find_boxes(handle) if self.forgets else 0
        sleepers = self._sleepers()
        self.motions = Motions(self.client, handle, self.trees, sleepers, self._compared(any(sleepers)))
        self.place_of = {
            body: Placement(self.client, tree, scene.bodies[body], self.motions, k)
            for k, tree in enumerate(self.trees)
            for body in tree.link_of
        }
        self.places = Places(*np.full((4, len(scene.bodies)), -1))
        for body, place in self.place_of.items():
            for array, value in zip(self.places, (place.tree, place.row, place.uid, place.link), strict=True):
                array[body] = value
        self.place_table = table_of(self.places)
        self.body_at = {(place.uid, place.link): body for body, place in self.place_of.items()}
        self.chunks: dict[int, list[tuple[int, int, int, int]]] = {}
        self.start = self.snapshot()
        self.restore(self.start)  # as every later start: Bullet turns what it makes by a last bit
        self._measure()

    def rebuild(self) -> None:
        """Begin anew with another client: all bodies are where the scene starts, and nothing is known of contacts."""
        self.close()
        self._build()

    def forget_contacts(self) -> None:
        """Take all shapes out of Bullet's world and put them back in their first order, where they are now.

        Their contacts, pairs and boxes go, with what solvers know from the last tick. Where Bullet compares all pairs,
        each shape gets its place and number back, and what follows is a function of poses, velocities and commands.
        """
        for uid, link, group, mask in [*self._colliders, *(chunk for found in self.chunks.values() for chunk in found)]:
            pybullet.setCollisionFilterGroupMask(uid, link, group, mask, physicsClientId=self.client)
        exclude_void(self._boxes)
        self.motions.begin()

    def _sleepers(self) -> list[list[int]]:
        """Addresses of the activation states of each tree's moving colliders; none for trees that may not sleep.

        Gravity acts on a tree in every tick; loops and the chunks of volumes put bodies elsewhere.
        """
        found: dict[int, list[int]] = {tree.uid: [] for tree in self.trees}
        places = find_sleepers(self._boxes)
        restless = self.gravity.any() or self.scene.closures or self.scene.volumes
        if len(places) == len(self._colliders) and not restless:
            stands = {(tree.uid, -1) for tree in self.trees if tree.static}
            for (uid, link, *_), place in zip(self._colliders, places.tolist(), strict=True):
                if uid in found and (uid, link) not in stands:
                    found[uid].append(place)
        # Bullet takes a link that a fixed joint holds to what stands, or to the first link, as standing: it never wakes
        return [own if all(own) else [] for own in found.values()]

    def _compared(self, wanted: bool) -> Boxes:
        """The boxes of the trees that Bullet compares, which may be taken out of that; none unless ``wanted``."""
        at, owner = find_owners(self._boxes if wanted else 0)
        tree_of = {uid: k for k, tree in enumerate(self.trees) for uid in tree.bases}
        live = [i for i, (*_, group, mask) in enumerate(self._colliders) if (group, mask) != VOID] if len(at) else []
        found = boxes(len(self.trees), len(live), len(at))
        self.boxed = [self._colliders[i][:2] for i in live]
        found.phase[0] = self._boxes
        found.at[:], found.owner[:] = at[live], owner[live]
        found.tree[:] = [tree_of[self._colliders[i][0]] for i in live]
        found.row[live] = np.arange(len(live))
        return found

    def _measure(self) -> None:
        """Find how far anything is from the joint or base that moves it, for `Trees.far`."""
        motions, arrays = self.motions, self.motions.trees
        if not len(arrays.boxes.at):
            return
        motions.everything()
        far = arrays.far
        far[:] = 0.0
        tree_of = {tree.uid: k for k, tree in enumerate(self.trees)}
        for uid, link, group, mask in self._colliders:
            if uid in tree_of and (group, mask) != VOID:
                row = motions.row(tree_of[uid], link)
                corners = np.array(pybullet.getAABB(uid, link, physicsClientId=self.client))
                farthest = np.abs(corners - motions.pose[row, :3]).max(axis=0)
                far[row] = max(far[row], float(np.linalg.norm(farthest)))
        far += np.linalg.norm(arrays.fixed[:, 10:13], axis=1)
        offset = np.linalg.norm(arrays.fixed[:, 3:6], axis=1)
        for row in range(len(far) - 1, -1, -1):  # parents come before their children
            parent = arrays.rows[row, 0]
            if parent >= 0:
                far[parent] = max(far[parent], offset[row] + far[row])
        motions.forget_all()

    def collide(self, uid: int, group: int, mask: int) -> None:
        """Set group and mask of the base of a multibody that was added to the scene's own."""
        pybullet.setCollisionFilterGroupMask(uid, -1, group, mask, physicsClientId=self.client)
        exclude_void(self._boxes)

    def shapes_of(self, body: int) -> list[tuple[int, int]]:
        """Multibodies and links that hold the shapes of a body."""
        place = self.place_of.get(body)
        return [] if place is None else [(place.uid, place.link), *(chunk[:2] for chunk in self.chunks.get(body, ()))]

    def restart(self, tree: int) -> None:
        """Put one tree back to where the scene starts, at rest."""
        root = self.trees[tree].root
        self.place_of[root].set_pose(matrix_pose7(self.scene.start.roots[root]))
        self.trees[tree].put_joints(self.client)
        self.motions.forget(tree)

    def snapshot(self) -> dict[str, Any]:
        """Motion of all trees: pose and velocity of the base, position and velocity of each joint."""
        trees = []
        for tree in self.trees:
            pose = pybullet.getBasePositionAndOrientation(tree.uid, physicsClientId=self.client)
            pose = self._restored.get((tree.uid, pose), pose)
            velocity = pybullet.getBaseVelocity(tree.uid, physicsClientId=self.client)
            links = [link for link, *_ in tree.axes]
            states = pybullet.getJointStates(tree.uid, links, physicsClientId=self.client) if links else []
            trees.append((pose, velocity, [(s[0], s[1]) for s in states]))
        arrays = self.motions.trees
        return {"trees": trees, "sent": (arrays.sent.copy(), arrays.sent_effort.copy())}

    def restore(self, snapshot: dict[str, Any]) -> None:
        """Set the motion of all trees; `forget_contacts` is to follow. Bullet's own saved states are not exact."""
        self._restored.clear()
        for tree, (pose, velocity, joints) in zip(self.trees, snapshot["trees"], strict=True):
            self.place_of[tree.root].set_inertial_pose(*pose)
            # Bullet turns what it is given by a last bit: a base that has not moved since keeps the snapshot's pose
            turned = pybullet.getBasePositionAndOrientation(tree.uid, physicsClientId=self.client)
            self._restored[tree.uid, turned] = pose
            for (link, *_), (q, qd) in zip(tree.axes, joints, strict=True):
                pybullet.resetJointState(tree.uid, link, q, qd, physicsClientId=self.client)
            pybullet.resetBaseVelocity(tree.uid, *velocity, physicsClientId=self.client)
        self.motions.trees.sent[:], self.motions.trees.sent_effort[:] = snapshot["sent"]
        self.motions.forget_all()

    def close(self) -> None:
        """Give the Bullet client back; an engine that is forgotten does so by itself."""
        self.motions.handle = 0  # compiled code would read what is no longer there
        self._end()


def _colliders(client: int, tree: Tree) -> list[tuple[int, int, int, int]]:
    """Multibody, link, group and mask of the shapes of a tree, in the order in which they were made."""
    stand = [(tree.stand, -1, *STANDS)] if tree.stand != tree.uid else []
    links = {-1: STANDS if tree.static else MOVES, **dict.fromkeys(range(len(tree.frames)), MOVES)}
    shaped = {link for link in links if pybullet.getCollisionShapeData(tree.uid, link, physicsClientId=client)}
    return [*stand, *((tree.uid, link, *(kind if link in shaped else VOID)) for link, kind in links.items())]
